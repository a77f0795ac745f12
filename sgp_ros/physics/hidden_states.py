"""Signals behind filters, and states that swing unseen on a spring."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numba import njit

from sgp_ros.physics.motion import SeenMotion

_WIDER = 2.0
"""Frequency at which half is left of signals that are differentiated, over the bandwidth."""
_SHARP = 5.0
_TIMES_GONE, _LEAST_GONE = 3.0, 20
"""Time constants and rows from which on the state at the start is found."""
_SECOND = np.convolve([1 / 90, -1 / 12 - 4 / 90, 1 + 2 / 12 + 6 / 90, -1 / 12 - 4 / 90, 1 / 90],
                      [1.0, -2.0, 1.0])  # fmt: skip
_FIRST = np.array([1.0, -9.0, 45.0, 0.0, -45.0, 9.0, -1.0]) / 60.0


def _convolved(x: np.ndarray, weights: np.ndarray, starts: tuple[int, ...]) -> np.ndarray:
    """Return x (n,) under symmetric or odd weights, the ends repeated, stretch by stretch."""
    ends, parts = np.ones(len(weights) // 2), []
    for part in np.split(x, starts[1:]):
        padded = np.concatenate([part[0] * ends, part, part[-1] * ends])
        parts.append(np.convolve(padded, weights, mode='valid'))
    return np.concatenate(parts)


def smooth(motion: SeenMotion, x: np.ndarray) -> np.ndarray:
    """Return a signal (n,) without what lies far above the bandwidth, where no equation is."""
    wide = _WIDER * motion.bandwidth * motion.step
    if not wide < 0.4:
        return x
    return _convolved(x, _low_pass(wide), motion.starts)


@lru_cache(maxsize=16)
def _low_pass(wide: float) -> np.ndarray:
    """Return weights of a low-pass filter of unit gain, for a frequency per row."""
    half = max(2, round(1.6 / wide))
    t = np.arange(-half, half + 1)
    weights = np.sinc(2.0 * wide * t) * np.kaiser(len(t), _SHARP)
    return np.asarray(weights / weights.sum())


def derivatives(motion: SeenMotion, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the first and the second derivative of a smooth signal, (n,) each."""
    return (_convolved(x, _FIRST, motion.starts) / motion.step,
            _convolved(x, _SECOND, motion.starts) / motion.step**2)  # fmt: skip


@njit(cache=True)
def behind(x: np.ndarray, time_constant: complex, step: float) -> np.ndarray:
    """Return y of `T y' + y = x`, exact where x is straight between rows; it starts settled."""
    y = x.copy()
    if abs(time_constant) <= 1e-6 * step:
        return y
    keep = np.exp(-step / time_constant)
    slow = (1.0 - keep) * time_constant / step
    for i in range(1, len(x)):
        y[i] = keep * y[i - 1] + (slow - keep) * x[i - 1] + (1.0 - slow) * x[i]
    return y


@njit(cache=True)
def _swung(
    u: np.ndarray, a: np.ndarray, b: np.ndarray, c: np.ndarray, step: float, starts: np.ndarray
) -> np.ndarray:
    """Return y and y' of `a y'' + b y' + c y = u`, (m, n, 2), that start from m of them, (m, 2).

    Only the first is driven by u; the others swing freely. Exact where u is straight and the rest
    constant. What swings faster than the rows show is damped.
    """
    y = np.empty((len(starts), len(u), 2))
    y[:, 0] = starts
    for i in range(1, len(u)):
        A, C = max(a[i], 1e-12 * step * step * c[i]), c[i]
        fast = min(1.0, max(0.0, np.sqrt(C / A) * step - 1.0))
        B = b[i] + 2.0 * fast * np.sqrt(A * C)
        slope = (u[i] - u[i - 1]) / step
        decay, square = 0.5 * B / A, C / A - 0.25 * B * B / (A * A)
        if square > 0.0:
            rate = np.sqrt(square)
            gone, cos = np.exp(-decay * step), np.cos(rate * step)
            sin = np.sin(rate * step) / rate
        else:
            rate = np.sqrt(-square)
            slow, quick = np.exp((rate - decay) * step), np.exp(-(rate + decay) * step)
            gone, cos = 1.0, 0.5 * (slow + quick)
            sin = 0.5 * (slow - quick) / rate if rate * step > 1e-6 else step * slow
        # the straight line that the driven one follows; all else decays
        line, rise, end = (u[i - 1] - B * slope / C) / C, slope / C, u[i] / C - B * slope / (C * C)
        for k in range(len(starts)):
            rest, speed = y[k, i - 1, 0] - line, y[k, i - 1, 1] - rise
            y[k, i, 0] = end + gone * (rest * (cos + decay * sin) + speed * sin)
            y[k, i, 1] = rise + gone * (speed * (cos - decay * sin) - rest * C / A * sin)
            line, rise, end = 0.0, 0.0, 0.0
    return y


def on_spring(
    torque: np.ndarray, terms: tuple[np.ndarray, ...], acting: np.ndarray, motion: np.ndarray,
    settling: float, step: float,
) -> np.ndarray:  # fmt: skip
    """Return what `_swung` makes of a torque in one stretch, (n,), from a state that fits best.

    What swings at the start is what is left of the acting effort but for rotor and friction.

    Args:
        torque: (n,).
        terms: a, b and c of the equation, (n,) each.
        acting: effort less the torque of the motor in the nominal robot, (n,).
        motion: velocity and acceleration, (n, 2).
        settling: ratio of damping to stiffness [s].
        step: between rows [s].
    """
    a, b, c = terms
    swing = math.sqrt(float(c[0] / a[0]))
    starts = np.array([[float(torque[0] / c[0]), 0.0], [1.0, 0.0], [0.0, swing]])
    forced, *free = _swung(torque, a, b, c, step, starts)
    gone = 2.0 * _TIMES_GONE * float(a[0]) / max(float(b[0]), 1e-300)
    n = max(_LEAST_GONE, int(min(gone / step, len(torque))))
    rest = acting - forced[:, 0] - settling * forced[:, 1]
    x = np.column_stack([*(f[:, 0] + settling * f[:, 1] for f in free), motion,
                         np.sign(motion[:, 0])])  # fmt: skip
    found = np.linalg.lstsq(x[:n], rest[:n], rcond=None)[0]
    return np.asarray(forced[:, 0] + found[0] * free[0][:, 0] + found[1] * free[1][:, 0])


def resonator(
    u: np.ndarray, a: float, b: float, step: float, *, is_settled: bool = True
) -> np.ndarray:
    """Return y of `a y'' + b y' + y = b u' + u` by partial fractions.

    It starts settled under the first u, or else at rest at 0.
    """
    root = np.sqrt(complex(b * b - 4.0 * a))
    root = root if abs(root) > 1e-6 * abs(b) else complex(1e-6 * b)
    y = np.zeros(len(u), dtype=np.complex128)
    for sign in (1.0, -1.0):
        pole = (sign * root - b) / (2.0 * a)
        residue = (b * pole + 1.0) / (sign * root)
        part = behind(u.astype(np.complex128), -1.0 / pole, step)
        if not is_settled:
            part -= u[0] * np.exp(pole * step * np.arange(len(u)))
        y += -residue / pole * part
    return y.real
