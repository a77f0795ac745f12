"""Friction that is the same everywhere in the range, at all times."""

from __future__ import annotations

import math

import numpy as np

from sgp_ros.physics.drawing import Drawn, JointScene
from sgp_ros.physics.effect import Effect, Numbers
from sgp_ros.physics.motion import SeenMotion
from sgp_ros.physics.parts import (
    COULOMB,
    VISCOUS,
    OwnMotion,
    Quantity,
    TermForm,
    Value,
    leaves_some,
    relative_scales,
)
from sgp_ros.physics.place import MOTOR, Place, Placed

KINDS = (COULOMB, VISCOUS)
SELF_LOCKING = 0.5
"""A drive that loses more than half of its torque to friction cannot be driven back."""
RATIO_SPREAD = 0.5
"""Spread of the logarithm of the ratio of two levels of one friction [1]. Convention."""
USUAL_STATIC = 2.0
"""Static friction of so many times that of fast motion is not unlikely [1]. Convention."""
_ARMSTRONG = 'Armstrong-Helouvry, Dupont, Canudas de Wit 1994'


def _ratio(large: float, small: float) -> float:
    """Return the ratio of two levels, of which an estimate may be next to nothing."""
    return large / max(small, 0.01 * abs(large), 1e-300)


def rubbing(motion: SeenMotion, place: Place) -> np.ndarray:
    """Return `sign(v)` for dry friction, v for viscous friction, (n,)."""
    source = motion.velocity if place.kind == VISCOUS else motion.direction
    return source[:, place.joint]


class ViscousFriction(Effect):
    """`tau_x = -b v`."""

    name = 'viscous_friction'
    words = 'viscous friction'
    formula = 'tau_x = -b v'
    source = _ARMSTRONG
    appearance = 'the residual effort is proportional to the velocity'
    quantities = (Quantity('b', 'N m s/rad', low=0.0, is_sought=True, joint_number='damping'),)
    linear = ('b',)
    term = TermForm(
        'viscous', ('viscous',), dynamics='damping', is_dissipative=True, is_assumed=True
    )
    drawn_over = 'velocity'
    is_usual = True

    def is_possible(self, at: Placed, motion: SeenMotion) -> bool:
        return leaves_some(self.quantities[0], at, motion)

    def local(self, x: OwnMotion, shape: np.ndarray) -> tuple[np.ndarray, ...]:
        return (-x.v,)

    def sized(self, x: JointScene) -> Drawn:
        return Drawn(x.small / x.velocity, lambda s: {'b': s})


class CoulombFriction(Effect):
    """`tau_x = -level sign(v)`, holding up to `level` at rest."""

    name = 'coulomb_friction'
    words = 'Coulomb friction'
    formula = 'tau_x = -level sign(v)'
    source = _ARMSTRONG
    appearance = 'a step of the effort at each reversal; the joint sticks at rest'
    quantities = (Quantity('level', 'N m', low=0.0, is_sought=True, joint_number='friction'),)
    linear = ('level',)
    term = TermForm(
        'coulomb', ('coulomb',), dynamics='friction', is_dissipative=True, is_assumed=True
    )
    drawn_over = 'velocity'
    is_dry = True
    is_usual = True

    def is_possible(self, at: Placed, motion: SeenMotion) -> bool:
        return leaves_some(self.quantities[0], at, motion)

    def local(self, x: OwnMotion, shape: np.ndarray) -> tuple[np.ndarray, ...]:
        return (-x.s,)

    def sized(self, x: JointScene) -> Drawn:
        return Drawn(x.small, lambda s: {'level': s})


