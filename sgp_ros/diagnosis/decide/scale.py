"""Scale of a recording: mean squares of models against efforts, and what they had to explain."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import (
    ADEQUATE_REST,
    COLOURED_REST,
    COUNTED_SHARE,
    FLOOR_SHARE,
    INDEPENDENT_ROWS,
    LEAST_SHARE,
    PER_PARAMETER,
    SHAPE_ERROR,
    SLIGHT_REST,
)
from sgp_ros.diagnosis.explain.comparison import Comparison
from sgp_ros.diagnosis.explain.credibility import is_credible
from sgp_ros.diagnosis.explain.fitted_model import Model, least_variance, shown_inertia
from sgp_ros.physics.place import JOINT, MOTOR


@dataclass(frozen=True, eq=False)
class Scale:
    """Reference powers for mean squares.

    Attributes:
        power: (k,) mean squared efforts.
        error: (k,) what filters, smoothing and noise leave of a perfect model, as mean squares.
        noise: (k,) the part of that which is noise of measured efforts.
        base: rest of the best model without effects, (k,) shares.
        nominal: discrepancy of the nominal robot, (k,) shares.
        rows: that count as independent.
        shape_error: part of `nominal` that the right column may leave.
        carried: log of the inertia that efforts show, relative to the nominal one, (k,).
    """

    power: np.ndarray
    error: np.ndarray
    noise: np.ndarray
    base: np.ndarray
    nominal: np.ndarray
    rows: float
    shape_error: float = SHAPE_ERROR
    carried: np.ndarray | float = 0.0

    @classmethod
    def of(cls, equations: Equations, comparison: Comparison) -> Scale:
        """Return the scale of a recording."""
        power, error = equations.power, equations.model_error
        base, nominal = comparison.base.left, comparison.nominal.mean_square / power
        noise = equations.effort_noise
        rows, carried = min(INDEPENDENT_ROWS, len(equations.d)), equations.carried
        return cls(power, error, noise, base, nominal, rows, carried=carried)

    @property
    def floor(self) -> np.ndarray:
        """Largest rest that the right model may leave, (k,) shares."""
        return np.asarray(FLOOR_SHARE + self.shape_error * self.nominal + self.error / self.power)

    def of_forms(self) -> Scale:
        """Return the scale for forces whose form the data chose: they have no shape to err in."""
        return replace(self, shape_error=0.0)

    def explained(self, model: Model) -> float:
        """Return the size of the force to explain.

        That is the rest of the parameters, or the effects where changed parameters could imitate
        them, but never more than the nominal robot leaves.
        """
        effects = min(model.net_share, float(self.nominal.sum()))
        return max(float(self.base.sum()), effects, 1e-12)

    def rest(self, model: Model, structured: np.ndarray | float = 1.0) -> float:
        """Return the rest of a model relative to what it explains; `structured` (k,) of it."""
        return float((structured * model.left).sum()) / self.explained(model)

    def found(self, model: Model) -> np.ndarray:
        """Return the force to explain at each joint, (k,) shares, as in `explained`."""
        effects = np.minimum((model.net_force**2).mean(axis=0) / self.power, self.nominal)
        return np.asarray(np.maximum(self.base, effects))

    def excess(self, model: Model, predictable: np.ndarray | None = None) -> np.ndarray:
        """Return what a model leaves at each joint, relative to what an adequate one may, (k,).

        Relative to the force that there was to explain at the joint; without effects of its own,
        whatever is explained at others, up to the least share of physics if larger.

        Args:
            model: fitted.
            predictable: (2, k) share of the rest that motion and earlier rows predict, see
                `repeatable`; None for all of it.
        """
        predictable = np.ones((2, len(self.power))) if predictable is None else predictable
        owned = [s.place.joint for s in model.effects if s.effect.site in {JOINT, MOTOR}]
        is_own = np.isin(np.arange(len(self.power)), owned)
        slight, found = np.where(is_own, SLIGHT_REST, LEAST_SHARE), self.found(model)
        limits = np.maximum(np.multiply.outer([ADEQUATE_REST, COLOURED_REST], found), slight)
        return np.asarray((predictable * model.left / limits).max(axis=0))

    def counts(self, model: Model) -> bool:
        """Return whether effects are large enough, credible, and do not cancel each other."""
        return self.is_large(model) and is_credible(model)

    @staticmethod
    def is_large(model: Model) -> bool:
        """Return whether effects are large enough and visible; each rare law by itself."""
        counted = zip(model.effects, model.shares, model.filtered_shares, strict=True)
        small = [s.effect for s, x, seen in counted if x <= COUNTED_SHARE or seen <= SLIGHT_REST]
        return len(small) < len(model.effects) and all(e.is_usual for e in small)

    def fit(self, model: Model) -> float:
        """Return the tempered log likelihood, with the prior of the bodies' change [nats].

        It is one of the motion, which is what was measured: a residual of effort, and what a
        perfect model would leave of it beside noise of efforts, grows with the inertia of a model.
        """
        return self.likelihood(model) - model.strain

    def likelihood(self, model: Model) -> float:
        """Return the fit without that prior [nats]."""
        floor = least_variance(self.floor, self.noise / self.power, model.inertia - self.carried)
        share = model.mean_square / self.power + floor
        shown = shown_inertia(model.frame.equations, model.inertia, model.effects, self.carried)
        return self.rows * (shown - 0.5 * float(np.log(share).sum()))

    def worth(self, model: Model) -> float:
        """Return the fit of a model, less the price of its freedom [nats]."""
        price = model.law_price + PER_PARAMETER * model.freedom
        return self.fit(model) - price - model.surprise


def moving_power(equations: Equations) -> np.ndarray:
    """Return the mean squares of the efforts, (k,), without that of a weight that is held.

    It makes them large and tells nothing of the motion: this is at most the variance.
    """
    variance = np.minimum(equations.motion.effort.var(axis=0), equations.power)
    return np.where(variance > 0.0, variance, equations.power)


def beyond_noise(equations: Equations, model: Model) -> np.ndarray:
    """Return the shares of the mean squared effort that a model leaves, less those of noise, (k,).

    Noise is what a perfect model leaves.
    """
    return np.maximum(model.left - equations.model_error / equations.power, 0.0)
