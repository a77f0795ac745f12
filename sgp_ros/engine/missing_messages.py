"""Messages that are missing from a stream, judged by its stamps alone.

A ROS message does not tell how many came before it. So the stamps are held against a schedule of
equal periods that follows them, a phase-locked loop of second order: of a message that is n
periods late, n are missing. One that was only delayed counts as missing too, until the next one,
which then comes a period early, takes it back: jitter is no loss.
"""

from __future__ import annotations

import math
from statistics import median

_WINDOW = 61
"""Spacings whose median tells the rate at first, and whether it has changed."""
_CHANGED = 1.25
"""Ratio of that median to the period, in two windows in a row, of another rate."""
_SURE = 0.65
"""Part of a period by which a message is late from which one is missing."""
_PHASE, _PERIOD = 0.2, 0.003
"""Shares of its error by which the schedule follows a message."""


class MissingMessages:
    """Counts the missing messages of a source.

    Attributes:
        count: messages that are missing; a delay that was taken for a loss is taken back.
        period_ns: of the source, 0 before its second message [ns].
    """

    def __init__(self) -> None:
        self.count = 0
        self.period_ns = 0.0
        self._late = 0.0
        self._spacings: list[int] = []
        self._is_known = self._has_changed = False

    def forget_schedule(self) -> None:
        """Follow anew from the next message on: its source paused, or its clock was set."""
        self._late = 0.0

    def add(self, spacing_ns: int) -> None:
        """Take the time from the newest stamp to that of a message, 0 if it is older [ns]."""
        self._spacings.append(spacing_ns)
        if self._is_known:
            self._follow(spacing_ns)
        else:
            self.period_ns = float(median(self._spacings))
        if len(self._spacings) == _WINDOW:
            self._look_back()

    def _look_back(self) -> None:
        """Begin with the rate of the last messages, or go over to it."""
        spacings, self._spacings = self._spacings, []
        usual = float(median(spacings))
        if not self._is_known:
            self._is_known = True
            single = [spacing for spacing in spacings if spacing < 1.5 * usual]
            self.period_ns = max(sum(single) / max(len(single), 1), 1.0)
            for spacing in spacings:
                self._follow(spacing)
            return
        has_changed = not 1.0 / _CHANGED < usual / self.period_ns < _CHANGED
        if has_changed and self._has_changed and usual > 0.0:
            self.period_ns, self._late = usual, 0.0
        self._has_changed = has_changed

    def _follow(self, spacing_ns: int) -> None:
        """Hold a message against the schedule, and let that follow it."""
        late = self._late + spacing_ns / self.period_ns - 1.0
        whole = math.copysign(math.floor(abs(late) + 1.0 - _SURE), late)
        missing = max(int(whole), -self.count)
        self.count += missing
        error = late - missing
        self.period_ns *= 1.0 + _PERIOD * max(min(error, 0.5), -0.5)
        self._late = (1.0 - _PHASE) * error
