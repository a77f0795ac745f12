"""Couplings between joints: torque of a motor, a cable, a motor that turns with both."""

from __future__ import annotations

import numpy as np

from sgp_ros.physics.drawing import Drawn, Scene, UnsuitableError
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.loads import MECHANICS
from sgp_ros.physics.motion import SeenMotion
from sgp_ros.physics.parts import Quantity
from sgp_ros.physics.place import MOTOR, Place, Placed

_LOPSIDED = 10.0
"""Ratio of two motions in their sum from which the smaller one is 1 % of the mean square."""


def _scale(signal: np.ndarray, place: Place) -> float:
    """Return how much larger a signal (n, k) of the joint is than that of its source."""
    own, other = signal[:, place.joint].std(), signal[:, place.source].std()
    return float(own / max(other, 1e-12))


def _sizes(motion: SeenMotion, signal: np.ndarray, place: Place) -> tuple[float, float]:
    """Return ratios with which both motions count in their sum, and both efforts feel it.

    A screw that a small motor turns has its friction in either, though its own share of the speed
    is next to nothing. Without efforts of both, the second is the first.
    """
    moves, efforts = _scale(signal, place), motion.effort[:, [place.joint, place.source]]
    own, other = efforts.std(axis=0)
    return moves, float(other / own) if min(own, other) > 0.0 else moves


def _ratio_bounds(
    motion: SeenMotion, signal: np.ndarray, place: Place
) -> tuple[np.ndarray, np.ndarray]:
    """Return bounds of `signal_joint + ratio signal_source`: beyond, the joint feels nothing."""
    most = np.array([_LOPSIDED * max(*_sizes(motion, signal, place), 1.0)])
    return -most, most


def _ratios(motion: SeenMotion, signal: np.ndarray, place: Place) -> np.ndarray:
    """Return ratios of gears and those with which both motions or efforts count, (starts, 1)."""
    both = dict.fromkeys(_sizes(motion, signal, place))
    sizes = [1.0, *(size * part for size in both for part in (0.5, 1.0, 2.0))]
    return np.array([sign * size for size in sizes for sign in (1.0, -1.0)])[:, None]


class JointCoupling(Effect):
    """Torque of another motor, or a cable of energy `stiffness/2 (q - ratio q_source)^2`."""

    name = 'joint_coupling'
    words = 'a coupling between joints'
    formula = 'tau_x = coefficient tau_source, or the force of stiffness/2 (q - ratio q_source)^2'
    source = MECHANICS
    appearance = 'the residual effort follows the effort or the position of another joint'
    quantities = (
        Quantity('coefficient', '1', kinds=('torque',)),
        Quantity('stiffness', 'N m/rad', low=0.0, kinds=('spring',)),
        Quantity('ratio', '1', is_scored=False, kinds=('spring',)),
    )
    linear = ('coefficient', 'stiffness')
    kinds = ('torque', 'spring')
    has_source = True

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        if place.kind == 'torque':
            return motion.effort[:, place.source, None]
        n, k = motion.position.shape
        columns = np.zeros((n, k, 1))
        stretch = motion.position[:, place.joint] - shape[0] * motion.position[:, place.source]
        columns[:, place.joint, 0] = -stretch
        columns[:, place.source, 0] = shape[0] * stretch
        return columns

    def effort_columns(self, kind: str) -> tuple[int, ...]:
        return (0,) if kind == 'torque' else ()

    def is_inside(self, at: Placed, motion: SeenMotion) -> bool:
        """Return whether both positions count where a cable pulls; else it is a spring of one."""
        if at.place.kind == 'torque':
            return True
        ratio, scale = abs(float(at.shape[0])), _scale(motion.position, at.place)
        return scale / _LOPSIDED < ratio < scale * _LOPSIDED

    def places(self, motion: SeenMotion) -> list[Place]:
        tree, moving = motion.tree, motion.moving_joints
        torques = [
            Place(j, 'torque', i) for j in moving for i in range(tree.size)
            if i != j and tree.is_actuated[i]
        ]  # fmt: skip
        return torques + [Place(j, 'spring', i) for j in moving for i in moving if i != j]

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        if place.kind == 'torque':
            return np.zeros((1, 0))
        return _ratios(motion, motion.position, place)

    def bounds(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        if place.kind == 'torque':
            return np.zeros(0), np.zeros(0)
        return _ratio_bounds(motion, motion.position, place)

    def draw(self, scene: Scene) -> Drawn:
        """Return a coupling of two joints, of motors where it is one of torques."""
        rng, motion, motors, count = scene.rng, scene.motion, scene.motors, len(scene.bodies)
        if count < 2:
            raise UnsuitableError(self.name)
        kind = 'torque' if len(motors) > 1 and rng.random() < 0.5 else 'spring'
        j = scene.choice(motors if kind == 'torque' else count)
        source = scene.choice(
            [i for i in (motors if kind == 'torque' else range(count)) if i != j]
        )
        words = {'source_joint': scene.bodies[source].joint, 'kind': kind}
        size = 0.3 * motion.effort[j]
        if kind == 'torque':
            sign = rng.choice([-1.0, 1.0])
            return Drawn(
                size / motion.effort[source], lambda s: {**words, 'coefficient': sign * s},
                1.0, index=j,
            )  # fmt: skip
        ratio = rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 1.5)
        ratio *= motion.spread[j] / motion.spread[source]
        return Drawn(
            size / motion.spread[j], lambda s: {**words, 'stiffness': s, 'ratio': ratio}, index=j
        )


