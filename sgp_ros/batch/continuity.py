"""Where the positions of a recording do not go on: joins of recordings, and turns that wrap.

A joint that is hit changes its speed at once, but not its position: whatever acts on it, its mean
speed from one sample to the next lies between the speeds before and after, as far as the rate
resolves the motion. Where two recordings were joined under stamps that go on, or an encoder lost
its count, one step alone lies far outside of them. It is a jump where it lies further outside than
`LEAST_SPEEDS` times the highest usual speed goes in that time, and more than `LEAST_STEPS` of the
usual steps of a joint that moves, which for a coarse encoder are its counts.

Nor does the motion go on where all drives are off and brakes hold the robot: no effort that is
measured holds it then, and none that is not may be made up.
"""

from __future__ import annotations

import math

import numpy as np

LEAST_SPEEDS = 10.0
"""Of a jump, in units of the highest usual speed [1].

The recordings of real machines show at most 3.1, where a sample was lost and its stamp was not;
joins in drawn worlds show 36 and more.
"""
LEAST_STEPS = 8.0
"""Of a jump, in units of the median step that is not zero [1]. Convention."""
USUAL_SHARE = 0.995
"""Share of the steps that are usual [1]: events that come more often are motion. Convention."""
OFF_SHARE, LEAST_OFF_S, MOST_FALL_S = 0.1, 1.0, 0.5
"""Efforts of drives that are off, of the mean square ones [1]; how long they are off at least, and
how long the robot may move until brakes hold it [s]. Convention."""
_STILL = 1e-3
_REACH = 2
_FEWEST, _FEWEST_UNUSUAL = 16, 2
_TURN = 2.0 * math.pi


def jumps(stamps_ns: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Return after which samples the position of some joint jumps, (m - 1,) of bool.

    Args:
        stamps_ns: (m,) strictly increasing [ns].
        position: (m, k) [rad or m].
    """
    return _jumps(stamps_ns, np.diff(position, axis=0))


def braked(stamps_ns: np.ndarray, position: np.ndarray, effort: np.ndarray) -> np.ndarray:
    """Return which samples brakes hold, or are about to, with all drives off, (m,) of bool.

    A robot that comes to rest by itself moves for longer after its drives go off.

    Args:
        stamps_ns: (m,) strictly increasing [ns].
        position: (m, k) [rad or m].
        effort: (m, k) measured [N m or N], NaN where none is.
    """
    found, seconds = np.zeros(len(stamps_ns), dtype=bool), stamps_ns * 1e-9
    effort = effort[:, np.isfinite(effort).any(axis=0)]
    size = np.sqrt(np.nanmean(effort**2, axis=0))
    if not size.any():
        return found
    is_off = (np.abs(effort) <= OFF_SHARE * size).all(axis=1)
    reach = _STILL * np.ptp(position, axis=0)
    edges = np.flatnonzero(np.diff(np.pad(is_off, 1).astype(np.int8)))
    for first, end in edges.reshape(-1, 2):
        last = position[end - 1]
        still = (np.abs(position[first:end] - last) <= reach).all(axis=1)
        stop = first + (0 if still.all() else int(np.flatnonzero(~still)[-1]) + 1)
        is_held = seconds[end - 1] - seconds[stop] > LEAST_OFF_S if stop < end else False
        if is_held and seconds[stop] - seconds[first] < MOST_FALL_S:
            found[first:end] = True
    return found


def unwrapped(stamps_ns: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Return the positions of joints that turn without limits, counted on where they wrap, (m, k).

    A joint wraps where all its positions lie within one turn and it steps by nearly one, so that
    the step less the turn goes on with the motion. Other steps stay as they are.

    Args:
        stamps_ns: (m,) strictly increasing [ns].
        position: (m, k) [rad].
    """
    found = position.copy()
    for column in found.T:
        step = np.diff(column)
        turns = np.round(step / _TURN)
        if turns.any() and np.ptp(column) <= _TURN:
            inside = (step - _TURN * turns)[:, None]
            turns[_jumps(stamps_ns, inside)] = 0.0
            column[1:] -= _TURN * np.cumsum(turns)
    return found


def _jumps(stamps_ns: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Return which steps (m - 1, k) are jumps, not motion, (m - 1,) of bool."""
    n = len(step)
    if n < _FEWEST:
        return np.zeros(n, dtype=bool)
    seconds = np.diff(stamps_ns) * 1e-9
    # stamps that came late stand close together: their steps took the usual time
    taken = np.maximum(seconds, np.median(seconds))[:, None]
    speed = step / taken
    padded = np.pad(speed, ((_REACH, _REACH), (0, 0)), constant_values=np.nan)
    others = [padded[i : i + n] for i in range(2 * _REACH + 1) if i != _REACH]
    low, high = np.nanmin(others, axis=0), np.nanmax(others, axis=0)
    outside = taken * np.maximum(low - speed, speed - high)
    fastest = min(int(USUAL_SHARE * n), n - 1 - _FEWEST_UNUSUAL)
    usual = taken * np.partition(np.abs(speed), fastest, axis=0)[fastest]
    count = [np.median(x[x > 0.0]) if x.any() else 0.0 for x in np.abs(step).T]
    least = np.maximum(LEAST_SPEEDS * usual, LEAST_STEPS * np.array(count))
    return np.asarray((outside > least).any(axis=1))
