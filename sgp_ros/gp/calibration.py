"""Intervals that hold their rate in the long run, whatever the errors do.

A model states its uncertainty under its own assumptions: white noise of one variance, the right
equation. Errors of a real robot are coloured, their size changes with the motion, and some of them
are physics that is missing. So the errors themselves set the variance, in three parts:

* the reference, the geometric mean of the predicted variance and the mean square of all errors: a
  model knows where it is less certain, and overstates by how much;
* the local spread, a mean of squared errors over the reference that fades within
  `MEMORY` samples: what is large now will be large next, as in volatility models;
* an integrator of misses: the half width grows by `exp(RATE (1 - RISK))` after an error outside
  the interval and shrinks by `exp(-RATE RISK)` after one inside (Gibbs and Candes 2021, equation
  2; on the logarithm of the width, saturated, Angelopoulos, Candes and Tibshirani 2023). After T
  samples the share of misses is within `|change of log width| / (RATE T)` of RISK for any
  sequence of errors: no assumption on their distribution is needed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from sgp_ros.gp.scores import INTERVAL_95

RISK = 0.05
"""Share of errors that may lie outside."""
MEMORY = 10
"""Samples over which the local spread fades: overlapping windows, a stroke, a reversal."""
RATE = 0.2
"""Gain of the integrator: with it, a width wrong by e costs 5 % of coverage in 100 samples."""
_LARGEST_LOG_WIDTH = math.log(100.0)
_LARGEST_ERROR = 10.0
_LEAST_SPREAD = 1e-12


@dataclass(slots=True)
class IntervalScale:
    """Turns predicted variances of one quantity into calibrated ones; O(1) memory and time.

    Attributes:
        n: errors seen.
        mean_square: of all errors, with the first predicted variance as one of them [unit^2].
        spread: local mean of squared errors over the reference variance; 1 before any.
        log_width: of the integrator, natural logarithm of a factor on the half width.
    """

    n: int = 0
    mean_square: float = 0.0
    spread: float = 1.0
    log_width: float = 0.0

    def variance(self, raw: float) -> float:
        """Return the variance with which 95 % of next errors lie within `INTERVAL_95` deviations.

        Args:
            raw: variance that the model predicts, > 0 [unit^2].
        """
        return self._reference(raw) * self.spread * math.exp(2.0 * self.log_width)

    def add(self, error: float, raw: float) -> None:
        """Take one error [unit] after it was predicted with the variance `raw` > 0 [unit^2].

        An error is limited to `_LARGEST_ERROR` of the deviations now expected: a
        single outlier must not leave the interval wide for long.
        """
        reference, variance = self._reference(raw), self.variance(raw)
        width = self.log_width + RATE * ((error * error > INTERVAL_95**2 * variance) - RISK)
        self.log_width = min(max(width, -_LARGEST_LOG_WIDTH), _LARGEST_LOG_WIDTH)
        square = min(error * error, _LARGEST_ERROR**2 * variance)
        if self.n == 0:
            self.mean_square = raw
        self.n += 1
        self.spread += (square / reference - self.spread) / min(self.n + 1, MEMORY)
        self.spread = max(self.spread, _LEAST_SPREAD)
        self.mean_square += (square - self.mean_square) / (self.n + 1)

    def _reference(self, raw: float) -> float:
        """Return the geometric mean of what the model and all errors so far say."""
        return math.sqrt(raw) * math.sqrt(self.mean_square) if self.n else raw
