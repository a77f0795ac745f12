"""What a drive does to its command: gain, dead zone, saturation, lag and delay."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sgp_ros.physics.effect import (
    Effect,
    Fitted,
    Place,
    Quantity,
    every_motor,
    no_shape,
    shaped,
)
from sgp_ros.physics.observed_motion import ObservedMotion


def _commanded(motion: ObservedMotion) -> list[Place]:
    return every_motor(motion) if motion.drive is not None else []


def _delayed(motion: ObservedMotion) -> list[Place]:
    """Return each motor, and all of them together."""
    motors = _commanded(motion)
    return [*motors, Place(-3)] if len(motors) > 1 else motors


def _gain(motion: ObservedMotion, place: Place, _shape: np.ndarray) -> np.ndarray:
    return motion.effort[:, place.joint, None]


def _instead(motion: ObservedMotion, joint: int, effort: np.ndarray) -> np.ndarray:
    return effort - motion.effort[:, joint]


def _dead_zone(motion: ObservedMotion, place: Place, shape: np.ndarray) -> np.ndarray:
    assert motion.drive is not None
    w = abs(shape[0])
    given = motion.drive.effort(place.joint, characteristic=lambda u: u - np.clip(u, -w, w))
    return _instead(motion, place.joint, given)[:, None]


def _saturation(motion: ObservedMotion, place: Place, shape: np.ndarray) -> np.ndarray:
    assert motion.drive is not None
    limit = abs(shape[0])
    given = motion.drive.effort(place.joint, characteristic=lambda u: np.clip(u, -limit, limit))
    return _instead(motion, place.joint, given)[:, None]


def _lag(motion: ObservedMotion, place: Place, shape: np.ndarray) -> np.ndarray:
    assert motion.drive is not None
    given = motion.drive.effort(place.joint, time_constant=max(shape[0], 0.0))
    return _instead(motion, place.joint, given)[:, None]


def _delay(motion: ObservedMotion, place: Place, shape: np.ndarray) -> np.ndarray:
    drive = motion.drive
    assert drive is not None
    if place.joint >= 0:
        given = drive.effort(place.joint, delay=shape[0])
        return _instead(motion, place.joint, given)[:, None]
    columns = np.zeros((*motion.position.shape, 1))
    for motor in every_motor(motion):
        j = motor.joint
        columns[:, j, 0] = _instead(motion, j, drive.effort(j, delay=shape[0]))
    return columns


def _times(_motion: ObservedMotion, _place: Place) -> np.ndarray:
    return np.geomspace(0.002, 0.12, 16)[:, None]


def _levels(*shares: float) -> Callable[[ObservedMotion, Place], np.ndarray]:
    """Return starts at these quantiles of the commands' sizes."""

    def starts(motion: ObservedMotion, place: Place) -> np.ndarray:
        assert motion.drive is not None
        size = np.abs(motion.drive.values[:, place.joint])
        return np.unique(np.quantile(size, shares))[:, None]

    return starts


def _level_bounds(motion: ObservedMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
    assert motion.drive is not None
    size = np.abs(motion.drive.values[:, place.joint])
    return np.zeros(1), np.array([np.quantile(size, 0.9)])


def _limit_bounds(motion: ObservedMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
    assert motion.drive is not None
    size = np.abs(motion.drive.values[:, place.joint])
    return np.array([np.quantile(size, 0.2)]), np.array([size.max()])


def _is_some(f: Fitted) -> bool:
    return bool(f.shape[0] > 0.0)


def _quarter(_motion: ObservedMotion, _place: Place) -> tuple[np.ndarray, np.ndarray]:
    """Return the bounds of times [s]."""
    return np.zeros(1), np.full(1, 0.25)


TORQUE_GAIN = Effect(
    'torque_gain', (Quantity('gain', '1'),), _gain, every_motor, no_shape,
    lambda f: {'gain': 1.0 + float(f.coefficients[0])},
    lambda f: bool(-0.7 < f.coefficients[0] < 1.5), 'motor torque = gain x command',
)  # fmt: skip
DEAD_ZONE = Effect(
    'dead_zone', (Quantity('width', 'N m'),), _dead_zone, _commanded,
    _levels(0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7), shaped('width'), _is_some,
    'motor torque = u - clip(u, -width, width)', is_given=True, has_memory=True,
    bounds=_level_bounds,
)  # fmt: skip
SATURATION = Effect(
    'saturation', (Quantity('limit', 'N m'),), _saturation, _commanded,
    _levels(0.3, 0.5, 0.65, 0.8, 0.88, 0.94, 0.97, 0.99), shaped('limit'), _is_some,
    'motor torque = clip(u, -limit, limit)', is_given=True, has_memory=True, bounds=_limit_bounds,
)  # fmt: skip
ACTUATOR_LAG = Effect(
    'actuator_lag', (Quantity('time_constant', 's'),), _lag, _commanded, _times,
    shaped('time_constant'), _is_some, 'time_constant d tau/dt + tau = command',
    is_given=True, has_memory=True,
    bounds=_quarter,
)  # fmt: skip
COMMAND_DELAY = Effect(
    'command_delay', (Quantity('delay', 's'),), _delay, _delayed, _times, shaped('delay'),
    _is_some, 'motor torque(t) = command(t - delay)', is_given=True, has_memory=True,
    bounds=_quarter,
)  # fmt: skip
