"""Tells a clock that jumped from a stamp that is wrong.

A stamp far from all others is either an error of one message or the first of a new time: a looped
recording, a simulator that was reset, a computer whose clock was set. Only what follows can tell.
So such an event waits as a suspect. The next state near the present refuses it; a second state
near it, nearer than to the present, makes it the beginning of a new segment. Commands never tell
the time: their clock may be another computer's, and without states nothing is identified anyway.
"""

from __future__ import annotations

from dataclasses import dataclass

from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.samples import CommandSample, Event, JointSample

END_NS = 2**31 * 10**9
"""First stamp that a ROS message cannot hold [ns]."""
LEAST_JUMP_S = 1.0
"""Least difference of a stamp from the newest that is a jump. A wrong stamp below it is waited for
as long: states in between are late."""
MOST_SUSPECTS = 200


@dataclass(frozen=True, slots=True)
class Verdict:
    """What becomes of an event and of those that waited for it.

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
        suspects: events far from the present that wait for what follows, in order of arrival.

    Args:
        config: settings in force.
    """

    def __init__(self, config: EngineConfig) -> None:
        self.suspects: list[Event] = []
        self.configure(config)

    def configure(self, config: EngineConfig) -> None:
        """Take new settings: a pause or a delay that they permit is no jump."""
        jump_s = max(LEAST_JUMP_S, 2.0 * config.max_gap) + config.reorder_window
        self._jump_ns = round(1e9 * jump_s)

    def agrees(self, stamp_ns: int, newest_ns: int | None) -> bool:
        """Whether a stamp is near the present and nothing waits for a decision, the usual case."""
        if self.suspects:
            return False
        return newest_ns is None or abs(stamp_ns - newest_ns) <= self._jump_ns

    def judge(self, event: Event, newest_ns: int | None) -> Verdict:
        """Return what to do with an event.

        Args:
            event: that arrives.
            newest_ns: newest stamp of those ordered so far; None before the first.
        """
        if newest_ns is None or abs(event.stamp_ns - newest_ns) <= self._jump_ns:
            refused: tuple[Event, ...] = ()
            if self.suspects and isinstance(event, JointSample):
                refused = tuple(self.suspects)
                self.suspects = []
            return Verdict((event,), refused)
        if not isinstance(event, (JointSample, CommandSample)):
            return Verdict(refused=(event,))
        self.suspects.append(event)
        if isinstance(event, JointSample) and self._is_confirmed(event, newest_ns):
            near = [self._is_nearer(other, event, newest_ns) for other in self.suspects]
            found = tuple(e for e, is_near in zip(self.suspects, near, strict=True) if is_near)
            wrong = tuple(e for e, is_near in zip(self.suspects, near, strict=True) if not is_near)
            self.suspects = []
            return Verdict(found, wrong, is_jump=True)
        if len(self.suspects) > MOST_SUSPECTS:
            return Verdict(refused=(self.suspects.pop(0),))
        return Verdict()

    def finish(self, newest_ns: int | None) -> Verdict:
        """Return what becomes of suspects at the end: those ahead had only a pause before them."""
        ahead = tuple(e for e in self.suspects if newest_ns is None or e.stamp_ns > newest_ns)
        behind = tuple(e for e in self.suspects if e not in ahead)
        self.suspects = []
        return Verdict(ahead, behind)

    def _is_confirmed(self, event: JointSample, newest_ns: int) -> bool:
        return any(
            isinstance(other, JointSample) and self._is_nearer(other, event, newest_ns)
            for other in self.suspects[:-1]
        )

    @staticmethod
    def _is_nearer(other: Event, event: Event, newest_ns: int) -> bool:
        """Whether `other` is nearer to `event` than that to the present."""
        return abs(event.stamp_ns - other.stamp_ns) < abs(event.stamp_ns - newest_ns)
