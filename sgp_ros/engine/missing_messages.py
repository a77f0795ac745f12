"""Messages that are missing from a stream, judged by its stamps alone.

ROS says of no message how many came before it. What is missing shows in the stamps: more periods
passed than messages came. A message that is only late is no loss: the next ones come early, and
what they are early pays for it. So the periods that passed are balanced against the messages, and
what stays unpaid is counted: at once where the stamps are regular, else after some messages.
A publisher that sleeps between two messages never makes up for a delay: where the stamps are
regular but for that, a gap of no whole number of periods moves the schedule and is no loss.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from statistics import median

_WINDOW = 31
"""Spacings from which the period is estimated; the first are judged once they are complete."""
_KEPT = 0.875
"""Share of the earlier spacings that the mean period remembers from one window to the next."""
_CHANGED, _CHANGED_SURELY, _MOVED = 0.4, 0.1, 0.05
"""Relative changes of the period: to another rate, the same seen surely, to a new balance."""
_NEAR, _CLEAR, _SURE = 0.25, 0.8, 0.95
"""The period shows in single spacings if these shares of them are so near to whole numbers of it:
clearly, or surely."""
_LONG, _PAUSE = 1.5, 2.5
_REGULAR = 0.1
"""Up to this spread of stamps [periods] a loss shows at once."""
_UNPAID = 5
"""Messages that a debt must last where the stamps are less regular."""
_FOLLOW, _FOLLOW_IRREGULAR, _MEMORY = 0.25, 0.15, 0.05
_LEAST, _SPREADS, _WHOLE = 0.05, 4.0, 10.0
"""A gap up to the last of these [periods] is a loss within so many spreads of a whole number."""


class MissingMessages:
    """Balances the time that passes by the stamps of a source against its messages.

    Attributes:
        count: messages that are missing; a delay that was taken for a loss is taken back.
        period_ns: of the source, 0 before its second message [ns].
    """

    def __init__(self) -> None:
        self.count = 0
        self.period_ns = 0.0
        self._spacings: list[int] = []
        self._is_known = self._has_changed = False
        self._elapsed, self._periods, self._paid = 0.0, 0.0, 0.0
        self._variance = _REGULAR**2
        self.forget_schedule()

    def forget_schedule(self) -> None:
        """Balance anew from the next message on: its source paused, or its clock was set."""
        self._debts: deque[float] = deque(maxlen=_UNPAID)
        self._since_gap = self._since_count = 2 * _UNPAID
        self._last_count = 0

    def add(self, spacing_ns: int) -> None:
        """Take the time from the newest stamp to that of a message, 0 if it is older [ns]."""
        if self._is_known:
            self._balance(spacing_ns)
            self._spacings.append(spacing_ns)
            if len(self._spacings) >= _WINDOW:
                self._refine()
        elif spacing_ns > 0:
            self._spacings.append(spacing_ns)
            self.period_ns = float(median(self._spacings))
            if len(self._spacings) == _WINDOW:
                self._begin()

    def _begin(self) -> None:
        first, self._spacings = self._spacings, []
        self._is_known = True
        if _near_whole_numbers(first, self.period_ns) >= _CLEAR:
            self.period_ns = _mean(first, self.period_ns)
        else:
            short = [spacing for spacing in first if spacing < _PAUSE * self.period_ns]
            self.period_ns = sum(short) / len(short)
        for spacing in first:
            self.add(spacing)

    def _refine(self) -> None:
        """Estimate the period from the spacings, and from what the balance knows of them."""
        before, spacings = self.period_ns, self._spacings
        rough = float(median(spacings))
        near = _near_whole_numbers(spacings, rough)
        is_clear, is_sure = near >= _CLEAR, near >= _SURE
        fresh = _mean(spacings, rough) if is_clear else rough
        has_changed = abs(fresh / before - 1.0) > (_CHANGED_SURELY if is_sure else _CHANGED)
        if has_changed and fresh > 0.0 and (is_clear or self._has_changed):
            self._elapsed = self._periods = 0.0
            self.period_ns = fresh
        else:
            periods = sum(_shares(spacings, rough)) if is_clear else len(spacings) + self._paid
            self._elapsed = _KEPT * self._elapsed + sum(spacings)
            self._periods = _KEPT * self._periods + periods
            self.period_ns = self._elapsed / max(self._periods, 1.0)
        self._has_changed = has_changed
        self._spacings, self._paid = [], 0.0
        if abs(self.period_ns / before - 1.0) > _MOVED:
            self.forget_schedule()

    def _balance(self, spacing_ns: int) -> None:
        """Owe the periods that passed, pay one with the message, count what stays unpaid."""
        spacing = spacing_ns / self.period_ns
        debt = (self._debts[-1] if self._debts else 0.0) + spacing - 1.0
        self._debts.append(debt)
        self._since_gap = 0 if spacing > _LONG else self._since_gap + 1
        self._since_count += 1
        spread = math.sqrt(self._variance)
        is_regular = spread < _REGULAR
        owed = round(debt if is_regular else self._unpaid())
        if is_regular and owed > 0 and not _is_loss(debt, spread):
            self._pay(debt)
            return
        if owed < 0:
            self._take_back(-owed)
            self._pay(owed)
        elif owed > 0 and self._since_gap < 2 * _UNPAID:
            self.count += owed
            self._since_count, self._last_count = 0, owed
            self._pay(owed)
        left = self._debts[-1] - round(self._debts[-1])
        self._move(-(_FOLLOW if is_regular else _FOLLOW_IRREGULAR) * left)
        self._variance += _MEMORY * (left**2 - self._variance)

    def _unpaid(self) -> float:
        """Return the debt that the last messages had in common."""
        if len(self._debts) < _UNPAID:
            return 0.0
        return max(min(self._debts), 0.0) + min(max(self._debts), 0.0)

    def _take_back(self, number: int) -> None:
        """Correct what was counted last: messages that are too many soon after came late."""
        if self._since_count < 2 * _UNPAID:
            late = min(number, self._last_count)
            self.count -= late
            self._last_count -= late

    def _pay(self, periods: float) -> None:
        self._paid += periods
        self._move(-periods)

    def _move(self, by: float) -> None:
        for i in range(len(self._debts)):
            self._debts[i] += by


def _shares(spacings: Iterable[int], period_ns: float) -> list[int]:
    """Return the whole number of periods in each spacing."""
    return [round(spacing / period_ns) for spacing in spacings]


def _mean(spacings: list[int], rough_ns: float) -> float:
    return sum(spacings) / max(sum(_shares(spacings, rough_ns)), 1)


def _near_whole_numbers(spacings: list[int], period_ns: float) -> float:
    """Return the share of spacings that are near a whole number of periods."""
    if period_ns <= 0.0:
        return 0.0
    pairs = zip(spacings, _shares(spacings, period_ns), strict=True)
    near = sum(abs(spacing / period_ns - share) < _NEAR for spacing, share in pairs)
    return near / len(spacings)


def _is_loss(debt: float, spread: float) -> bool:
    """Whether a debt is a number of messages, rather than a delay of the publisher."""
    return debt > _WHOLE or abs(debt - round(debt)) <= max(_LEAST, _SPREADS * spread)
