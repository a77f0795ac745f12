"""Model that the comparison of models allows to assert.

Statistical significance is not enough: the schema requires physics to make at least 0.4 % of the
mean squared effort of some joint. Among models of nearly the same residual the one with the fewest
parameters is asserted, if each of its effects predicts parts of the recording that were left out
(`support`).

It is adequate, joint by joint, when what it leaves is small against what it explains there: as far
as the motion predicts it (`repeatable`), for another law would explain that, and, less strictly,
as far as earlier rows do. Where large forces cancel in an effort, their accuracy is what counts
(`cancelling`). Effects of a joint that it does not describe are not asserted; those of
the others stand. If together they explain more of the efforts than is left open, the verdict is
`missing_physics` with an unknown beside it, else `unexplained` with what is known beside it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import (
    ADEQUATE_REST,
    COUNTED_SHARE,
    EVIDENCE,
    LEAST_SHARE,
    NEARLY,
    NOTHING_EXPLAINED,
    UNNAMED_EXCESS,
)
from sgp_ros.diagnosis.decide.cancelling import within_accuracy
from sgp_ros.diagnosis.decide.cross_validation import repeatable, structure, supported, without
from sgp_ros.diagnosis.decide.scale import Scale
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.comparison import Comparison
from sgp_ros.diagnosis.explain.credibility import is_credible, is_sound
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.physics.place import JOINT, MOTOR

UNKNOWN = 'unknown'
"""Name of what no effect of the list describes."""


@dataclass(frozen=True, eq=False)
class Decision:
    """The verdict and the models behind it.

    Attributes:
        verdict: as in the schema.
        model: that is asserted; for `unexplained` that of the joints that are described.
        rivals: models that were not asserted, best first.
        excess: (k,) what the best model leaves, relative to what an adequate one may.
        worst: index of the joint where most is left.
        unknown: indices of joints that the best model does not describe, the worst first.
        tentative: best model where nothing is adequate.
        against: score of the best model without effects [nats].
        refusals: why models that could be asserted are not, by their keys.
        standing: everyday laws that stand at unknown joints: standard deviations, by their keys.
        shaped: by unknown joint whose force has a known shape, a model without that force, with
            the everyday laws that stand beside it, and their standard deviations, by their keys.
    """

    verdict: str
    model: Model
    rivals: tuple[Model, ...]
    excess: np.ndarray
    worst: int
    unknown: tuple[int, ...] = ()
    tentative: Model | None = None
    against: float = 0.0
    refusals: Mapping[object, str] = field(default_factory=dict)
    standing: Mapping[object, float] = field(default_factory=dict)
    shaped: Mapping[int, tuple[Model, Mapping[object, float]]] = field(default_factory=dict)

    def without(self, why: str) -> Decision:
        """Return the decision with the reason why its model is not asserted after all."""
        model = self.tentative or self.model
        return replace(self, refusals={model.key: why} | dict(self.refusals))


def _ranked(comparison: Comparison, scale: Scale) -> list[Model]:
    """Return the models that could be asserted, best first.

    There are none where the best explanation of all is too small to be physics: a worse one that
    is larger, because bodies undo most of it, is not to be preferred for that. One that
    couples joints is not small where it only says what laws of each joint say, which follow it.
    """
    models = (*comparison.singles, *comparison.pairs, *comparison.more)
    least = comparison.base.score + EVIDENCE
    sound = [m for m in models if m.score > least and is_sound(m)]
    ranked = sorted(sound, key=scale.worth, reverse=True)
    if ranked and _size(ranked[0]) < COUNTED_SHARE:
        return []
    return [m for m in ranked if scale.counts(m)]


def _size(model: Model) -> float:
    """Return the greatest share of an effect; a law that couples joints with its plain laws."""
    shares = zip(model.effects, model.shares, model.filtered_shares, strict=True)
    return max(filtered if s.place.source >= 0 else share for s, share, filtered in shares)


def decide(equations: Equations, comparison: Comparison) -> Decision:
    """Return the verdict on a recording.

    Nothing is missing where plausible bodies leave no more than any adequate model may: the least
    share of physics, or a small part of what they explain, for signals have errors in proportion.
    """
    scale, base = Scale.of(equations, comparison), comparison.base
    ranked = _ranked(comparison, scale)
    likely = [m for m in ranked if scale.worth(m) > scale.worth(base) and not comparison.is_calm]
    best = supported(equations, scale, likely)
    rivals = tuple(m for m in ranked if m is not best)
    if best is not None:
        return _judged(equations, scale, comparison, best, rivals)
    left, most = comparison.parameters.left, np.maximum(LEAST_SHARE, ADEQUATE_REST * scale.nominal)
    nothing = np.where(left > most, NOTHING_EXPLAINED, 0.0)
    if nothing.any():
        left = left * structure(equations, comparison.parameters.residual)
    if (left > most).any():
        open_ = np.where(left > most, scale.base, 0.0)
        worst = int(np.argmax(open_))
        unknown = _ordered(open_, worst)
        return Decision('unexplained', base, rivals, nothing, worst, unknown, None, base.score)
    return calm(base, rivals, scale)


def calm(base: Model, rivals: tuple[Model, ...], scale: Scale) -> Decision:
    """Return the decision that no effect is missing."""
    verdict = 'parameters_only' if base.is_free else 'no_mismatch'
    excess = np.full(len(scale.base), NOTHING_EXPLAINED)
    return Decision(verdict, base, rivals, excess, int(np.argmax(scale.base)), against=base.score)


def _judged(
    equations: Equations,
    scale: Scale,
    comparison: Comparison,
    best: Model,
    rivals: tuple[Model, ...],
) -> Decision:
    """Return the verdict on the best model: which joints it describes, and whether most."""
    base = comparison.base
    predictable = repeatable(equations, best.residual, scale.excess(best) >= 1.0)
    excess = scale.excess(best, predictable)
    standing, kept, is_accurate = within_accuracy(equations, best, excess)
    if not (kept >= 1.0).any():
        worst = int(np.argmax(scale.base))
        return Decision('missing_physics', standing, rivals, kept, worst, against=base.score)
    opened = _opened(equations, scale, comparison, standing, rivals, kept, is_accurate)
    if standing is not best and opened.verdict != 'missing_physics':
        opened = _opened(equations, scale, comparison, best, rivals, excess)
    times = f'{max(excess.max(), 1.01):.3g} times what an adequate model may leave'
    return replace(opened, refusals={best.key: f'the part that is not noise is {times}'})


def refused(
    equations: Equations, comparison: Comparison, decision: Decision, joint: int, why: str
) -> Decision:
    """Return a decision in which the laws of a joint, adequate by themselves, are not asserted.

    Something without a name explains it better, or they fail elsewhere: `why` says which.
    """
    decision, excess = decision.without(why), decision.excess.copy()
    excess[joint] = max(excess[joint], UNNAMED_EXCESS)
    if decision.verdict != 'missing_physics':
        return replace(decision, excess=excess)
    scale, rivals = Scale.of(equations, comparison), decision.rivals
    opened = _opened(equations, scale, comparison, decision.model, rivals, excess)
    return replace(opened, refusals=decision.refusals)


def _opened(
    equations: Equations,
    scale: Scale,
    comparison: Comparison,
    best: Model,
    rivals: tuple[Model, ...],
    excess: np.ndarray,
    is_accurate: np.ndarray | None = None,
) -> Decision:
    """Return the verdict where the best model does not describe the joints with an excess.

    What is left open at joints where the rest is within the accuracy of forces need not be less
    than what is named.
    """
    base, excess = comparison.base, _passed_on(best, excess)
    open_ = np.flatnonzero(excess >= 1.0)
    worst = int(open_[np.argmax(scale.base[open_])])
    known = _described(equations, best, open_)
    named = scale.found(best)
    is_open = np.isin(np.arange(len(named)), open_)
    unsaid = named[is_open if is_accurate is None else is_open & ~is_accurate].sum()
    stands = bool(known.effects) and is_credible(known)
    if stands and named[~is_open].sum() > unsaid:
        unknown = _ordered(np.where(is_open, excess, 0.0), int(np.argmax(excess)))
        return Decision('missing_physics', known, (best, *rivals), excess, unknown[0], unknown,
                        against=base.score)  # fmt: skip
    left, is_seen = comparison.parameters.left, max(best.filtered_shares) > COUNTED_SHARE
    if left.max() > COUNTED_SHARE or (is_seen and (best.left < NEARLY * left)[open_].any()):
        unknown = _ordered(np.where(is_open, excess, 0.0), worst)
        beside = _beside(equations, scale, base, known) if stands else base
        return Decision('unexplained', beside, (best, *rivals), excess, worst, unknown, best,
                        base.score)  # fmt: skip
    return calm(base, rivals, scale)


def _described(equations: Equations, best: Model, open_: np.ndarray) -> Model:
    """Return the laws of the joints that are described, beside bodies that can be.

    Those that may differ would stand for what is unknown at the other joints.
    """
    known = without(
        equations, best, lambda s: s.place.joint in open_ and s.effect.site in {JOINT, MOTOR}
    )
    if not known.is_free or not known.effects or is_credible(known):
        return known
    return fit(Columns(equations), known.effects, known.sigma, is_free=False)


def _passed_on(model: Model, excess: np.ndarray) -> np.ndarray:
    """Return the excess where a law that acts on two joints describes both of them or none.

    What is unknown at one of them would undo there what the law says wrongly.
    """
    found = excess.copy()
    while True:
        passed = [
            s.place.joint for s, force in zip(model.effects, model.forces, strict=True)
            if s.place.source >= 0 and found[s.place.joint] < 1.0 <= found[s.place.source]
            and force[:, s.place.source].any()
        ]  # fmt: skip
        if not passed:
            return found
        found[passed] = UNNAMED_EXCESS


def _beside(equations: Equations, scale: Scale, base: Model, known: Model) -> Model:
    """Return the model of the joints that are described beside one that is not, or else `base`.

    What stands there predicts parts left out without the laws of the joint that is open, too.
    """
    found = supported(equations, scale, [known])
    if found is None or scale.worth(found) <= scale.worth(base):
        return base
    return found


def _ordered(size: np.ndarray, first: int) -> tuple[int, ...]:
    """Return the joints of a size (k,) above zero, one of them first, then the largest."""
    rest = [int(j) for j in np.argsort(-size) if size[j] > 0.0 and j != first]
    return (first, *rest)