class StribeckFriction(Effect):
    """Dry friction that is larger near rest.

    Columns: the level of fast motion, and what is added at rest.
    """

    name = 'stribeck_friction'
    words = 'Stribeck friction'
    formula = 'tau_x = -(coulomb + (static - coulomb) exp(-(v / stribeck_velocity)^2)) sign(v)'
    source = _ARMSTRONG
    appearance = 'a step at each reversal, largest at low speed; stick-slip'
    quantities = (
        Quantity('coulomb', 'N m', low=0.0, joint_number='friction'),
        Quantity('static', 'N m', low=0.0),
        Quantity('stribeck_velocity', 'rad/s', low=1e-9, is_positive=True, is_scored=False),
    )
    linear = ('coulomb', 'static')
    plain = ('coulomb_friction', 'viscous_friction')
    term = TermForm('stribeck', ('stribeck',), columns=(1,))
    drawn_over = 'velocity'
    is_dry = True

    def coefficient_quantities(self, kind: str = '') -> tuple[Quantity, ...]:
        """Return the level of fast motion and what is added at rest."""
        return Quantity('coulomb', 'N m'), Quantity('stribeck', 'N m')

    def model(self, numbers: Numbers, kind: str = '') -> tuple[np.ndarray, np.ndarray]:
        """Return the scale of the velocity, and the two levels."""
        levels = [numbers['coulomb'], numbers['static'] - numbers['coulomb']]
        return np.array([numbers['stribeck_velocity']]), np.array(levels)

    def report(self, at: Placed, motion: SeenMotion) -> dict[str, Value]:
        """Return both levels and the scale of the velocity."""
        coulomb, added = map(float, at.coefficients)
        return {
            'coulomb': coulomb, 'static': coulomb + added, 'stribeck_velocity': float(at.shape[0]),
        }  # fmt: skip

    def is_possible(self, at: Placed, motion: SeenMotion) -> bool:
        """Return whether it is larger near rest, and never drives."""
        coulomb, added = at.coefficients
        return bool(added > 0.0 and coulomb > -0.05 * added)

    def surprise(self, at: Placed) -> float:
        """Return the price of static friction that is many times that of fast motion."""
        coulomb, added = map(float, at.coefficients)
        far = max(math.log(max(_ratio(coulomb + added, coulomb), 1.0) / USUAL_STATIC), 0.0)
        return 0.5 * (far / RATIO_SPREAD) ** 2

    def local(self, x: OwnMotion, shape: np.ndarray) -> tuple[np.ndarray, ...]:
        fall = np.exp(-((x.v / shape[0]) ** 2))
        return -x.s, -(fall * x.s)

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        """Return shares of the fast velocities."""
        speed = np.quantile(np.abs(motion.velocity[:, place.joint]), 0.9)
        return np.asarray(speed * np.array([0.02, 0.05, 0.1, 0.2, 0.4, 0.7])[:, None])

    def bounds(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        """Return the speed of the slowest hundredth of the rows, and twice the greatest."""
        speed = np.abs(motion.velocity[:, place.joint])
        starts = self.starts(motion, place)
        low = np.minimum(starts[0], np.quantile(speed, 0.01))
        return np.maximum(low, 1e-3 * starts[0]), np.maximum(starts[-1], [2.0 * speed.max()])

    def scales(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        return relative_scales(*self.bounds(motion, place), shape)

    def sized(self, x: JointScene) -> Drawn:
        return Drawn(
            x.small,
            lambda s: {'coulomb': s, 'static': s * x.mean, 'stribeck_velocity': x.slow},
        )


class QuadraticDrag(Effect):
    """`tau_x = -c |v| v`."""

    name = 'quadratic_drag'
    words = 'quadratic drag'
    formula = 'tau_x = -c |v| v'
    source = _ARMSTRONG
    appearance = 'the residual effort grows with the square of the velocity'
    quantities = (Quantity('c', 'N m s2/rad2', low=0.0),)
    linear = ('c',)
    term = TermForm('quadratic', ('quadratic',))
    drawn_over = 'velocity'

    def local(self, x: OwnMotion, shape: np.ndarray) -> tuple[np.ndarray, ...]:
        return (-(np.abs(x.v) * x.v),)

    def sized(self, x: JointScene) -> Drawn:
        return Drawn(x.small / x.velocity**2, lambda s: {'c': s})


class AsymmetricCoulomb(Effect):
    """Coulomb friction whose level depends on the direction."""

    name = 'asymmetric_coulomb'
    words = 'Coulomb friction that differs with direction'
    formula = 'tau_x = -level_pos for v > 0, +level_neg for v < 0'
    source = _ARMSTRONG
    appearance = 'a step at each reversal that is not centred on zero'
    quantities = tuple(
        Quantity(name, 'N m', low=0.0, joint_number='friction')
        for name in ('level_pos', 'level_neg')
    )
    linear = ('level_pos', 'level_neg')
    plain = ('coulomb_friction',)
    term = TermForm(
        'asymmetric_coulomb', ('coulomb_positive', 'coulomb_negative'), (0, 1),
        dynamics='friction', is_dissipative=True,
    )  # fmt: skip
    drawn_over = 'velocity'
    is_dry = True

    def is_possible(self, at: Placed, motion: SeenMotion) -> bool:
        """Return whether neither direction is driven, with what the nominal robot states."""
        stated = motion.stated_number(self.quantities[0].joint_number, at.place.joint)
        return bool(np.all(at.coefficients + stated > -0.02 * np.max(np.abs(at.coefficients))))

    def surprise(self, at: Placed) -> float:
        """Return the price of levels that are far apart: a load that is constant does that."""
        low, high = sorted(map(float, at.coefficients))
        return 0.5 * (math.log(max(_ratio(high, low), 1.0)) / RATIO_SPREAD) ** 2

    def local(self, x: OwnMotion, shape: np.ndarray) -> tuple[np.ndarray, ...]:
        return -0.5 * (1.0 + x.s), 0.5 * (1.0 - x.s)

    def term_columns(self, x: OwnMotion, shape: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the two directions; a smooth s near rest has neither."""
        return np.maximum(x.s, 0.0), np.minimum(x.s, 0.0)

    def sized(self, x: JointScene) -> Drawn:
        return Drawn(x.small, lambda s: dict(zip(self.linear, x.levels(s), strict=True)))


class LoadFriction(Effect):
    """Dry friction of a gear that grows with the torque of its motor."""

    name = 'load_friction'
    words = 'friction that grows with the load'
    formula = 'tau_x = -(level + mu |motor torque|) sign(v)'
    source = 'Hamon, Gautier, Garrec 2010'
    appearance = 'steps at reversals that are larger where the motor works harder'
    quantities = (
        Quantity('level', 'N m', low=0.0, is_scored=False), Quantity('mu', '1', low=0.0),
    )  # fmt: skip
    linear = ('level', 'mu')
    plain = ('coulomb_friction',)
    site = MOTOR
    drawn_over = 'velocity'
    is_dry = True

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        """Return dry friction of level 1, and of the motor's torque."""
        s = motion.direction[:, place.joint]
        return -np.column_stack([s, np.abs(motion.effort[:, place.joint]) * s])

    def effort_columns(self, kind: str) -> tuple[int, ...]:
        """Return that of mu."""
        return (1,)

    def is_possible(self, at: Placed, motion: SeenMotion) -> bool:
        """Return whether friction grows with the load, and neither drives nor locks the joint.

        Where nothing but friction loads a motor, `|effort| sign(v)` is the effort itself: with
        mu = 1 it would explain everything, by itself.
        """
        level, mu = at.coefficients
        usual = float(np.mean(np.abs(motion.effort[:, at.place.joint])))
        return bool(0.0 < mu < SELF_LOCKING and level > -0.1 * mu * usual)

    def sized(self, x: JointScene) -> Drawn:
        return Drawn(0.2, lambda s: {'level': 0.05 * s * x.force, 'mu': s})
