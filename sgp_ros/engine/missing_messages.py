"""Messages that are missing from a stream, judged by its stamps alone.

A ROS message does not tell how many came before it. So the stamps are held against a schedule of
equal periods that follows them, a phase-locked loop of second order: of a message that is n
periods late, n are missing. One that was only delayed counts as missing too, until the next one,
which then comes a period early, takes it back: jitter is no loss.

A driver that missed a measurement may send its last one again under a new stamp. Of a joint that
moves that is a wrong position.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import median

from sgp_ros.engine.samples import JointSample

_WINDOW = 61
"""Spacings whose median tells the rate at first, and whether it has changed."""
_CHANGED = 1.25
"""Ratio of that median to the period, in two windows in a row, of another rate."""
_SURE = 0.65
"""Part of a period by which a message is late from which one is missing."""
_PHASE, _PERIOD = 0.2, 0.003
"""Shares of its error by which the schedule follows a message."""


LONGEST_REPEAT = 0.5
"""For which numbers of moving joints are sent again at most, as a share of `max_gap` [1]."""


class RepeatedNumbers:
    """Finds states that bring no new measurement, but the stamp or the numbers of an earlier one.

    Positions, velocities and efforts that all changed at once, and then are all equal to the last
    bit, are not measured again. A joint that moves less than its encoder resolves changes one
    without the others.
    """

    def __init__(self) -> None:
        self._last: tuple[bytes, bytes, bytes] = (b'', b'', b'')
        self._changed_ns: int | None = None

    def reason(self, sample: JointSample, last_ns: int | None, max_gap: float) -> str:
        """Return why a state, the next one in order, is refused; empty if it is not.

        Args:
            sample: the state.
            last_ns: stamp of the state before it that was used [ns]; None before any.
            max_gap: longest pause that is no gap [s].
        """
        if sample.stamp_ns == last_ns:
            return 'duplicate'
        v, effort = sample.velocity, sample.effort
        now = (sample.position.tobytes(), b'' if v is None else v.tobytes(),
               b'' if effort is None else effort.tobytes())  # fmt: skip
        last, self._last = self._last, now
        if now == last and (v is not None or effort is not None):
            since, longest_s = self._changed_ns, LONGEST_REPEAT * max_gap
            is_short = since is not None and sample.stamp_ns - since < 1e9 * longest_s
            return 'stale' if is_short else ''
        have_changed = b'' != last[0] != now[0] and (
            (v is None or now[1] != last[1]) and (effort is None or now[2] != last[2])
        )
        self._changed_ns = sample.stamp_ns if have_changed else None
        return ''

    def state(self) -> list[str | int | None]:
        """Return what is remembered, for a snapshot."""
        return [*(x.hex() for x in self._last), self._changed_ns]

    def restore(self, state: Sequence[str | int | None]) -> None:
        """Remember what a snapshot tells."""
        *last, changed = state
        position, velocity, effort = (bytes.fromhex(str(x)) for x in last)
        self._last = position, velocity, effort
        self._changed_ns = None if changed is None else int(changed)


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
