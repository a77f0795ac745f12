"""A monitor of one joint: its errors lie outside their interval for longer than chance allows.

A collision, a payload taken up or a bearing that seizes shows as errors that stay outside the
calibrated 95 % interval. Single errors leave it all the time, one in twenty, and those of
neighbouring, overlapping windows leave it together. So an excursion alarms only when it lasts
longer than those of an undisturbed robot do: at the length that they reach `per_hour` times an
hour. The interval is held as it was when an excursion began; the calibration would else widen it
until the collision lies inside.

Lengths are not geometric. An excursion that has lasted is likely to go on: it began where the
interval was narrow by chance, or where the motion makes errors large. So the monitor counts how
many excursions reached each length. Beyond the lengths that enough of them reached, the share that
goes on is taken to stay the same (a tail over a threshold, Pickands 1975).

What alarms is a fault or chance. Up to twice the accepted rate it is counted as chance, with a
length that is censored at the alarm (Kaplan and Meier 1958); what goes beyond is left out. Without
the former the tail would always seem to end at the alarm; with the latter the monitor would get
used to collisions.
"""

from __future__ import annotations

import math

from sgp_ros.gp.scores import INTERVAL_95

_HOUR_NS = 3.6e12
_LEAST_HOURS = 1e-3
_ENOUGH = 20
"""Excursions that must have reached a length for it to be a threshold of the tail."""
_PRIOR_GONE_ON, _PRIOR_AT_RISK = 3.0, 4.0
_COUNTED = 2.0
"""Alarms are counted as chance up to this multiple of the accepted rate."""
_LEAST_ERRORS = 2
_LONGEST_STEP_NS = 1_000_000_000


class ExcursionMonitor:
    """Follows the errors of one joint; memory O(longest excursion).

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
        self._reached, self._cut = [0, 0, 0], [0, 0, 0]
        self._counted = 0

    @property
    def needed(self) -> int:
        """Errors in a row outside the interval at which an excursion alarms."""
        reached, cut, accepted = self._reached, self._cut, self._accepted
        length, expected = 1, float(reached[1])
        while expected + 1.0 > accepted and reached[length + 1] >= _ENOUGH:
            expected *= reached[length + 1] / (reached[length] - cut[length])
            length += 1
        gone_on = sum(reached[length + 1 :])
        at_risk = reached[length] + gone_on - sum(cut[length:])
        share = (gone_on + _PRIOR_GONE_ON) / (at_risk + _PRIOR_AT_RISK)
        excess = math.log(max((expected + 1.0) / accepted, 1.0)) / -math.log(share)
        return max(length + math.ceil(excess), _LEAST_ERRORS)

    @property
    def _accepted(self) -> float:
        """Number of alarms by chance that are accepted in the time watched."""
        return self._per_hour * max(self._watched_ns / _HOUR_NS, _LEAST_HOURS)

    def add(self, stamp_ns: int, error: float, variance: float, raw: float) -> bool:
        """Take an error with its calibrated variance and the model's own, both > 0.

        Returns:
            Whether the alarm has begun or ended.
        """
        step_ns = 0 if self._last_ns is None else stamp_ns - self._last_ns
        was_alarmed = self.is_alarmed
        if not 0 <= step_ns <= _LONGEST_STEP_NS:  # another segment of the stream
            self._outside, self.is_alarmed, step_ns = 0, False, 0
        self._last_ns = stamp_ns
        if not self._outside:
            self._widening = variance / raw
        self.ratio = abs(error) / (INTERVAL_95 * math.sqrt(raw * self._widening))
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
            if self._counted >= _COUNTED * self._accepted:
                for length in range(1, self._outside):
                    self._reached[length] -= 1
                return
            self._counted += 1
            self._cut[self._outside] += 1
        self._reached[self._outside] += 1
        if self._outside + 2 > len(self._reached):
            self._reached.append(0)
            self._cut.append(0)
