"""Visibility: the least size of an effect that a recording would have shown.

An effect is found when the evidence for it pays for its freedom, and when it makes enough of the
squared effort to count as physics. Both are computed from the force that it would exert in the
recorded motion. Bodies and the other effects of the final model absorb a part of this force, by
least squares; the rest is compared with the residual of the final model. The evidence is that of
`Scale.fit`, so it counts as few rows as the decision does. The motion would have differed a little
with the effect in it: the size holds to first order.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.compare.power import loss
from sgp_ros.diagnosis.compare.settled import shows as may_show
from sgp_ros.diagnosis.criteria import (
    COUNTED_SHARE,
    MOST_UNSEEN,
    NEARLY,
    PER_EFFECT,
    PER_PARAMETER,
)
from sgp_ros.diagnosis.decide.decision import Decision
from sgp_ros.diagnosis.decide.scale import Scale
from sgp_ros.diagnosis.explain.candidates import split
from sgp_ros.diagnosis.explain.comparison import Comparison
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.explain.frame import Frame
from sgp_ros.diagnosis.explain.regression import Columns, on_all_joints
from sgp_ros.diagnosis.result import Parameter
from sgp_ros.physics.catalogue import COULOMB_FRICTION, EFFECTS, VISCOUS_FRICTION
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.parts import Quantity
from sgp_ros.physics.place import Place, joint_name

_FINEST = 1e-3
"""Least size that is tried, relative to the least start of a search."""
_HALVINGS = 10
_HIDDEN = (
    'Friction of {} that makes {} would not show here, so it is '
    'not certain that nothing is missing: record for longer, at more speeds, or with less noise.'
)
_SAME = 1e-3
"""Part of a force that an effect may leave which gives the same force."""


def visibility(
    equations: Equations, comparison: Comparison, decision: Decision
) -> dict[tuple[str, str, str], Parameter]:
    """Return the least size of each sought effect at each joint that a recording would show.

    Args:
        equations: of the recording.
        comparison: its models.
        decision: its final model, or the best one where nothing is adequate.

    Returns:
        By joint, effect and parameter; infinite where no size would show. Of settled points only
        what acts at rest.
    """
    model = decision.tentative or decision.model
    beside = _Beside(Columns(equations), Scale.of(equations, comparison), model)
    motion = equations.motion
    found = {}
    for effect, quantity in _sought():
        for place in effect.places(motion):
            if place.joint < 0 or not may_show(effect, place, motion):
                continue
            unit = quantity.unit_on(is_prismatic=bool(motion.tree.is_prismatic[place.joint]))
            value = _least(beside, effect, quantity, place)
            key = joint_name(motion, place.joint), effect.name, quantity.name
            found[key] = Parameter(value, None, unit)
    return found


def hides_friction(
    equations: Equations, comparison: Comparison, decision: Decision
) -> tuple[str, ...]:
    """Say where friction of a tenth of the mean squared effort would not show.

    Of a robot without motors, friction that takes a third of its energy.

    Args:
        equations: of the recording.
        comparison: its models.
        decision: that no physics is missing.
    """
    scale, motion = Scale.of(equations, comparison), equations.motion
    beside = _Beside(Columns(equations), scale, decision.model)
    is_driven = bool(motion.tree.is_actuated.any())
    found: dict[str, None] = {}
    for j, power in enumerate(scale.power):
        for effect in (COULOMB_FRICTION, VISCOUS_FRICTION):
            unit = EffectAt(effect, Place(j), coefficients=np.ones(1))
            force = unit.columns(motion)
            if not (force.any() and may_show(effect, unit.place, motion)):
                continue
            size = math.sqrt(MOST_UNSEEN * float(power / (force**2).mean()))
            if not is_driven:
                size = NEARLY / float(loss(motion, force)[j])
            if beside.clearness(replace(unit, coefficients=np.array([size]))) < 1.0:
                found[joint_name(motion, j)] = None
    part = 'a tenth of the mean squared effort' if is_driven else 'it lose a third of its energy'
    return (_HIDDEN.format(', '.join(found), part),) if found else ()


def _sought() -> Iterator[tuple[Effect, Quantity]]:
    for effect in EFFECTS.values():
        for quantity in effect.quantities:
            if quantity.is_sought:
                yield effect, quantity


@dataclass(frozen=True, eq=False)
class _Beside:
    """The final model, beside which an effect would have to show."""

    columns: Columns
    scale: Scale
    model: Model

    def clearness(self, candidate: EffectAt) -> float:
        """Return the lesser of evidence and share, each relative to the one a finding needs."""
        model, scale = self.model, self.scale
        held = [s.effect.held_joints(s.place) for s in (*model.effects, candidate)]
        equations = self.columns.equations(frozenset().union(*held))
        frame = Frame.of(equations, model.sigma, is_free=True)
        moved = self.columns.corrected(
            model.w if candidate.effect.uses_bodies and model.is_free else None
        )
        force = candidate.columns(moved) @ candidate.coefficients
        joint = candidate.place.joint
        own = equations.compact(force[:, None], joint, is_inertial=candidate.effect.is_inertial)
        own = on_all_joints(own, joint, len(scale.power))
        z = frame.projected(own)[:, 0]
        others = tuple(s for s in model.effects if not self._is(s, own, equations))
        _, A, _ = split(frame, self.columns, others, model.w)
        if A.shape[1]:
            basis = np.linalg.qr(A / np.sqrt((A * A).sum(axis=0) + 1e-300))[0]
            z = z - basis @ (basis.T @ z)
        left = model.mean_square / scale.power + scale.floor
        nats = 0.5 * scale.rows * np.log1p(frame.by_joint(z) / scale.power / left).sum()
        size = len(candidate.shape) + (0 if candidate.effect.is_given else 1)
        share = float((force**2).mean()) / float(scale.power[joint])
        return min(float(nats) / (PER_EFFECT + PER_PARAMETER * size), share / COUNTED_SHARE)

    def _is(self, found: EffectAt, own: np.ndarray, equations: Equations) -> bool:
        """Return whether a model's effect gives this force (N, k, 1): it was then visible."""
        x = self.columns.of(found, equations, self.model.w).reshape(own.size, -1)
        y = own.ravel()
        left = y - x @ np.linalg.lstsq(x, y, rcond=1e-9)[0]
        return float(left @ left) <= _SAME * float(y @ y)


