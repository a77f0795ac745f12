"""Loads on joints: springs, constant loads, rotors, cogging."""

from __future__ import annotations

import math

import numpy as np

from sgp_ros.physics.drawing import Drawn, JointScene
from sgp_ros.physics.effect import EMPTY, Effect, Numbers
from sgp_ros.physics.motion import SeenMotion
from sgp_ros.physics.parts import OwnMotion, Quantity, TermForm, Value, leaves_some
from sgp_ros.physics.place import Place, Placed
from sgp_ros.physics.waves import Wave, most_periods, peak_width, per_turn

MECHANICS = 'Khalil and Dombre 2002, Modeling, Identification and Control of Robots, chapter 9'

LEAST_PERIODS = 3.0
"""Least periods per revolution for cogging. The schema."""
_MORE_THAN_ONE = 1.1
"""Waves in the range of motion from which on a force is one of waves. Convention."""


def wave_coefficients(x: Numbers) -> tuple[float, float]:
    """Return sine and cosine: `A sin(z + phase) = A cos(phase) sin z + A sin(phase) cos z`."""
    amplitude, phase = x['amplitude'], x['phase']
    return amplitude * math.cos(phase), amplitude * math.sin(phase)


class Spring(Effect):
    """`tau_x = -stiffness (q - rest)`: a torsion spring, or a cable under tension."""

    name = 'spring'
    words = 'a spring'
    formula = 'tau_x = -stiffness (q - rest)'
    source = MECHANICS
    appearance = 'the residual effort is linear in the position'
    quantities = (
        Quantity('stiffness', 'N m/rad', low=0.0, joint_number='stiffness'),
        Quantity('rest', 'rad', joint_number='rest'),
    )
    linear = ('stiffness', 'rest')
    plain = ('constant_load',)
    term = TermForm('spring', ('stiffness',))

    def coefficient_quantities(self, kind: str = '') -> tuple[Quantity, ...]:
        return self.quantities[0], Quantity('preload', 'N m')

    def model(self, numbers: Numbers, kind: str = '') -> tuple[np.ndarray, np.ndarray]:
        stiffness = numbers['stiffness']
        return EMPTY, np.array([stiffness, stiffness * numbers['rest']])

    def report(self, at: Placed, motion: SeenMotion) -> dict[str, Value]:
        stiffness, force = map(float, at.coefficients)
        return {'stiffness': stiffness, 'rest': force / stiffness}

    def is_possible(self, at: Placed, motion: SeenMotion) -> bool:
        return leaves_some(self.quantities[0], at, motion)

    def local(self, x: OwnMotion, shape: np.ndarray) -> tuple[np.ndarray, ...]:
        return -x.q, np.ones_like(x.q)

    def sized(self, x: JointScene) -> Drawn:
        return Drawn(x.small / x.spread, lambda s: {'stiffness': s, 'rest': x.rest})


class ConstantLoad(Effect):
    """`tau_x = force`."""

    name = 'constant_load'
    words = 'a constant load'
    formula = 'tau_x = force'
    source = MECHANICS
    appearance = 'the residual effort is the same everywhere'
    quantities = (Quantity('force', 'N m'),)
    linear = ('force',)
    term = TermForm('offset', ('offset',), sign=-1.0, is_assumed=True)

    def local(self, x: OwnMotion, shape: np.ndarray) -> tuple[np.ndarray, ...]:
        return (np.ones_like(x.q),)

    def sized(self, x: JointScene) -> Drawn:
        return Drawn(x.small, lambda s: {'force': x.sign * s})


class Armature(Effect):
    """`tau_x = -inertia a`: the rotor of the motor."""

    name = 'armature'
    words = 'rotor inertia'
    formula = 'tau_x = -inertia a'
    source = MECHANICS
    appearance = 'the residual effort is proportional to the acceleration'
    quantities = (Quantity('inertia', 'kg m2', low=0.0, joint_number='armature'),)
    linear = ('inertia',)
    term = TermForm('armature', ('armature',), is_dissipative=True)
    drawn_over = 'acceleration'
    is_inertial = True
    sees_acceleration = True
    is_usual = True

    def places(self, motion: SeenMotion) -> list[Place]:
        """Return the joints that have a motor."""
        return [x for x in super().places(motion) if motion.tree.is_actuated[x.joint]]

    def is_possible(self, at: Placed, motion: SeenMotion) -> bool:
        return leaves_some(self.quantities[0], at, motion)

    def local(self, x: OwnMotion, shape: np.ndarray) -> tuple[np.ndarray, ...]:
        return (-x.a,)

    def sized(self, x: JointScene) -> Drawn:
        return Drawn(x.small / x.acceleration, lambda s: {'inertia': s})


class Cogging(Effect):
    """A ripple over the position; columns are its sine and cosine, the shape its periods."""

    name = 'cogging'
    words = 'cogging'
    formula = 'tau_x = amplitude sin(periods q + phase)'
    source = 'Holtz and Springob 1996'
    appearance = 'the residual effort is periodic in the position, the same in both directions'
    quantities = (
        Quantity('amplitude', 'N m'),
        Quantity('periods', '1/revolution'),
        Quantity('phase', 'rad', is_scored=False),
    )
    linear = ('amplitude', 'phase')

    def coefficient_quantities(self, kind: str = '') -> tuple[Quantity, ...]:
        return Quantity('sine', 'N m'), Quantity('cosine', 'N m')

    def model(self, numbers: Numbers, kind: str = '') -> tuple[np.ndarray, np.ndarray]:
        return np.array([numbers['periods']]), np.array(wave_coefficients(numbers))

    def report(self, at: Placed, motion: SeenMotion) -> dict[str, Value]:
        c = at.coefficients
        return {
            'amplitude': float(math.hypot(c[0], c[1])),
            'periods': float(at.shape[0]),
            'phase': float(math.atan2(c[1], c[0])),
        }

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        angle = shape[0] * per_turn(motion, place.joint) * motion.position[:, place.joint]
        return np.column_stack([np.sin(angle), np.cos(angle)])

    def wave(self, motion: SeenMotion, place: Place) -> Wave:
        j, (low, high) = place.joint, self.bounds(motion, place)
        force = np.zeros(motion.position.shape)
        force[:, j] = 1.0
        phase = per_turn(motion, j) * motion.position[:, j]
        return Wave(phase, (force,), float(low[0]), float(high[0]))

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        """Return a few periods; a search starts from those of its wave."""
        low, high = self.bounds(motion, place)
        return np.geomspace(low, high, 4)

    def bounds(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        """Return one wave in the range of motion, three a turn, and the shortest one resolved."""
        j, least = place.joint, peak_width(motion, place.joint)
        if not motion.tree.is_prismatic[j]:
            least = max(least, LEAST_PERIODS)
        return np.array([least]), np.array([max(most_periods(motion, j), 1.5 * least)])

    def is_inside(self, at: Placed, motion: SeenMotion) -> bool:
        """Return whether more than one wave is seen; a fit that ends there is some other force."""
        return bool(at.shape[0] > _MORE_THAN_ONE * peak_width(motion, at.place.joint))

    def scales(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        return np.array([peak_width(motion, place.joint)])

    def sized(self, x: JointScene) -> Drawn:
        return Drawn(x.small, lambda s: {'amplitude': s, 'periods': x.periods, 'phase': x.phase})
