"""Tells a clock that jumped from a stamp that is wrong.

A stamp far from all others is either an error of one message or the first of a new time: a looped
recording, a simulator that was reset, a computer whose clock was set. Only what follows can tell.
So such an event stays pending. The next state near the present refuses it; a second state
near it, nearer than to the present, makes it the beginning of a new segment. Commands never tell
the time: their clock may be another computer's, and without states nothing is identified anyway.
A clock that is set back by less is only recognised by states that stay late, one after the other.

A whole recording has no present: its events are sorted, and only a clock that was set back splits
it, see `on_one_clock`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.samples import Event, JointSample

END_NS = 2**31 * 10**9
"""First stamp that a ROS message cannot hold [ns]."""
LEAST_JUMP_S = 1.0
"""Least difference of a stamp from the newest that is a jump. A wrong stamp below it is waited for
as long: states in between are late."""
MOST_PENDING = 200
SHORTEST_ROUND = 16
"""Fewest states between two jumps of a clock on average; else messages only came late. So many
late ones in a row, in the order of their stamps, are of a clock that was set back."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """Decision on an event and on those that waited for it.

    Attributes:
        events: to be ordered now.
        refused: whose stamp is wrong.
        is_jump: whether `events` begin a new segment.
    """

    events: tuple[Event, ...] = ()
    refused: tuple[Event, ...] = ()
    is_jump: bool = False


class StreamClock:
    """Decides of each event whether its stamp belongs to the time of the stream.

    Attributes:
        pending: events far from the present that wait for what follows, in order of arrival.
        behind: how many late states came in a row, and the stamp of the last [ns].

    Args:
        config: settings in force.
    """

    def __init__(self, config: EngineConfig) -> None:
        self.pending: list[Event] = []
        self.behind = (0, 0)
        self.configure(config)

    def configure(self, config: EngineConfig) -> None:
        """Take new settings: a pause or a delay that they permit is not a jump."""
        jump_s = max(LEAST_JUMP_S, 2.0 * config.max_gap) + config.reorder_window
        self._jump_ns, self._late_ns = round(1e9 * jump_s), round(1e9 * config.reorder_window)

    def agrees(self, stamp_ns: int, newest_ns: int | None) -> bool:
        """Whether a stamp is near the present and nothing waits for a decision, the usual case."""
        if self.pending or self.behind[0]:
            return False
        return newest_ns is None or -self._late_ns <= stamp_ns - newest_ns <= self._jump_ns

    def judge(self, event: Event, newest_ns: int | None) -> Verdict:
        """Return what to do with an event.

        Args:
            event: that arrives.
            newest_ns: newest stamp of those ordered so far; None before the first.
        """
        if newest_ns is None or abs(event.stamp_ns - newest_ns) <= self._jump_ns:
            refused: tuple[Event, ...] = ()
            is_jump = False
            if isinstance(event, JointSample):
                refused, self.pending = tuple(self.pending), []
                is_jump = self._stays_behind(event.stamp_ns, newest_ns)
            return Verdict((event,), refused, is_jump)
        self.pending.append(event)
        if isinstance(event, JointSample) and self._is_confirmed(event, newest_ns):
            near = [self._is_nearer(other, event, newest_ns) for other in self.pending]
            found = tuple(e for e, is_near in zip(self.pending, near, strict=True) if is_near)
            wrong = tuple(e for e, is_near in zip(self.pending, near, strict=True) if not is_near)
            self.pending = []
            return Verdict(found, wrong, is_jump=True)
        if len(self.pending) > MOST_PENDING:
            return Verdict(refused=(self.pending.pop(0),))
        return Verdict()

    def _stays_behind(self, stamp_ns: int, newest_ns: int | None) -> bool:
        """Count late states, and return whether enough of them follow each other."""
        if newest_ns is None or stamp_ns >= newest_ns - self._late_ns:
            self.behind = (0, 0)
            return False
        count, last_ns = self.behind
        self.behind = (count + 1 if stamp_ns > last_ns else 1), stamp_ns
        if self.behind[0] < SHORTEST_ROUND:
            return False
        self.behind = (0, 0)
        return True

    def finish(self, newest_ns: int | None) -> Verdict:
        """Return the end of pending events: those ahead had only a pause before them."""
        ahead = tuple(e for e in self.pending if newest_ns is None or e.stamp_ns > newest_ns)
        behind = tuple(e for e in self.pending if e not in ahead)
        self.pending = []
        return Verdict(ahead, behind)

    def _is_confirmed(self, event: JointSample, newest_ns: int) -> bool:
        return any(
            isinstance(other, JointSample) and self._is_nearer(other, event, newest_ns)
            for other in self.pending[:-1]
        )

    @staticmethod
    def _is_nearer(other: Event, event: Event, newest_ns: int) -> bool:
        """Whether `other` is nearer to `event` than that to the present."""
        return abs(event.stamp_ns - other.stamp_ns) < abs(event.stamp_ns - newest_ns)


def on_one_clock(
    events: Sequence[Event], config: EngineConfig
) -> tuple[list[Event], list[Event], int]:
    """Put the rounds of a recording whose clock was set back one after the other.

    A looped bag or a simulator that was reset repeats its stamps: sorted by these, its rounds
    would be mixed. A round ends where an engine begins a new segment. The next one is moved to
    follow it after a pause, in which no command goes on to hold.

    Args:
        events: of a recording, in the order in which they came.
        config: settings of the intake.

    Returns:
        The events, those whose stamps are of no round, and how often the clock was set back.
    """
    states = [event for event in events if isinstance(event, JointSample)]
    rounds, _ = _rounds(states, config)
    if len(rounds) == 1 or len(states) < SHORTEST_ROUND * len(rounds):
        return list(events), [], 0
    rounds, wrong = _rounds(events, config)
    pause_ns = round(1e9 * (LEAST_JUMP_S + max(config.max_gap, config.command_timeout)))
    found, end_ns = list(rounds[0]), max(event.stamp_ns for event in rounds[0])
    for each in rounds[1:]:
        stamps = [event.stamp_ns for event in each]
        shift_ns = end_ns + pause_ns - min(stamps)
        found += [replace(event, stamp_ns=event.stamp_ns + shift_ns) for event in each]
        end_ns = max(stamps) + shift_ns
    return found, wrong, len(rounds) - 1


def _rounds(
    events: Sequence[Event], config: EngineConfig
) -> tuple[list[list[Event]], list[Event]]:
    """Split events where the clock was set back; return the rounds and what belongs to none."""
    clock = StreamClock(config)
    newest_ns: int | None = None
    rounds: list[list[Event]] = [[]]
    wrong: list[Event] = []
    on_time = 0  # events of the round that came before those that stay behind
    for event in (*events, None):
        verdict = clock.finish(newest_ns) if event is None else clock.judge(event, newest_ns)
        wrong += verdict.refused
        if not verdict.events:
            continue
        if verdict.is_jump and newest_ns is not None and verdict.events[0].stamp_ns < newest_ns:
            rounds.append(rounds[-1][on_time:])
            del rounds[-2][on_time:]
            newest_ns = None
        rounds[-1] += verdict.events
        stamps = [e.stamp_ns for e in (rounds[-1] if newest_ns is None else verdict.events)]
        newest_ns = max(stamps if newest_ns is None else [newest_ns, *stamps])
        if clock.behind[0] == 0:
            on_time = len(rounds[-1])
        elif clock.behind[0] == 1 and isinstance(event, JointSample):
            on_time = len(rounds[-1]) - 1
    return rounds, wrong