class CoupledFriction(Effect):
    """Friction of a motor that turns with two joints, `w = v + ratio v_source`.

    Its rotor does so too. The part of that inertia which acts from one joint on the other,
    `ratio I a_source`, is no parameter here: the rest of it is `armature` of the two joints.
    """

    name = 'coupled_friction'
    words = 'friction of a motor that turns with two joints'
    formula = (
        'tau_x = -(coulomb sign(w) + viscous w) with w = v + ratio v_source, '
        'ratio times that on the source'
    )
    source = 'Gautier, Janot, Vandanjon 2013'
    appearance = 'the efforts of two joints step together when a sum of their speeds changes sign'
    quantities = (
        Quantity('ratio', '1'),
        Quantity('coulomb', 'N m', low=0.0),
        Quantity('viscous', 'N m s/rad', low=0.0),
    )
    linear = ('coulomb', 'viscous')
    has_source = True
    plain = ('coulomb_friction', 'viscous_friction')
    site = MOTOR
    drawn_over = 'velocity'
    is_dry = True

    def held_joints(self, place: Place) -> frozenset[int]:
        """Return both."""
        return frozenset({place.joint, place.source})

    def is_possible(self, at: Placed, motion: SeenMotion) -> bool:
        """Return whether it never drives, and the source's speed counts beside the joint's.

        A ratio of next to nothing is the plain friction of one joint, with a speed that is off by
        less than what its smoothing leaves.
        """
        ratio = float(at.shape[0])
        if abs(ratio) * _LOPSIDED < _scale(motion.velocity, at.place):
            return False
        w = self._speed(motion, at.place, ratio)
        force = at.coefficients * np.array([1.0, np.sqrt(np.mean(w**2))])
        return bool(np.max(force) > 0.0 and np.all(force > -0.05 * np.max(force)))

    def _speed(self, motion: SeenMotion, place: Place, ratio: float) -> np.ndarray:
        v = motion.velocity
        return np.asarray(v[:, place.joint] + ratio * v[:, place.source])

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        w = self._speed(motion, place, float(shape[0]))
        columns = np.zeros((*motion.position.shape, 2))
        columns[:, place.joint] = -np.column_stack([motion.direction_of(w), w])
        columns[:, place.source] = shape[0] * columns[:, place.joint]
        return columns

    def places(self, motion: SeenMotion) -> list[Place]:
        """Return each motor with the joint that carries it."""
        tree, moving = motion.tree, motion.moving_joints
        pairs = [(j, int(tree.parents[j])) for j in moving if tree.is_actuated[j]]
        return [Place(j, source=i) for j, i in pairs if i in moving]

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        return _ratios(motion, motion.velocity, place)

    def bounds(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        return _ratio_bounds(motion, motion.velocity, place)

    def draw(self, scene: Scene) -> Drawn:
        """Return it on a motor and the joint that carries it."""
        rng, bodies, motion = scene.rng, scene.bodies, scene.motion
        able = [j for j in scene.motors if bodies[j].parent >= 0]
        if not able:
            raise UnsuitableError(self.name)
        j = scene.choice(able)
        source = bodies[j].parent
        ratio = rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 1.5)
        if bodies[j].is_prismatic != bodies[source].is_prismatic:
            ratio *= motion.velocity[j] / motion.velocity[source]
        share, speed = (
            rng.uniform(0.2, 0.8),
            np.hypot(*motion.velocity[[j, source]] * [1.0, ratio]),
        )
        words = {'source_joint': bodies[source].joint, 'ratio': ratio}
        return Drawn(
            0.3 * motion.effort[j],
            lambda s: {**words, 'coulomb': s, 'viscous': share * s / speed}, index=j,
        )  # fmt: skip
