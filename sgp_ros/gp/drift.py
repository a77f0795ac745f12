"""Tells from the errors of one-step predictions that a robot is no longer the one it was.

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

from scipy import special

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
