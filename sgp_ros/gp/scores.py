"""Scores of one-step predictions, and a test of their errors for a change of the robot.

Whether a model fits is one question, whether its errors grow is another: a model that never fitted
well does not drift. So each squared error is compared with the mean of those before it. Under an
unchanged robot that ratio has an F distribution whatever the size of the errors, and its
normal score is standard normal and independent of the past (Hawkins 1987). A cumulative sum of the
scores (Page 1954) alarms when they stay above zero. Neighbouring errors of overlapping windows are
correlated; the scores are whitened by the correlation they show.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import special

INTERVAL_95 = float(special.ndtri(0.975))
"""Half width of the central 95 % interval of a standard normal variable."""


def nmse(y: np.ndarray, mean: np.ndarray) -> np.ndarray:
    """Mean squared error over the variance of the target, (k,) for y and mean (n, k)."""
    return np.mean((y - mean) ** 2, axis=0) / np.var(y, axis=0)


def nlpd(y: np.ndarray, mean: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Mean negative log predictive density [nat], (k,) for arrays (n, k)."""
    terms = np.log(2.0 * np.pi * variance) + (y - mean) ** 2 / variance
    return 0.5 * np.mean(terms, axis=0)


def coverage95(y: np.ndarray, mean: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Share of targets inside the central 95 % interval, (k,) for arrays (n, k)."""
    inside = np.abs(y - mean) <= INTERVAL_95 * np.sqrt(variance)
    return np.mean(inside, axis=0)


def pit(y: np.ndarray, mean: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Probability integral transform of each target, (n, k); uniform when calibrated."""
    return special.ndtr((y - mean) / np.sqrt(variance))


@dataclass(slots=True)
class RunningScore:
    """Scores of one channel, one sample at a time, O(1) memory.

    Mean and variance of the target by Welford's recursion (1962).
    """

    n: int = 0
    squared_error: float = 0.0
    log_loss: float = 0.0
    inside: int = 0
    inside_raw: int = 0
    target_mean: float = 0.0
    target_squares: float = 0.0

    def add(self, y: float, mean: float, variance: float, raw_variance: float) -> None:
        """Score one prediction against its target; both variances, calibrated and raw, are > 0."""
        self.n += 1
        error = y - mean
        self.squared_error += error * error
        self.log_loss += 0.5 * (math.log(2.0 * math.pi * variance) + error * error / variance)
        self.inside += abs(error) <= INTERVAL_95 * math.sqrt(variance)
        self.inside_raw += abs(error) <= INTERVAL_95 * math.sqrt(raw_variance)
        step = y - self.target_mean
        self.target_mean += step / self.n
        self.target_squares += step * (y - self.target_mean)

    @property
    def nmse(self) -> float:
        """Mean squared error over the variance of the target; NaN for a constant target."""
        return self.squared_error / self.target_squares if self.target_squares > 0.0 else math.nan

    @property
    def nlpd(self) -> float:
        """Mean negative log predictive density [nat]; NaN without samples."""
        return self.log_loss / self.n if self.n else math.nan

    @property
    def coverage95(self) -> float:
        """Share of targets inside the 95 % interval; NaN without samples."""
        return self.inside / self.n if self.n else math.nan

    @property
    def raw_coverage95(self) -> float:
        """Share of targets inside the 95 % interval of the raw variance; NaN without samples."""
        return self.inside_raw / self.n if self.n else math.nan


SLACK = 0.25
"""Mean score that does not count: half of that of errors with twice the variance."""
SAMPLES_PER_ALARM = 1e6
"""Mean number of samples between two false alarms."""
_WARM_UP = 20
_LARGEST_SCORE = 4.0
_LARGEST_CORRELATION = 0.95


def run_length(threshold: float) -> float:
    """Return the mean number of samples to a false alarm (Siegmund 1985, equation 2.57)."""
    b = 2.0 * SLACK * (threshold + 1.166)
    return (math.exp(b) - 1.0 - b) / (2.0 * SLACK**2)


def _threshold(samples: float) -> float:
    """Return the threshold with this mean run length, by bisection."""
    low, high = 0.0, 100.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if run_length(middle) < samples else (low, middle)
    return low


THRESHOLD = _threshold(SAMPLES_PER_ALARM)


@dataclass(slots=True)
class DriftTest:
    """The test of one channel, one error at a time, O(1) memory.

    Attributes:
        n: errors seen.
        square: mean of their squares; 1 for a calibrated model.
        score: normal score of the last one.
        power, product: sums of squares of the scores, and of products of neighbouring ones.
        cusum: the cumulative sum; it ends at twice the threshold, so that an alarm can end too.
    """

    n: int = 0
    square: float = 0.0
    score: float = 0.0
    power: float = 0.0
    product: float = 0.0
    cusum: float = 0.0

    @property
    def is_drifting(self) -> bool:
        """Whether errors have grown by more than chance makes once in `SAMPLES_PER_ALARM`."""
        return self.level > 1.0

    @property
    def level(self) -> float:
        """Cumulative sum over its threshold: above 1 is an alarm."""
        return self.cusum / THRESHOLD

    def add(self, error: float) -> None:
        """Take one error over its predicted standard deviation."""
        if self.n >= _WARM_UP and self.square > 0.0:
            self._compare(error * error / self.square)
        self.n += 1
        self.square += (error * error - self.square) / self.n

    def _compare(self, ratio: float) -> None:
        score = -float(special.ndtri(special.fdtrc(1.0, self.n, ratio)))
        score = min(max(score, -_LARGEST_SCORE), _LARGEST_SCORE)
        self.power += score * score
        self.product += score * self.score
        correlation = min(max(self.product / self.power, 0.0), _LARGEST_CORRELATION)
        fresh = (score - correlation * self.score) / math.sqrt(1.0 - correlation**2)
        self.cusum = min(max(self.cusum + fresh - SLACK, 0.0), 2.0 * THRESHOLD)
        self.score = score
