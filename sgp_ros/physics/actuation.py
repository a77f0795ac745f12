"""Drives that change their command: gain, dead zone, limits of torque, lag and delay."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from sgp_ros.physics.drawing import Drawn, JointScene, Scene
from sgp_ros.physics.effect import EMPTY, Effect, Numbers
from sgp_ros.physics.motion import Commands, SeenMotion
from sgp_ros.physics.parts import Quantity, Value, relative_scales
from sgp_ros.physics.place import MOTOR, PLACES, Place, Placed

Characteristic = Callable[[np.ndarray], np.ndarray]
_MECHATRONICS = 'Isermann 2005, Mechatronic Systems'
CONNECTED = 0.05
"""Part of its command that a motor delivers at least; what delivers less does not drive."""

_FITTING = 20.0
"""Times that the longest delay or lag fits into a recording; a longer one is seen too seldom."""
_LATER = 1.35
"""Ratio of delays from which searches start."""

_NO_LIMIT = 20.0
"""Ranges of torque and speed up to which a motor's limits are sought."""

SPREAD = 0.16
"""Prior standard deviation of the logarithm of a gain [1]: 2 is as rare as a law. Convention."""


def _sizes(motion: SeenMotion, place: Place) -> np.ndarray:
    return np.abs(_commands(motion).values[:, place.joint])


def _commands(motion: SeenMotion) -> Commands:
    assert motion.drive is not None
    return motion.drive


def _instead(motion: SeenMotion, joint: int, effort: np.ndarray) -> np.ndarray:
    return effort - motion.effort[:, joint]


class Drive(Effect):
    """A drive whose shape says all."""

    source = _MECHATRONICS
    site = MOTOR
    is_of_command = True
    has_memory = True

    def characteristic(self, shape: np.ndarray) -> Characteristic | None:
        """Return what it gives of a command of the same time; None for the command itself."""

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        given = _commands(motion).effort(place.joint, characteristic=self.characteristic(shape))
        return _instead(motion, place.joint, given)[:, None]


class TorqueGain(Effect):
    """A motor that delivers gain times its command."""

    name = 'torque_gain'
    words = 'a wrong torque constant'
    formula = 'motor torque = gain x command'
    source = _MECHATRONICS
    appearance = 'the residual effort is proportional to the effort'
    quantities = (Quantity('gain', '1', is_positive=True, neutral=1.0, joint_number='gain'),)
    linear = ('gain',)
    alike = ('armature',)  # half the torque, or twice the inertia, where no gravity acts
    site = MOTOR
    stage = 6
    drawn_over = 'effort'

    def model(self, numbers: Numbers, kind: str = '') -> tuple[np.ndarray, np.ndarray]:
        return EMPTY, np.array([numbers['gain'] - 1.0])

    def report(self, at: Placed, motion: SeenMotion) -> dict[str, Value]:
        return {'gain': 1.0 + float(at.coefficients[0])}

    def is_possible(self, at: Placed, motion: SeenMotion) -> bool:
        return bool(at.coefficients[0] > CONNECTED - 1.0)

    def surprise(self, at: Placed) -> float:
        """Return the price of a gain: most torque constants are known to a sixth."""
        gain = max(1.0 + float(at.coefficients[0]), CONNECTED)
        return 0.5 * (math.log(gain) / SPREAD) ** 2

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        return motion.effort[:, place.joint, None]

    def effort_columns(self, kind: str) -> tuple[int, ...]:
        return (0,)

    def sized(self, x: JointScene) -> Drawn:
        return Drawn(0.25, lambda s: {'gain': 1.0 + x.sign * s}, 0.6)


