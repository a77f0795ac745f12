"""Effects with memory and of the sensors: hysteresis, backlash, eccentric encoders."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from sgp_ros.physics.effect import (
    Effect,
    Fitted,
    Place,
    Quantity,
    SmallEffect,
    Value,
    always,
    every_joint,
    every_motor,
    is_positive,
)
from sgp_ros.physics.loads import per_turn
from sgp_ros.physics.observed_motion import ObservedMotion
from sgp_ros.rigid.rigid_body import mass_matrix


def _hysteresis(motion: ObservedMotion, place: Place, shape: np.ndarray) -> np.ndarray:
    q = motion.position[:, place.joint]
    return -_bristle(q, float(shape[0]))[:, None]


@njit(cache=True)
def _bristle(q: np.ndarray, presliding: float) -> np.ndarray:
    """Return z of `dz/dt = (v - |v| z) / presliding`, exact for a steady direction per step."""
    z = np.zeros(len(q))
    for i in range(1, len(q)):
        way = q[i] - q[i - 1]
        sign = 1.0 if way > 0.0 else -1.0
        z[i] = sign + (z[i - 1] - sign) * np.exp(-abs(way) / presliding)
    return z


def _ways(motion: ObservedMotion, place: Place) -> np.ndarray:
    q = motion.position[:, place.joint]
    span = np.quantile(q, 0.95) - np.quantile(q, 0.05)
    return span * np.array([0.003, 0.01, 0.03, 0.07, 0.15, 0.3, 0.6])[:, None]


def _eccentric(motion: ObservedMotion, place: Place, shape: np.ndarray) -> np.ndarray:
    """Return the change of the nominal efforts by an encoder's error, (n, k, 1).

    The encoder shows `q = x + e(x)` with `e = s sin(r x) + c cos(r x)`, r the periods per turn;
    shape is (periods, s, c). The true x, dx and ddx follow without approximation; the efforts
    change with them to first order.
    """
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


_NEWTON = 6
"""Steps to the true position."""


def _error(
    x: np.ndarray, rate: float, size: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return e, de/dx and d^2 e/dx^2 of an encoder, (n,) each."""
    sine, cosine = np.sin(rate * x), np.cos(rate * x)
    e = size[0] * sine + size[1] * cosine
    return e, rate * (size[0] * cosine - size[1] * sine), -(rate**2) * e


def _slightly_eccentric(motion: ObservedMotion, place: Place, start: np.ndarray) -> np.ndarray:
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


def _turns(motion: ObservedMotion, place: Place) -> np.ndarray:
    """Return periods to start from, on prismatic joints from half a wave in the range."""
    if motion.tree.is_prismatic[place.joint]:
        span = float(np.ptp(motion.position[:, place.joint]))
        return np.arange(0.5, 9.0, 0.5)[:, None] / max(span, 1e-9)
    return np.arange(1.0, 11.0)[:, None]


_STEEPEST = 0.9
"""Greatest slope of an encoder's error: one that turned back would be no encoder."""


def _is_monotonic(f: Fitted) -> bool:
    """Return whether the encoder never turns back."""
    slope = np.hypot(*f.shape[1:]) * f.shape[0] * per_turn(f.motion, f.place.joint)
    return bool(slope < _STEEPEST)


def _eccentricity(f: Fitted) -> dict[str, Value]:
    periods, sine, cosine = (float(x) for x in f.shape)
    return {
        'amplitude': math.hypot(sine, cosine), 'periods': periods,
        'phase': math.atan2(cosine, sine),
    }  # fmt: skip


