"""Intervals that hold their rate in the long run, whatever the errors do.

A model says how uncertain it is under its own assumptions: white noise of one variance, the right
equation. Errors of a real robot are coloured, their size changes with the motion, and some of them
are physics that is missing. So the predicted variance is multiplied by a factor that the errors
themselves set, in two parts:

* the local spread, a mean of squared errors over their predicted variances that fades within
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
RATE = 0.3
"""Gain of the integrator: with it, a width wrong by e costs 3 % of coverage in 100 samples."""
_LARGEST_LOG_WIDTH = math.log(100.0)
_LARGEST_ERROR = 10.0
_LEAST_SPREAD = 1e-12


@dataclass(slots=True)
class IntervalScale:
    """Factor on the predicted variance of one quantity; O(1) memory and time.

    Attributes:
        n: errors seen.
        spread: local mean of squared errors over predicted variances; 1 before any.
        log_width: of the integrator, natural logarithm of a factor on the half width.
    """

    n: int = 0
    spread: float = 1.0
    log_width: float = 0.0

    @property
    def factor(self) -> float:
        """Factor on the next predicted variance: 95 % lie within `INTERVAL_95` of its root."""
        return self.spread * math.exp(2.0 * self.log_width)

    def add(self, error: float) -> None:
        """Take one error over its predicted standard deviation, after it was predicted.

        One error counts for no more than `_LARGEST_ERROR` of the deviations now expected: a
        single outlier must not leave the interval wide for long.
        """
        factor = self.factor
        width = self.log_width + RATE * ((error * error > INTERVAL_95**2 * factor) - RISK)
        self.log_width = min(max(width, -_LARGEST_LOG_WIDTH), _LARGEST_LOG_WIDTH)
        self.n += 1
        square = min(error * error, _LARGEST_ERROR**2 * factor)
        self.spread += (square - self.spread) / min(self.n + 1, MEMORY)
        self.spread = max(self.spread, _LEAST_SPREAD)
