"""Probabilities of the verdict and of each finding.

Scores of models differ by hundreds of nats where the signals are clean, yet the shape of a column
is only approximate; so the odds of rivals are tempered: their difference in log rest counts.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import (
    CALM_SHARE,
    COUNTED_SHARE,
    DOUBTED,
    LEAST_ASSERTED,
    LEAST_ODDS,
    LEAST_SHARE,
    MOST_CERTAIN,
    NEARLY,
    PER_EFFECT,
    STANDING,
    TEMPER,
)
from sgp_ros.diagnosis.decide.cross_validation import without
from sgp_ros.diagnosis.decide.decision import UNKNOWN, Decision, calm
from sgp_ros.diagnosis.decide.differences import Several
from sgp_ros.diagnosis.decide.equivalence import Contrasts
from sgp_ros.diagnosis.decide.everyday import with_everyday
from sgp_ros.diagnosis.decide.scale import Scale
from sgp_ros.diagnosis.decide.simpler import simpler, without_one
from sgp_ros.diagnosis.explain.comparison import Comparison
from sgp_ros.diagnosis.explain.credibility import is_credible
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.result import Difference, Finding
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import JOINT, MOTOR


@dataclass(frozen=True, eq=False)
class Probabilities:
    """Of effects at joints, and of something unknown at each joint, (k,)."""

    by_key: dict[object, float]
    unknown: np.ndarray
    scale: Scale

    def of(self, model: Model, index: int) -> float:
        """Return the probability of one effect of a model."""
        return self.by_key.get(model.effects[index].key, 0.0)


def settled(
    equations: Equations, comparison: Comparison, decision: Decision
) -> tuple[Decision, Contrasts, Probabilities]:
    """Return the decision without improbable findings, with the probabilities of the others.

    Effects that are asserted beside others have a probability of at least `LEAST_ASSERTED`; a law
    that few joints have is worth `ALIKE` more than no law, or than its plain law. Others are
    replaced by the plain law that they add to, if their rivals add to it too, or are left out,
    unless another compared model, with probable effects only, is worth more than the result. One
    stays without which a joint is not described, for the other laws there would take its place; so
    does the most probable, unless bodies alone leave less than counts as physics.
    """
    dropped: set[object] = set()
    while True:
        contrasts = Contrasts(equations, decision.model)
        chances = probabilities(equations, comparison, decision, contrasts)
        if not decision.model.effects:
            return decision, contrasts, chances
        if decision.verdict == 'unexplained':  # what stands beside an unknown is settled alone
            kept = _probable(equations, decision.model, chances)
            if kept is decision.model:
                return decision, contrasts, chances
            decision = replace(decision, model=kept)
            continue
        rivals = (decision.model, *decision.rivals)
        plainer = simpler(equations, decision, chances.scale)
        if plainer is not None:
            dropped |= decision.model.key - plainer.key
            why = 'a simpler model is nearly as good'
            decision = replace(decision.without(why), model=plainer, rivals=rivals)
            continue
        effects = decision.model.effects
        p = [chances.of(decision.model, i) for i in range(len(effects))]
        if min(p) >= LEAST_ASSERTED:
            return decision, contrasts, chances
        if len(p) < 2:
            if chances.scale.base.max() < LEAST_SHARE:
                why = (
                    f'its probability is {p[0]:.2g}, and corrected bodies alone leave too little '
                    'to count as physics'
                )
                left = calm(comparison.base, rivals, chances.scale)
                decision = replace(left, refusals=decision.without(why).refusals)
                contrasts = Contrasts(equations, decision.model)
                chances = probabilities(equations, comparison, decision, contrasts)
            return decision, contrasts, chances
        weakest = effects[int(np.argmin(p))]
        dropped.add(weakest.key)
        kept = without_one(equations, decision.model, weakest)
        known = [m for m in rivals if _is_probable(m, chances) and not dropped & m.key]
        best = max([kept, *filter(chances.scale.counts, known)], key=chances.scale.worth)
        if not is_credible(best) or _opens(chances.scale, decision.model, best):
            return decision, contrasts, chances
        why = f'{weakest.effect.words} is improbable in it (probability {min(p):.2g})'
        decision = replace(decision.without(why), model=best, rivals=rivals)


def _opens(scale: Scale, model: Model, fewer: Model) -> bool:
    """Return whether a model does not describe a joint that the one it is to replace describes.

    Or of which that leaves clearly less.
    """
    described = scale.excess(model) < 1.0
    described |= model.mean_square <= NEARLY * fewer.mean_square
    return bool(((scale.excess(fewer) >= 1.0) & described).any())


def settled_of(several: Several) -> tuple[Several, Contrasts, Probabilities]:
    """Return what is asserted and how certain; of one recording without improbable findings."""
    known, decision = (several.equations, several.comparison), several.decision
    if several.chances:
        contrasts = Contrasts(several.equations, decision.model)
        return several, contrasts, probabilities(*known, decision, contrasts)
    decision, contrasts, chances = settled(*known, decision)
    whole = with_everyday(*known, decision)
    if whole is not decision:
        contrasts = Contrasts(several.equations, whole.model)
        chances = replace(chances, by_key=chances.by_key | dict.fromkeys(whole.standing, STANDING))
    return replace(several, decision=whole, model=whole.model), contrasts, chances


def _probable(equations: Equations, model: Model, chances: Probabilities) -> Model:
    """Return a model of the effects that are probable enough, and possible without the others."""
    while True:
        weak = [s for i, s in enumerate(model.effects) if chances.of(model, i) < LEAST_ASSERTED
                or not s.is_possible(equations.motion)]  # fmt: skip
        if not weak:
            return model
        model = without(equations, model, lambda s, weak=weak: s in weak)  # type: ignore[misc]


def _is_probable(model: Model, chances: Probabilities) -> bool:
    """Return whether a model has effects, each of which is probable enough to be asserted."""
    p = [chances.of(model, i) for i in range(len(model.effects))]
    return min(p, default=0.0) >= LEAST_ASSERTED


def probabilities(
    equations: Equations, comparison: Comparison, decision: Decision, contrasts: Contrasts
) -> Probabilities:
    """Return the tempered probabilities of all effects.

    A richer law whose numbers reduce it to the asserted one is not a rival, nor a longer
    formula that fits no better; bodies that do what an asserted law does, on any motion, are
    one. An effect is only as certain as its joint is well described; one that acts on all
    joints, as the worst of them; a gain, whose measure are bodies that may differ, as the
    worst joint, known or not, for bodies take up what is not known there. Unlikely numbers are
    doubted.
    """
    scale, asserted = Scale.of(equations, comparison), decision.model
    if any(s.effect.has_chosen_form for s in asserted.effects):
        scale = scale.of_forms()
    least = scale.worth(asserted) + math.log(LEAST_ODDS) / TEMPER
    known = (*comparison.singles, *comparison.pairs, *comparison.more)
    models = [
        m
        for m in known
        if (scale.counts(m) and not contrasts.is_longer(m, scale))
        and not (
            m.key != asserted.key
            and not _has_bodies_for(m, asserted)
            and scale.worth(m) > least
            and contrasts.is_same_law(m)
        )
    ]
    if asserted.effects and all(m.key != asserted.key for m in models):
        models.append(asserted)
    adequate = 1.0 / (1.0 + decision.excess**2)
    described = [a for j, a in enumerate(adequate) if j not in decision.unknown]
    by_key: dict[object, float] = {}
    worth = TEMPER * np.array([scale.worth(m) for m in (comparison.base, *models)])
    odds = np.exp(worth - worth.max())
    for model, p in zip(models, odds[1:] / odds.sum(), strict=True):
        named = {s.key: s for s in model.effects}
        if p > LEAST_ODDS:  # another name of what is asserted counts for it
            named |= {s.key: s for s in asserted.effects if contrasts.stands_for(model, s)}
        for s in named.values():
            is_own = s.effect.site in {JOINT, MOTOR} and s.place.joint >= 0
            a = adequate[s.place.joint] if is_own else min(described, default=0.0)
            if model.is_free and s.effect.alike:
                a = float(adequate.min())
            by_key[s.key] = by_key.get(s.key, 0.0) + float(p * a)
    far = {s.key for s in asserted.effects if _is_far(s)}
    stated = {key: min(p, DOUBTED if key in far else MOST_CERTAIN) for key, p in by_key.items()}
    unknown = np.clip(decision.excess / (decision.excess + 1.0), 0.05, 0.97)
    return Probabilities(stated, unknown, scale)


def _is_far(s: EffectAt) -> bool:
    """Return whether a listed law has numbers so unlikely that another law may hide in them.

    Such as a torque constant that is a quarter of what is stated.
    """
    return not s.effect.has_chosen_form and s.effect.surprise(s) > PER_EFFECT


def _has_bodies_for(rival: Model, asserted: Model) -> bool:
    """Return whether a rival has other bodies in place of a law."""
    return rival.is_free and not asserted.is_free and not asserted.key <= rival.key


def certainty_of(
    findings: Sequence[Finding | Difference],
    comparison: Comparison,
    trust: float = 1.0,
    verdict: str = '',
) -> float:
    """Return the probability that the verdict is right: the least of those it rests on.

    It rests on all findings that count as physics; on the most certain unknown one where it is
    `unexplained`, or where all are unknown; without findings, on the probability `trust` of bodies
    against errors of the connection.
    """
    if verdict == 'unexplained':
        findings = [f for f in findings if f.effect == UNKNOWN] or findings
    named = [f.probability for f in findings if f.effect != UNKNOWN and f.share > COUNTED_SHARE]
    if named:
        return min(named)
    if findings:
        return max(f.probability for f in findings)
    left = float(comparison.parameters.left.max())
    return min(trust, float(np.clip(1.0 / (1.0 + (left / CALM_SHARE) ** 2), 0.5, MOST_CERTAIN)))


def rests_on(
    in_doubt: Collection[str], findings: Sequence[Finding], joints: Collection[str]
) -> bool:
    """Return whether a verdict rests on joints that are doubted.

    A verdict that names physics rests on the joints of its effects, or on all joints where an
    effect acts on several.

    Args:
        in_doubt: joints of which nothing is certain.
        findings: of the verdict; unknown ones name nothing.
        joints: that move.
    """
    named = {f.joint for f in findings if f.effect != UNKNOWN}
    is_of_several = any(place not in joints for place in named)
    return bool(in_doubt if is_of_several or not named else named & set(in_doubt))


def doubted(
    findings: Iterable[Finding], in_doubt: Collection[str], joints: Collection[str]
) -> tuple[Finding, ...]:
    """Return findings, with at most the probability `DOUBTED` if they rest on doubted joints."""
    return tuple(
        replace(f, probability=min(f.probability, DOUBTED))
        if f.joint in in_doubt or rests_on(in_doubt, (f,), joints) else f
        for f in findings
    )  # fmt: skip
