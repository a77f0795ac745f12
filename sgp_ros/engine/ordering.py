"""The order of events: by stamp, within a window of time or over a whole recording."""

from __future__ import annotations

import heapq
from collections.abc import Iterable

from sgp_ros.engine.samples import CommandSample, Event, JointSample

_RANKS = {CommandSample: 0, JointSample: 1}
_LAST_RANK = 2
MOST_HELD = 20_000
"""Events that wait for their order at most; beyond, the oldest leaves early."""


class ReorderBuffer:
    """Holds events until nothing older is expected.

    At equal stamps commands come first (a command holds from its own stamp on), then states, then
    changes (in force after the state of the same stamp). Events of equal rank keep the order of
    their arrival.

    Attributes:
        window_ns: an event leaves when the newest stamp is this far ahead [ns].
        released_ns: stamp of the last event that left; None before the first.
        released_rank: its place among events of equal stamp.
        newest_ns: newest stamp so far; None before the first.
    """

    def __init__(self, window_ns: int) -> None:
        self.window_ns = window_ns
        self.released_ns: int | None = None
        self.released_rank = 0
        self._heap: list[tuple[int, int, int, Event]] = []
        self._arrivals = 0
        self.newest_ns: int | None = None

    def is_late(self, event: Event) -> bool:
        """Whether something that belongs after `event` has already left."""
        if self.released_ns is None or event.stamp_ns > self.released_ns:
            return False
        return (event.stamp_ns, _rank(event)) < (self.released_ns, self.released_rank)

    def seal(self) -> None:
        """Let nothing more of the last stamp in: a change was made after it."""
        self.released_rank = _LAST_RANK

    def push(self, event: Event) -> list[Event]:
        """Take an event that is not late and return those that leave, in order. O(log n)."""
        self._hold(event)
        if self.newest_ns is None or event.stamp_ns > self.newest_ns:
            self.newest_ns = event.stamp_ns
        released = self._release(self.newest_ns - self.window_ns)
        while len(self._heap) > MOST_HELD:  # a clock that stands still, or a flood
            released.append(self._pop())
        return released

    def flush(self) -> list[Event]:
        """Return everything that is held, in order."""
        return [] if self.newest_ns is None else self._release(self.newest_ns)

    @property
    def pending(self) -> list[Event]:
        """The events that are held, in the order of their arrival."""
        return [entry[3] for entry in sorted(self._heap, key=lambda entry: entry[2])]

    def resume(
        self,
        released: tuple[int, int] | None,
        newest_ns: int | None,
        pending: list[Event],
    ) -> None:
        """Continue where another buffer stood.

        Args:
            released: stamp [ns] and rank of the last event that left.
            newest_ns: newest stamp so far [ns].
            pending: the held events in the order of arrival.
        """
        if released is not None:
            self.released_ns, self.released_rank = released
        self.newest_ns = newest_ns
        for event in pending:
            self._hold(event)

    def _hold(self, event: Event) -> None:
        self._arrivals += 1
        heapq.heappush(self._heap, (event.stamp_ns, _rank(event), self._arrivals, event))

    def _release(self, until_ns: int) -> list[Event]:
        released: list[Event] = []
        heap = self._heap
        while heap and heap[0][0] <= until_ns:
            released.append(self._pop())
        return released

    def _pop(self) -> Event:
        self.released_ns, self.released_rank, _, event = heapq.heappop(self._heap)
        return event


def in_order(events: Iterable[Event]) -> list[Event]:
    """Return a whole recording in the order in which a `ReorderBuffer` would release it."""
    return sorted(events, key=lambda event: (event.stamp_ns, _rank(event)))


def _rank(event: Event) -> int:
    return _RANKS.get(type(event), _LAST_RANK)
