"""Angles that wrap at a whole turn, counted on.

A step of a whole turn between two rows is a wrap where the step less the turn goes on with the
motion: with the velocity, or with the steps beside it. Where one such step does not, nothing is
known of the others, and the angles stay as they are. Turns do not tell which of them the joint is
in; its limits do.
"""

from __future__ import annotations

import math

import numpy as np

TURN = 2.0 * math.pi
_MISS = 0.1 * TURN
"""By which a step less its turn may miss the motion around it [rad]. Convention."""
MARGIN = 0.3
"""Beyond its limits that a joint may read [rad]."""
_EDGE = 0.01
"""Beyond a turn that angles which wrap may reach by rounding [rad]."""
_PAUSE = 20.0
"""Usual steps of time after which nothing is known of the turn."""


def counted_on(
    angle: np.ndarray, seconds: np.ndarray, velocity: np.ndarray | None = None,
    limits: tuple[float, float] = (-math.inf, math.inf),
) -> np.ndarray:  # fmt: skip
    """Return angles of a joint less the whole turns that are not its motion, (n,) [rad].

    Args:
        angle: (n,) [rad], NaN where it is missing.
        seconds: (n,) [s].
        velocity: (n,) [rad/s]; None if it is not known.
        limits: that the result shall keep [rad]. Without, what wraps begins in [-pi, pi).
    """
    rows = np.flatnonzero(np.isfinite(angle))
    if len(rows) < 2 or np.ptp(angle[rows]) > TURN + _EDGE:
        return angle
    turns, ends = _wraps(angle[rows], seconds[rows], None if velocity is None else velocity[rows])
    if turns is None:
        return angle
    found = angle.copy()
    for part in np.split(np.arange(len(rows)), ends):
        counts = np.concatenate([[0.0], np.cumsum(turns[part[:-1]])])
        inside = angle[rows[part]] - TURN * counts
        shift = _shift(inside, limits, has_wraps=bool(counts.any()))
        if shift is None:
            return angle
        found[rows[part]] = inside + shift
    return found


def has_wraps(angle: np.ndarray) -> bool:
    """Return whether an angle (n,) [rad] steps by more than half a turn."""
    finite = angle[np.isfinite(angle)]
    return bool((np.abs(np.diff(finite)) > 0.5 * TURN).any())


def _wraps(
    angle: np.ndarray, seconds: np.ndarray, velocity: np.ndarray | None
) -> tuple[np.ndarray | None, np.ndarray]:
    """Return the turns of each step (n - 1,), None where one is no wrap, and the ends of parts."""
    step, passed = np.diff(angle), np.diff(seconds)
    usual = float(np.median(passed[passed > 0.0])) if (passed > 0.0).any() else 1.0
    is_pause = (passed <= 0.0) | (passed > _PAUSE * usual)
    passed = np.where(is_pause, usual, passed)
    turns = np.where(is_pause, 0.0, np.round(step / TURN))
    inside = np.where(is_pause, 0.0, step - TURN * turns)
    padded = np.pad(inside / passed, 1, mode='edge')
    expected = [0.5 * (padded[:-2] + padded[2:]) * passed]
    if velocity is not None:
        expected.append(0.5 * (velocity[1:] + velocity[:-1]) * passed)
    miss = np.fmin.reduce([np.abs(inside - x) for x in expected])
    ends = np.flatnonzero(is_pause) + 1
    return (None if (miss[turns != 0.0] > _MISS).any() else turns), ends


def _shift(angle: np.ndarray, limits: tuple[float, float], *, has_wraps: bool) -> float | None:
    """Return the turns to add [rad], None where no number of them leads within the limits."""
    lower, upper = limits
    if not (math.isfinite(lower) and math.isfinite(upper)):
        return -TURN * math.floor(angle[0] / TURN + 0.5) if has_wraps else 0.0
    low, high = float(angle.min()), float(angle.max())
    nearest = TURN * round((lower + upper - low - high) / (2.0 * TURN))
    for shift in (0.0, nearest):
        if lower - MARGIN <= low + shift and high + shift <= upper + MARGIN:
            return shift
    return None