def _least(beside: _Beside, effect: Effect, quantity: Quantity, place: Place) -> float:
    """Return the least size that shows; infinite where no size does."""
    low, high = _range(beside, effect, quantity, place)

    def shows(size: float) -> bool:
        return beside.clearness(_of_size(beside, effect, quantity, place, size)) >= 1.0

    if not shows(high):
        return math.inf
    for _ in range(_HALVINGS):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if shows(middle) else (middle, high)
    return high


def _of_size(
    beside: _Beside, effect: Effect, quantity: Quantity, place: Place, size: float
) -> EffectAt:
    """Return an effect of this size, with usual values of its other numbers."""
    shape, coefficients = effect.model({quantity.name: size}, place.kind)
    motion = beside.columns.equations(frozenset()).motion
    if len(shape):
        usual = np.median(effect.starts(motion, place), axis=0)
        shape = np.where(np.isfinite(shape), shape, usual)
    return EffectAt(effect, place, shape, coefficients)


def _range(
    beside: _Beside, effect: Effect, quantity: Quantity, place: Place
) -> tuple[float, float]:
    """Return the least and the greatest size that are tried."""
    motion = beside.columns.equations(frozenset()).motion
    shape, _ = effect.model({quantity.name: 1.0}, place.kind)
    sized = np.flatnonzero(shape == 1.0)
    if len(sized):
        i = int(sized[0])
        least = float(effect.starts(motion, place)[:, i].min())
        return _FINEST * least, float(effect.bounds(motion, place)[1][i])
    unit = EffectAt(effect, place, shape, np.ones(1))
    mean = float((unit.columns(motion) ** 2).mean())
    counted = math.sqrt(COUNTED_SHARE * beside.scale.power[place.joint] / max(mean, 1e-300))
    return counted, counted / _FINEST
