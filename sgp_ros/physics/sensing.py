"""Sensors that show another motion than there is: eccentric encoders, slow velocities."""

from __future__ import annotations

import math

import numpy as np

from sgp_ros.physics.drawing import Drawn, JointScene
from sgp_ros.physics.effect import Effect, Numbers
from sgp_ros.physics.loads import MECHANICS, wave_coefficients
from sgp_ros.physics.motion import SeenMotion
from sgp_ros.physics.parts import Quantity, SmallEffect, Value
from sgp_ros.physics.place import Place, Placed
from sgp_ros.physics.waves import Wave, most_periods, peak_width, per_turn

_NEWTON = 6
"""Steps to the true position."""
_IMITATED = 0.025
"""Part of the force of an error that an encoder's zero and scale leave if they are as adequate."""
_STEEPEST = 0.9
"""Greatest slope of an encoder's error: one that turned back would be no encoder."""


def _error(
    x: np.ndarray, rate: float, size: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return e, de/dx and d^2 e/dx^2 of an encoder, (n,) each."""
    sine, cosine = np.sin(rate * x), np.cos(rate * x)
    e = size[0] * sine + size[1] * cosine
    return e, rate * (size[0] * cosine - size[1] * sine), -(rate**2) * e


def _slightly_eccentric(motion: SeenMotion, place: Place, start: np.ndarray) -> np.ndarray:
    """Return the change of the nominal efforts per sine and cosine of a small error, (n, k, 2)."""
    j = place.joint
    rate = start[0] * per_turn(motion, j)
    q, v, a = motion.position[:, j], motion.velocity[:, j], motion.acceleration[:, j]
    by_q, by_v, by_a = motion.effort_slopes(j)
    columns = []
    for size in np.eye(2):
        e, slope, bend = _error(q, rate, size)
        change = by_v * (slope * v)[:, None] + by_a * (slope * a + bend * v**2)[:, None]
        columns.append(by_q * e[:, None] + change)
    return np.stack(columns, axis=2)


_STEEPEST_DRAWN = 0.8
"""Greatest slope of an encoder that is drawn."""


class EncoderEccentricity(Effect):
    """An encoder disc that is not centred.

    The encoder shows `q = x + e(x)` with `e = s sin(r x) + c cos(r x)`, r the periods per turn;
    shape is (periods, s, c). The true x, dx and ddx follow without approximation; the efforts
    change with them to first order.
    """

    name = 'encoder_eccentricity'
    words = 'an eccentric encoder'
    formula = 'encoder shows q + amplitude sin(periods q + phase)'
    source = 'Kavanagh 2001'
    appearance = (
        'a ripple of the residual effort over the position that grows with speed and acceleration'
    )
    quantities = (
        Quantity('amplitude', 'rad'),
        Quantity('periods', '1/revolution'),
        Quantity('phase', 'rad', is_scored=False),
    )
    size = 'amplitude'
    small = SmallEffect(_slightly_eccentric, lambda start, c: np.array([start[0], *c]))
    uses_bodies = True
    sees_acceleration = True

    def model(self, numbers: Numbers, kind: str = '') -> tuple[np.ndarray, np.ndarray]:
        return np.array([numbers['periods'], *wave_coefficients(numbers)]), np.ones(1)

    def report(self, at: Placed, motion: SeenMotion) -> dict[str, Value]:
        periods, sine, cosine = (float(x) for x in at.shape)
        return {
            'amplitude': math.hypot(sine, cosine), 'periods': periods,
            'phase': math.atan2(cosine, sine),
        }  # fmt: skip

    def is_possible(self, at: Placed, motion: SeenMotion) -> bool:
        """Return whether the encoder never turns back."""
        slope = np.hypot(*at.shape[1:]) * at.shape[0] * per_turn(motion, at.place.joint)
        return bool(slope < _STEEPEST)

    def is_inside(self, at: Placed, motion: SeenMotion) -> bool:
        """Return whether the motion shows so much of a wave that it is no zero and scale."""
        j = at.place.joint
        q, v, a = (x[:, [j]] for x in (motion.position, motion.velocity, motion.acceleration))
        by_q, by_v, by_a = motion.effort_slopes(j)
        force = self.columns(motion, at.place, at.shape).ravel()
        plain = np.stack([by_q, by_q * q + by_v * v + by_a * a], axis=2).reshape(-1, 2)
        left = force - plain @ np.linalg.lstsq(plain, force, rcond=1e-9)[0]
        return bool(left @ left > _IMITATED * (force @ force))

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        j = place.joint
        rate = shape[0] * per_turn(motion, j)
        q, v, a = motion.position[:, j], motion.velocity[:, j], motion.acceleration[:, j]
        x = q.copy()
        for _ in range(_NEWTON):
            e, slope, _ = _error(x, rate, shape[1:])
            x -= (x + e - q) / np.maximum(1.0 + slope, 0.1)
        e, slope, bend = _error(x, rate, shape[1:])
        dx = v / np.maximum(1.0 + slope, 0.1)
        ddx = (a - bend * dx**2) / np.maximum(1.0 + slope, 0.1)
        by_q, by_v, by_a = motion.effort_slopes(j)
        change = by_q * (q - x)[:, None] + by_v * (v - dx)[:, None] + by_a * (a - ddx)[:, None]
        return np.asarray(change[:, :, None])

    def wave(self, motion: SeenMotion, place: Place) -> Wave:
        """Return the first order in its size: `e = Im exp(i r x)` and its two derivatives."""
        j, (low, high) = place.joint, self.bounds(motion, place)
        by_q, by_v, by_a = motion.effort_slopes(j)
        v, a = motion.velocity[:, j, None], motion.acceleration[:, j, None]
        phase = per_turn(motion, j) * motion.position[:, j]
        # r is per turn: derivatives by the position have a factor more on a slide
        turn = per_turn(motion, j)
        parts = (by_q, turn * (by_v * v + by_a * a), turn**2 * by_a * v**2)
        return Wave(phase, parts, float(low[0]), float(high[0]))

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        """Return a few periods; a search starts from those of its wave."""
        low, high = self.bounds(motion, place)
        return np.geomspace(low[:1], high[:1], 4)

    def bounds(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        """Return one wave a turn, half of one in the range of a slide, and the shortest seen."""
        j = place.joint
        low = 0.5 * peak_width(motion, j) if motion.tree.is_prismatic[j] else 0.9
        high = max(most_periods(motion, j), 3.0 * low)
        most = _STEEPEST / (low * per_turn(motion, j))
        return np.array([low, -most, -most]), np.array([high, most, most])

    def scales(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        steepest = _STEEPEST / (shape[0] * per_turn(motion, place.joint))
        return np.array([peak_width(motion, place.joint), 2.0 * steepest, 2.0 * steepest])

    def sized(self, x: JointScene) -> Drawn:
        turns, slope = x.turns, 2.0 * math.pi * x.turns if x.is_prismatic else x.turns
        return Drawn(
            0.01 * x.reach / turns,
            lambda s: {'amplitude': s, 'periods': turns, 'phase': x.phase},
            _STEEPEST_DRAWN / slope,
        )


class EncoderOffset(Effect):
    """A zero of an encoder that is another one than the robot file's.

    The encoder shows `q + offset`; the efforts change with the true position to first order. For
    all of a recording it is an error of the connection; it is a law where one recording has it.
    """

    name = 'encoder_offset'
    words = 'encoder offset'
    formula = 'encoder shows q + offset'
    source = MECHANICS
    appearance = 'the residual effort is what gravity would do at another position'
    quantities = (Quantity('offset', 'rad'),)
    linear = ('offset',)
    uses_bodies = True
    sees_acceleration = True

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        return motion.effort_slopes(place.joint)[0][:, :, None]


class VelocityFilterLag(Effect):
    """A velocity field behind a first-order low-pass; the position is right."""

    name = 'velocity_filter_lag'
    words = 'a lag of the measured velocity'
    formula = 'measured velocity = velocity after a first-order low-pass'
    source = 'a first-order filter in the drive'
    appearance = 'the measured velocity lags behind the derivative of the position'
    quantities = (Quantity('time_constant', 's', low=1e-4, is_positive=True),)
    is_force = False
    is_online = False

    def sized(self, x: JointScene) -> Drawn:
        return Drawn(0.02, lambda s: {'time_constant': max(s, 1e-3)}, 0.06)
