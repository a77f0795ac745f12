"""Makes a step of the fold whole or nothing, whatever fails in it.

What a bad event can cause is refused before anything changes. What only a bug can cause may strike
half-way, with some of the state already new. The fold is deterministic, so its state is undone by
folding anew: from a copy of the state made now and then, over the actions since, without the one
that failed. A copy costs as much as a few steps and is made once in hundreds of them.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from sgp_ros.engine.samples import Event

COPY_LEARNED, COPY_EVENTS = 500, 10_000
"""Learned samples, and events, after which the state is copied again."""


@dataclass(frozen=True, slots=True)
class Failure:
    """An event that only a bug can have kept from taking effect; the state knows nothing of it.

    Attributes:
        event: the one that failed; None at the end of the stream.
        error: that it raised.
    """

    event: Event | None
    error: Exception

    def __str__(self) -> str:
        """Return one line for a log."""
        kind = type(self.event).__name__ if self.event else 'the end of the stream'
        stamp = f' of {self.event.stamp_ns} ns' if self.event else ''
        text = ' '.join(f'{type(self.error).__name__}: {self.error}'.split())
        return f'{kind}{stamp} refused after an internal error ({text})'


class Journal:
    """Log of the changes to a state since its last copy.

    Args:
        state: attributes of the object that is kept; changed in place when undone.
        unchanging: returns values in it that never change, which no copy needs to hold again.
        take: what is done to the state for an event.
    """

    def __init__(
        self,
        state: dict[str, Any],
        unchanging: Callable[[], Iterable[object]],
        take: Callable[[Event], object],
    ) -> None:
        self._state = state
        self._unchanging = unchanging
        self._take = take
        self._copy: dict[str, Any] | None = None
        self._done: list[Event | tuple[Callable[[Any], object], Any]] = []
        self._learned = 0

    def begin(self, learned: int) -> None:
        """Copy the state where that is due.

        Args:
            learned: samples so far.
        """
        if (
            self._copy is None
            or len(self._done) >= COPY_EVENTS
            or learned >= self._learned + COPY_LEARNED
        ):
            shared = {id(value): value for value in (self, *self._unchanging())}
            self._copy = copy.deepcopy(self._state, shared)
            self._done = []
            self._learned = learned

    def note(self, event: Event) -> None:
        """Remember an event that was taken."""
        self._done.append(event)

    def do(self, action: Callable[[Any], Any], argument: Any) -> Any:
        """Call and remember another action on the state, a function of its argument."""
        result = action(argument)
        self._done.append((action, argument))
        return result

    def undo(self) -> None:
        """Bring the state to where it was after what was done last."""
        assert self._copy is not None
        self._state.clear()
        self._state.update(self._copy)
        self._copy = None
        for done in self._done:
            if isinstance(done, tuple):
                done[0](done[1])
            else:
                self._take(done)

    def forget(self) -> None:
        """Copy the state anew before the next step: it was changed otherwise."""
        self._copy = None
