"""The result of a search for a law at one joint."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from sgp_ros.batch.least_squares import correlation_factor
from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import COUNTED_SHARE, INTERVAL, LAW_REST
from sgp_ros.diagnosis.decide.cross_validation import repeatable
from sgp_ros.diagnosis.decide.scale import Scale
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.fitted_model import Model, add_force
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.uncertainty import reported_std
from sgp_ros.diagnosis.unlisted.shapes import SmoothForce, smooth_of
from sgp_ros.physics.catalogue import COULOMB_FRICTION, VISCOUS_FRICTION
from sgp_ros.physics.effect_at import EffectAt


@dataclass(frozen=True, eq=False)
class Searched:
    """Result of a search at one joint.

    Attributes:
        joint: index.
        listed: best model of listed effects.
        smooth: best model with a smooth force at the joint.
        laws: models with a formula there, best first.
        free: what a force of any form beside the first formula leaves of parts that were left out
            of its fit (N,).
        floor: mean square that errors of signals and filters leave.
        is_slight: whether listed effects keep their names where no formula is asserted.
    """

    joint: int
    listed: Model
    smooth: Model
    laws: tuple[Model, ...]
    free: np.ndarray
    floor: float
    is_slight: bool = False

    @property
    def lack_of_fit(self) -> tuple[float, float]:
        """Ratio of what the first formula leaves to what any form beside it does, and its chance.

        A form that follows rests at some positions, or noise, predicts no other part. The chance
        is that of a mean difference of squares that is not positive, with rows as independent as
        these differences are.
        """
        law = self.laws[0].residual[:, self.joint] ** 2
        gain = law - self.free**2
        rows = len(gain) / correlation_factor(gain)
        spread = max(float(gain.std()), 1e-300) / math.sqrt(rows)
        ratio = (law.mean() + self.floor) / ((self.free**2).mean() + self.floor)
        return float(ratio), float(special.ndtr(-gain.mean() / spread))

    def everyday(self, columns: Columns, scale: Scale) -> tuple[Model, dict[object, float]] | None:
        """Return a model without the smooth force, with the everyday laws that stand beside it.

        Their numbers are those beside that force. Each is worth its price there and counts as
        physics. The standard deviations, by the keys of the laws, hold the numbers beside every
        formula that is worth as much. None where there is no such law, where more is left than may
        be beside it, or where the force may be friction itself. Other laws that act on no other
        joint, such as the mount of a single one, are a part of that force.

        Args:
            columns: of the recording.
            scale: of mean squares.
        """
        model, (placed, force) = self.smooth, smooth_of(self.smooth, self.joint)
        is_of_speed = force.variable.index == self.joint and force.variable.kind == 'dq'
        if is_of_speed and not force.is_of_own_speed:
            return None
        may = [
            s for s, share in zip(model.effects, model.filtered_shares, strict=True)
            if self._may_stand(s, force) and share >= COUNTED_SHARE
            and not leaves_more(model.frame.equations, model, s)
        ]  # fmt: skip
        if not may:
            return None
        known = zip(model.effects, reported_std(model, columns), strict=True)
        std = {s: tuple(x.values()) for s, x in known if s in may}
        rivals = [m for m in self.laws if scale.worth(m) >= scale.worth(model)]
        found: dict[object, float] = {}
        for s, spread in std.items():
            others = tuple(o for o in model.effects if o is not s)
            without = fit(columns, others, model.sigma, is_free=model.is_free, w=model.w,
                          still=len(others))  # fmt: skip
            beside = [o.coefficients[0] for m in rivals for o in m.effects if o.key == s.key]
            if scale.worth(without) < scale.worth(model) and len(beside) == len(rivals):
                far = max((abs(x - s.coefficients[0]) for x in beside), default=0.0)
                found[s.key] = max(*spread, float(far) / INTERVAL)
        both = zip(model.effects, model.forces, strict=True)
        own = {s for s, f in both if not np.delete(f, self.joint, axis=1).any()}
        left = {s for s in own if s.key not in found} | {placed}
        return (_stripped(model, left), found) if found else None

    def _may_stand(self, s: EffectAt, force: SmoothForce) -> bool:
        """Return whether a law is an everyday one of the joint that the force is no form of."""
        alike = {'sign': COULOMB_FRICTION, 'soft': COULOMB_FRICTION, 'speed': VISCOUS_FRICTION,
                 'ahead': VISCOUS_FRICTION, 'back': VISCOUS_FRICTION}.get(force.gate)  # fmt: skip
        is_alike = s.effect is alike and force.factor_of[0] == self.joint
        is_alike = is_alike or (force.is_of_own_speed and force.has_form_of(s))
        return s.place.joint == self.joint and s.effect.is_usual and not is_alike


def leaves_more(equations: Equations, model: Model, law: EffectAt) -> bool:
    """Return whether more comes back with the motion beside a law than may, for its force."""
    joint = law.place.joint
    asked = np.arange(equations.d.shape[1]) == joint
    share = float(repeatable(equations, model.residual, asked)[0, joint])
    force = model.forces[[s is law for s in model.effects].index(True)][:, joint]
    return share * float(model.mean_square[joint]) > LAW_REST * float((force**2).mean())


def _stripped(model: Model, effects: Collection[EffectAt]) -> Model:
    """Return a model without some effects, whose forces it leaves; all else has its numbers."""
    residual = model.residual.copy()
    kept = [(s, part) for s, part in zip(model.effects, model.parts, strict=True)
            if s not in effects]  # fmt: skip
    for s, part in zip(model.effects, model.parts, strict=True):
        if s in effects:
            add_force(residual, s.place.joint, part)
    variance = model.sigma**2 + (residual**2).mean(axis=0) - model.mean_square
    score = model.score - 0.5 * len(residual) * float(np.log(variance / model.sigma**2).sum())
    placed, parts = zip(*kept, strict=True)
    return replace(model, effects=placed, parts=parts, residual=residual, score=score,
                   sigma=np.sqrt(variance))  # fmt: skip
