"""A monitor of one joint: its errors lie outside their interval for longer than chance allows.

A collision, a payload taken up or a bearing that seizes shows as errors that stay outside the
calibrated 95 % interval. Single errors leave it all the time, one in twenty, and those of
neighbouring, overlapping windows leave it together. So an excursion alarms only when it lasts
longer than those of an undisturbed robot do: the monitor counts how often excursions begin and how
often they continue, takes their lengths to be geometric, and alarms at the length that one of them
reaches `per_hour` times an hour. The interval is held as it was when an excursion began; the
calibration would else widen it until the collision lies inside. What it alarms at is not counted.
"""

from __future__ import annotations

import math

from sgp_ros.gp.scores import INTERVAL_95

_HOUR_NS = 3.6e12
_PRIOR_CONTINUED, _PRIOR_OUTSIDE = 5.0, 10.0
_PRIOR_BEGUN = 1.0
_LEAST_ERRORS = 2
_LONGEST_STEP_NS = 1_000_000_000


class ExcursionMonitor:
    """Follows the errors of one joint; O(1) memory and time.

    Args:
        least_s: no shorter excursion alarms [s].
        per_hour: false alarms that are accepted an hour, > 0.

    Attributes:
        is_alarmed: whether the present excursion is longer than chance allows.
        alarms: excursions that alarmed so far.
        lasting_s: length of the present excursion [s], 0 inside the interval.
        ratio: the last error over the half width of the interval.
    """

    def __init__(self, least_s: float, per_hour: float) -> None:
        self._least_ns = least_s * 1e9
        self._per_hour = per_hour
        self.is_alarmed = False
        self.alarms = 0
        self.lasting_s = 0.0
        self.ratio = 0.0
        self._last_ns: int | None = None
        self._began_ns = 0
        self._outside = 0
        self._widening = 1.0
        self._watched_ns = 0.0
        self._begun = self._outsides = self._continued = 0

    @property
    def needed(self) -> int:
        """Errors in a row outside the interval at which an excursion alarms."""
        hours = max(self._watched_ns / _HOUR_NS, 1e-3)
        begun_per_hour = (self._begun + _PRIOR_BEGUN) / hours
        share = (self._continued + _PRIOR_CONTINUED) / (self._outsides + _PRIOR_OUTSIDE)
        excess = math.log(max(begun_per_hour / self._per_hour, 1.0)) / -math.log(share)
        return max(1 + math.ceil(excess), _LEAST_ERRORS)

    def add(self, stamp_ns: int, error: float, variance: float, raw: float) -> bool:
        """Take an error with its calibrated variance and the model's own, both > 0.

        Returns:
            Whether the alarm has begun or ended.
        """
        step_ns = 0 if self._last_ns is None else stamp_ns - self._last_ns
        if not 0 <= step_ns <= _LONGEST_STEP_NS:
            self._outside = step_ns = 0  # another segment of the stream
        self._last_ns = stamp_ns
        if not self._outside:
            self._widening = variance / raw
        self.ratio = abs(error) / (INTERVAL_95 * math.sqrt(raw * self._widening))
        was_alarmed = self.is_alarmed
        if self.ratio > 1.0:
            self._go_on(stamp_ns)
        else:
            self._outside, self.lasting_s, self.is_alarmed = 0, 0.0, False
        if not self.is_alarmed:
            self._watched_ns += step_ns
        return self.is_alarmed != was_alarmed

    def _go_on(self, stamp_ns: int) -> None:
        if not self._outside:
            self._began_ns = stamp_ns
        self._outside += 1
        self.lasting_s = (stamp_ns - self._began_ns) * 1e-9
        if self.is_alarmed:
            return
        if stamp_ns - self._began_ns >= self._least_ns and self._outside >= self.needed:
            self.is_alarmed = True
            self.alarms += 1
            self._begun -= 1
            self._outsides -= self._outside - 1
            self._continued -= self._outside - 2
            return
        self._outsides += 1
        if self._outside == 1:
            self._begun += 1
        else:
            self._continued += 1