class DeadZone(Drive):
    """A motor that does not answer to small commands."""

    name = 'dead_zone'
    words = 'a dead zone of the drive'
    formula = 'motor torque = u - clip(u, -width, width)'
    appearance = 'small commands have no effect; large ones lose a constant amount'
    quantities = (Quantity('width', 'N m', low=0.0, is_positive=True),)
    stage = 2
    drawn_over = 'effort'

    def characteristic(self, shape: np.ndarray) -> Characteristic | None:
        w = abs(shape[0])
        return lambda u: u - np.clip(u, -w, w)

    def effort_columns(self, kind: str) -> tuple[int, ...]:
        return (0,)

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        shares = (0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9)
        return np.unique(np.quantile(_sizes(motion, place), shares))[:, None]

    def bounds(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        """Return nothing and the greatest command: a wider one is a motor that is off."""
        return np.zeros(1), np.array([_sizes(motion, place).max()])

    def sized(self, x: JointScene) -> Drawn:
        return Drawn(0.3 * x.force, lambda s: {'width': s})


class Saturation(Drive):
    """A motor that gives no more than a limit."""

    name = 'saturation'
    words = 'an early saturation of the drive'
    formula = 'motor torque = clip(u, -limit, limit)'
    appearance = 'the largest commands have less effect than they should'
    quantities = (Quantity('limit', 'N m', low=0.0, is_positive=True),)
    stage = 3
    drawn_over = 'effort'

    def characteristic(self, shape: np.ndarray) -> Characteristic | None:
        limit = abs(shape[0])
        return lambda u: np.clip(u, -limit, limit)

    def effort_columns(self, kind: str) -> tuple[int, ...]:
        return (0,)

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        shares = (0.1, 0.3, 0.5, 0.65, 0.8, 0.88, 0.94, 0.97, 0.99)
        return np.unique(np.quantile(_sizes(motion, place), shares))[:, None]

    def bounds(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        """Return nothing and the greatest command, which every limit above it passes."""
        return np.zeros(1), np.array([_sizes(motion, place).max()])

    def draw(self, scene: Scene) -> Drawn:
        force = scene.motion.effort[scene.joint]
        return Drawn(0.7, lambda s: {'limit': force / s}, 2.0, 5.0)


class MotorSpeedLimit(Effect):
    """A motor whose supply has no voltage left for its full torque at speed.

    Only a torque that drives falls with the speed, `sign(tau) = sign(v)`. One that brakes has the
    voltage of the motor on its side: the current of the standing motor limits it. Shape is
    (stall_torque, no_load_speed).
    """

    name = 'motor_speed_limit'
    words = 'a motor torque that falls with speed'
    formula = 'driving torque at most stall_torque max(1 - |v| / no_load_speed, 0)'
    source = 'Hughes and Drury 2019, Electric Motors and Drives'
    appearance = 'large efforts at high speed have less effect than they should'
    quantities = (
        Quantity('stall_torque', 'N m', low=0.0, is_positive=True),
        Quantity('no_load_speed', 'rad/s', low=0.0, is_positive=True),
    )  # fmt: skip
    site = MOTOR
    stage = 5
    drawn_over = 'velocity'
    is_of_command = True

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        u, v = motion.effort[:, place.joint], motion.velocity[:, place.joint]
        driving = np.maximum(1.0 - np.abs(v) / max(shape[1], 1e-300), 0.0)
        most = shape[0] * np.where(u * v > 0.0, driving, 1.0)
        return (np.clip(u, -most, most) - u)[:, None]

    def effort_columns(self, kind: str) -> tuple[int, ...]:
        return (0,)

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        """Return lines that part of the driving torques are above."""
        u, v = motion.effort[:, place.joint], motion.velocity[:, place.joint]
        u, v = np.abs(u[u * v > 0.0]), np.abs(v[u * v > 0.0])
        if not len(u):
            return np.zeros((0, 2))
        found = []
        for ratio in (0.8, 1.1, 1.5, 2.2, 4.0):
            w = ratio * v.max()
            stall = np.quantile(
                u / np.maximum(1.0 - v / w, 0.1), (0.3, 0.5, 0.7, 0.85, 0.93, 0.98)
            )
            found += [[s, w] for s in stall]
        low, high = self.bounds(motion, place)
        return np.clip(found, low, high)

    def bounds(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        """Return a part of the greatest torque and speed, and many times them: no limit at all."""
        most = np.array([np.ptp(x[:, place.joint]) for x in (motion.effort, motion.velocity)])
        return 1e-3 * most, _NO_LIMIT * most

    def scales(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        return np.maximum(shape, 1e-3 * self.bounds(motion, place)[1])

    def sized(self, x: JointScene) -> Drawn:
        speed = 1.5 * x.mean * x.velocity
        return Drawn(
            0.7, lambda s: {'stall_torque': 1.5 * x.force / s, 'no_load_speed': speed}, 3.0, 5.0
        )


class _Late(Drive):
    """A drive whose torque comes late; the shape is a time [s]."""

    drawn_over = 'seconds'
    is_late = True

    def effort_columns(self, kind: str) -> tuple[int, ...]:
        return (0,)

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        longest = self._longest(motion)
        least = min(0.2 * motion.step, 0.1 * longest)
        count = 2 + math.ceil(math.log(longest / least) / math.log(_LATER))
        return np.geomspace(least, longest, count)[:, None]

    def bounds(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        """Return no time, and the longest that fits often enough into the recording."""
        return np.zeros(1), np.full(1, self._longest(motion))

    def scales(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        return relative_scales(*self.bounds(motion, place), shape)

    def _longest(self, motion: SeenMotion) -> float:
        return float(np.ptp(motion.time)) / _FITTING


class ActuatorLag(_Late):
    """A first-order lag between command and torque."""

    name = 'actuator_lag'
    words = 'a lag of the drive'
    formula = 'time_constant d tau/dt + tau = command'
    appearance = 'the torque follows fast commands late and smoothed'
    quantities = (Quantity('time_constant', 's', low=1e-4, is_positive=True, joint_number='lag'),)
    stage = 4

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        given = _commands(motion).effort(place.joint, time_constant=max(shape[0], 0.0))
        return _instead(motion, place.joint, given)[:, None]

    def sized(self, x: JointScene) -> Drawn:
        return Drawn(0.02, lambda s: {'time_constant': max(s, 1e-3)}, 0.08)


class CommandDelay(_Late):
    """A pure delay of the command, of one motor or of all."""

    name = 'command_delay'
    words = 'a delay of the command'
    formula = 'motor torque(t) = command(t - delay)'
    appearance = 'the motion responds to commands late, but is otherwise unchanged'
    quantities = (
        Quantity('delay', 's', low=0.0, is_positive=True, is_sought=True, joint_number='delay'),
    )
    takes_all = True
    stage = 1

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        drive = _commands(motion)
        if place.joint >= 0:
            given = drive.effort(place.joint, delay=shape[0])
            return _instead(motion, place.joint, given)[:, None]
        columns = np.zeros((*motion.position.shape, 1))
        for motor in super().places(motion):
            j = motor.joint
            columns[:, j, 0] = _instead(motion, j, drive.effort(j, delay=shape[0]))
        return columns

    def places(self, motion: SeenMotion) -> list[Place]:
        """Return each motor, and all of them together."""
        motors = super().places(motion)
        return [*motors, Place(PLACES['all'])] if len(motors) > 1 else motors

    def draw(self, scene: Scene) -> Drawn:
        """Return a delay of one motor, or of all."""
        is_all = len(scene.motors) > 1 and scene.rng.random() < 0.3
        return Drawn(0.015, lambda s: {'delay': round(s, 4)}, 0.06, place='all' if is_all else '')
