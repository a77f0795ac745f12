"""95 % intervals of means and of ratios of means of values that follow each other in time.

Neighbours in time are not independent. The values are cut into blocks several correlation times
long, and the scatter of the blocks' means gives the standard error (batch means), with Student's
t for the few blocks that there are. The correlation time is that of the initial positive pairs
of autocovariances (Geyer 1992, Practical Markov chain Monte Carlo).
"""

from __future__ import annotations

import math

import numpy as np
from scipy import stats

MOST_BLOCKS, LEAST_BLOCKS = 30, 4
TIMES_A_BLOCK = 4.0
"""Correlation times in a block, at least."""
_LEVEL = 0.975

Interval = tuple[float, float]


def mean_interval(x: np.ndarray) -> Interval | None:
    """Return the 95 % interval of the mean of x (n,); None where x is too short for one."""
    half = _half_width(x)
    return None if half is None else (float(x.mean()) - half, float(x.mean()) + half)


def ratio_interval(x: np.ndarray, y: np.ndarray) -> Interval | None:
    """Return the 95 % interval of `mean(x) / mean(y)` for x, y (n,) that are not negative.

    To first order the ratio r deviates by `mean(x - r y) / mean(y)`; the interval is symmetric
    for `log r`, so it never reaches below zero. None where there is too little, or no ratio.
    """
    if len(x) == 0 or not (x.mean() > 0.0 and y.mean() > 0.0):
        return None
    r = float(x.mean() / y.mean())
    half = _half_width((x - r * y) / x.mean())
    return None if half is None else (r * math.exp(-half), r * math.exp(half))


def correlation_time(x: np.ndarray) -> float:
    """Return how many neighbours of x (n,) tell as much as one independent value, at least 1."""
    n = len(x)
    deviation = x - x.mean()
    power = np.abs(np.fft.rfft(deviation, 2 * n)) ** 2
    covariance = np.fft.irfft(power, 2 * n)[:n]
    if not covariance[0] > 0.0:
        return 1.0
    pairs = covariance[: n - n % 2].reshape(-1, 2).sum(axis=1) / covariance[0]
    negative = np.flatnonzero(pairs <= 0.0)
    initial = pairs[: negative[0]] if len(negative) else pairs
    return max(1.0, 2.0 * float(initial.sum()) - 1.0)


def _half_width(x: np.ndarray) -> float | None:
    """Return half of the 95 % interval of the mean of x (n,)."""
    if len(x) < LEAST_BLOCKS:
        return None
    blocks = min(MOST_BLOCKS, int(len(x) / (TIMES_A_BLOCK * correlation_time(x))))
    if blocks < LEAST_BLOCKS:
        return None
    means = np.array([part.mean() for part in np.array_split(x, blocks)])
    error = float(means.std(ddof=1)) / math.sqrt(blocks)
    return float(stats.t.ppf(_LEVEL, blocks - 1)) * error