def _eccentricity_bounds(motion: ObservedMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
    turns = _turns(motion, place)
    low, high = 0.9 * float(turns[0, 0]), 1.5 * float(turns[-1, 0])
    most = _STEEPEST / (low * per_turn(motion, place.joint))
    return np.array([low, -most, -most]), np.array([high, most, most])


def _backlash(motion: ObservedMotion, place: Place, shape: np.ndarray) -> np.ndarray:
    """Return the force that play seems to exert, (n, 1).

    Encoder and damping sit on the motor, of inertia `share M`. Where it leads the link by delta,
    the nominal model asks for `(1 - share) M d^2 delta/dt^2` too much. In contact the force
    between them is `(1 - share) tau + share h`; when it changes its sign, the two fly freely to
    the other side, with the relative acceleration `tau / (share M) + h / ((1 - share) M)`.
    """
    j = place.joint
    share = shape[0]
    inertia = motion.mass_diagonal[:, j]
    damped = motion.tree.damping[j] * motion.velocity[:, j]
    link = motion.nominal_effort[:, j] - inertia * motion.acceleration[:, j] - damped
    pressed = (1.0 - share) * (motion.effort[:, j] - damped) + share * link
    relative = pressed / np.maximum(share * (1.0 - share) * inertia, 1e-12)
    lead = _play(pressed, relative, float(shape[1]), motion.step)
    return ((1.0 - share) * inertia * _second_difference(lead, motion.step))[:, None]


@njit(cache=True)
def _play(needed: np.ndarray, relative: np.ndarray, gap: float, step: float) -> np.ndarray:
    """Return how far the motor leads the link, between half a gap to either side, (n,)."""
    n = len(needed)
    lead = np.zeros(n)
    x = 0.5 * gap if needed[0] > 0.0 else -0.5 * gap
    v = 0.0
    for i in range(n):
        at_high, at_low = x >= 0.5 * gap, x <= -0.5 * gap
        if (at_high and needed[i] >= 0.0) or (at_low and needed[i] <= 0.0):
            v = 0.0
        else:
            v += relative[i] * step
            x += v * step
            if x >= 0.5 * gap:
                x, v = 0.5 * gap, 0.0
            elif x <= -0.5 * gap:
                x, v = -0.5 * gap, 0.0
        lead[i] = x
    return lead


def _second_difference(x: np.ndarray, step: float) -> np.ndarray:
    return np.diff(np.pad(x, 1, mode='edge'), 2) / step**2


def _play_of(f: Fitted) -> dict[str, Value]:
    """Return gap and the motor's inertia, its share of what the joint has over the motion.

    It is less than the joint moves while all others are free: the link keeps some.
    """
    joint, rows = f.place.joint, slice(None, None, max(1, len(f.motion.time) // _POSES))
    M = mass_matrix(f.motion.tree, f.motion.tree.parameters, f.motion.position[rows])
    least = 1.0 / float(np.linalg.inv(M)[:, joint, joint].max())
    inertia = float(f.shape[0]) * float(np.mean(f.motion.mass_diagonal[:, joint]))
    return {'gap': float(f.shape[1]), 'motor_inertia': min(inertia, _MOST_OF_LINK * least)}


_POSES = 200
_MOST_OF_LINK = 0.9


def _gaps(motion: ObservedMotion, place: Place) -> np.ndarray:
    span = float(np.ptp(motion.position[:, place.joint]))
    widths = np.geomspace(0.0005, 0.04, 7) * span
    shares = (0.06, 0.12, 0.18, 0.24, 0.3, 0.37, 0.45, 0.55, 0.7)
    return np.array([[share, width] for share in shares for width in widths])


HYSTERESIS = Effect(
    'hysteresis', (Quantity('level', 'N m'), Quantity('presliding', 'rad')), _hysteresis,
    every_joint, _ways,
    lambda f: {'level': float(f.coefficients[0]), 'presliding': float(f.shape[0])},
    is_positive, 'tau_x = -level z, dz/dt = (v - |v| z) / presliding', has_memory=True,
    bounds=lambda motion, place: (
        _ways(motion, place)[0] / 5.0, _ways(motion, place)[-1] * 3.0
    ),
)  # fmt: skip
ENCODER_ECCENTRICITY = Effect(
    'encoder_eccentricity',
    (Quantity('amplitude', 'rad'), Quantity('periods', '1/revolution'), Quantity('phase', 'rad')),
    _eccentric, every_joint, _turns, _eccentricity, _is_monotonic,
    'encoder shows q + amplitude sin(periods q + phase)', is_given=True, uses_bodies=True,
    sees_acceleration=True, bounds=_eccentricity_bounds,
    small=SmallEffect(_slightly_eccentric, lambda start, c: np.array([start[0], *c])),
)  # fmt: skip
BACKLASH = Effect(
    'backlash', (Quantity('gap', 'rad'), Quantity('motor_inertia', 'kg m2')), _backlash,
    every_motor, _gaps, _play_of, always,
    'motor and link play freely within gap; the encoder sits on the motor', is_given=True,
    uses_bodies=True, sees_acceleration=True, has_memory=True,
    bounds=lambda motion, place: (
        np.array([0.01, 1e-9]),
        np.array([0.95, float(np.ptp(motion.position[:, place.joint]))]),
    ),
)  # fmt: skip
