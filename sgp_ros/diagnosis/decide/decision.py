"""What the comparison of models lets us assert.

Statistical significance is not enough: the schema calls physics what makes at least 0.4 % of the
mean squared effort of some joint. Among models of nearly the same residual the one with the fewest
parameters is asserted, if each of its effects predicts parts of the recording that were left out
(`support`). It is adequate when what it leaves, as far as that is no noise (`structure`), is
small against what it explains.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import (
    ADEQUATE_REST,
    COUNTED_SHARE,
    EVIDENCE,
    FLOOR_SHARE,
    INDEPENDENT_ROWS,
    LEAST_SHARE,
    MOST_OPPOSED,
    NOTHING_EXPLAINED,
    PER_EFFECT,
    PER_PARAMETER,
    SHAPE_ERROR,
    SLIGHT_REST,
)
from sgp_ros.diagnosis.decide.cross_validation import structure, support
from sgp_ros.diagnosis.explain.comparison import Comparison
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.explain.regression import Columns


@dataclass(frozen=True, eq=False)
class Decision:
    """The verdict and the models behind it.

    Attributes:
        verdict: as in the schema.
        model: that is asserted; for `unexplained` the inertial parameters alone.
        rivals: models that were not asserted, best first.
        excess: what the best model leaves, relative to what an adequate one may.
        worst: index of the joint where most is left.
        tentative: best model where nothing is adequate.
        against: score of the best model without effects [nats].
    """

    verdict: str
    model: Model
    rivals: tuple[Model, ...]
    excess: float
    worst: int
    tentative: Model | None = None
    against: float = 0.0


@dataclass(frozen=True, eq=False)
class Scale:
    """What mean squares are measured against.

    Attributes:
        power: (k,) mean squared efforts.
        error: (k,) what filters and smoothing leave of a perfect model, as mean squares.
        base: rest of the best model without effects, (k,) shares.
        nominal: discrepancy of the nominal robot, (k,) shares.
        rows: that count as independent.
    """

    power: np.ndarray
    error: np.ndarray
    base: np.ndarray
    nominal: np.ndarray
    rows: float

    @classmethod
    def of(cls, equations: Equations, comparison: Comparison) -> Scale:
        """Return the scale of a recording."""
        power, error = equations.power, equations.model_error
        base = np.maximum(comparison.base.mean_square - error, 0.0) / power
        nominal = comparison.nominal.mean_square / power
        return cls(power, error, base, nominal, min(INDEPENDENT_ROWS, len(equations.d)))

    @property
    def floor(self) -> np.ndarray:
        """What the right model may leave, (k,) shares."""
        return np.asarray(FLOOR_SHARE + SHAPE_ERROR * self.nominal + self.error / self.power)

    def shares(self, model: Model) -> np.ndarray:
        """Return what a model leaves beyond the errors of the filters, (k,) shares."""
        return np.maximum(model.mean_square - self.error, 0.0) / self.power

    def explained(self, model: Model) -> float:
        """Return the size of what is to explain.

        That is the rest of the parameters, or the effects where changed parameters could imitate
        them, but never more than the nominal robot leaves.
        """
        effects = min(model.net_share, float(self.nominal.sum()))
        return max(float(self.base.sum()), effects, 1e-12)

    def rest(self, model: Model, structured: np.ndarray | float = 1.0) -> float:
        """Return the rest of a model relative to what it explains.

        Args:
            model: fitted.
            structured: share of each joint's rest that is no noise, (k,).
        """
        return float((structured * self.shares(model)).sum()) / self.explained(model)

    def excess(self, model: Model, structured: np.ndarray | float = 1.0) -> float:
        """Return what a model leaves, relative to what an adequate one may."""
        slight = float((structured * self.shares(model)).max()) / SLIGHT_REST
        return min(self.rest(model, structured) / ADEQUATE_REST, slight)

    def counts(self, model: Model) -> bool:
        """Return whether effects are large enough and do not cancel each other, or the bodies."""
        return self.is_sound(model) and min(model.shares) > COUNTED_SHARE

    def is_sound(self, model: Model) -> bool:
        """Return whether effects do not merely cancel each other, or the bodies."""
        there = max(min(model.net_share, float(self.nominal.sum())), 1e-12)
        return sum(model.filtered_shares) < MOST_OPPOSED * there

    def fit(self, model: Model) -> float:
        """Return the tempered log likelihood, with the prior of the bodies' change [nats].

        It is one of the motion, which is what was measured: a residual of effort, and what a
        perfect model would leave of it, grows with the inertia of a model.
        """
        floor = self.floor * np.exp(2.0 * max(model.log_inertia, -50.0) / len(self.power))
        share = model.mean_square / self.power + floor
        likelihood = self.rows * (model.log_inertia - 0.5 * float(np.log(share).sum()))
        return likelihood - 0.5 * float(model.w @ model.w)

    def worth(self, model: Model) -> float:
        """Return the fit of a model, less the price of its freedom [nats]."""
        return self.fit(model) - PER_EFFECT * len(model.effects) - PER_PARAMETER * model.freedom


def _ranked(comparison: Comparison, scale: Scale) -> list[Model]:
    """Return the models that could be asserted, best first.

    There are none where the best explanation of all is too small to be physics: a worse one that
    is larger, because bodies undo most of it, is not to be preferred for that.
    """
    models = (*comparison.singles, *comparison.pairs, *comparison.more)
    least = comparison.base.score + EVIDENCE
    sound = [m for m in models if m.score > least and scale.is_sound(m)]
    ranked = sorted(sound, key=scale.worth, reverse=True)
    if ranked and max(ranked[0].shares) < COUNTED_SHARE:
        return []
    return [m for m in ranked if scale.counts(m)]


def decide(equations: Equations, comparison: Comparison) -> Decision:
    """Return the verdict on a recording."""
    scale, base = Scale.of(equations, comparison), comparison.base
    ranked = _ranked(comparison, scale)
    best = _supported(equations, scale, [m for m in ranked if scale.worth(m) > scale.worth(base)])
    rivals = tuple(m for m in ranked if m is not best)
    worst = int(np.argmax(scale.base))
    left = scale.shares(comparison.parameters)
    if best is not None:
        excess = scale.excess(best, structure(equations, best.residual))
        if excess < 1.0:
            return Decision('missing_physics', best, rivals, excess, worst, against=base.score)
        if left.max() > COUNTED_SHARE:
            found = (best, *rivals)
            return Decision('unexplained', base, found, excess, worst, best, base.score)
    elif left.max() > LEAST_SHARE:
        left = left * structure(equations, comparison.parameters.residual)
        if left.max() > LEAST_SHARE:
            return Decision(
                'unexplained', base, rivals, NOTHING_EXPLAINED, worst, against=base.score
            )
    verdict = 'parameters_only' if base.is_free else 'no_mismatch'
    return Decision(verdict, base, rivals, NOTHING_EXPLAINED, worst, against=base.score)


def _supported(equations: Equations, scale: Scale, ranked: list[Model]) -> Model | None:
    """Return the first model whose effects all predict parts of the recording left out."""
    columns, floor = Columns(equations), scale.floor * scale.power
    for model in ranked:
        if scale.rows * min(support(columns, model, floor)) > EVIDENCE:
            return model
    return None
