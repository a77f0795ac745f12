"""One stream of whole states from the messages of several sources, each with some of the joints.

A robot's joints may come in parts: the arm from one driver, the lift from another, each with its
own stamps and rate. The slowest part sets the times of the whole states, because its joints are
known at no other; the faster parts are interpolated there, by the cubic through both positions and
velocities where velocities are known, else linearly. At equal stamps nothing is interpolated. A
message with all joints passes as it is. Joints that the robot does not have are left out.

Messages that name the same joints are taken for those of one source: ROS does not tell who sent a
message.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterable

import numpy as np

from sgp_ros.engine.missing_messages import MissingMessages
from sgp_ros.engine.samples import JointSample

PAUSE_NS = 1_000_000_000
"""A source that is silent for longer, by the stamps of the others, is waited for no more."""
_LONGEST_STEP_NS = PAUSE_NS // 4
_LONGEST_GAP_NS = 10_000_000_000
"""A longer gap is a pause of the source, and nothing of it is taken for lost."""
_SLOWER = 1.5
_RETURN = 4.0
_LEAST_STEP = 1e-3
_MOST_ORDERS = 100
_MOST_PARTS = 5000
"""Messages of a source that wait for the others at most, whose clock may be another one."""


Part = tuple[int, np.ndarray, np.ndarray, np.ndarray]
"""Stamp [ns], positions, velocities and efforts of the joints of a source; NaN is unknown."""


class Source:
    """Memory of the messages with the same joints.

    Attributes:
        joints: indices of the robot's joints that it brings, increasing.
        owned: those of them that are taken from it, the others come from another source.
        parts: its messages that are still needed, in order of stamps.
        received: messages that came.
        missing: those that did not, by its period.
        pauses: gaps too long for a loss.
        returns: messages after which the joints were nearer to where they were two messages ago
            than to the last: two publishers that say different things of them look like this.
        last_ns: newest stamp [ns]; None before any.
        passed_ns: time that passed by its stamps, jumps of the clock left out [ns].

    Args:
        joints: indices of the robot's joints that it brings.
    """

    def __init__(self, joints: Iterable[int]) -> None:
        self.joints = sorted(joints)
        self.owned: list[int] = []
        self.parts: list[Part] = []
        self.received = self.pauses = self.returns = 0
        self.missing = MissingMessages()
        self.last_ns: int | None = None
        self.passed_ns = 0
        self._is_steady = False
        self._heard: dict[Source, tuple[int, int]] = {}
        self._before: tuple[np.ndarray, ...] = ()

    def note(self, stamp_ns: int) -> None:
        """Follow the stamps: what is missing between two of them was lost on the way."""
        self.received += 1
        spacing = 0 if self.last_ns is None else stamp_ns - self.last_ns
        if self.last_ns is None or spacing > 0 or spacing < -PAUSE_NS:
            self.last_ns = stamp_ns
        self._is_steady = 0 < spacing <= PAUSE_NS
        self.passed_ns += min(max(spacing, 0), _LONGEST_STEP_NS)
        self.pauses += spacing > _LONGEST_GAP_NS
        if -PAUSE_NS <= spacing <= _LONGEST_GAP_NS:
            if spacing:
                self.missing.add(max(spacing, 0))
        else:
            self.missing.forget_schedule()

    def misses(self, other: Source) -> bool:
        """Whether another source has been silent, by its last stamp or without asking for that.

        One stamp alone, of either, may be wrong: then the time counts that passed for this source.
        """
        if self._is_steady and (self.last_ns or 0) - (other.last_ns or 0) > PAUSE_NS:
            return True
        received, since_ns = self._heard.get(other, (-1, 0))
        if received != other.received:
            self._heard[other] = other.received, self.passed_ns
            return False
        return self.passed_ns - since_ns > PAUSE_NS

    def note_return(self, position: np.ndarray) -> None:
        """Look whether the joints jumped back to where they were two messages ago."""
        if len(self._before) == 2:
            back, step = (float(np.abs(position - past).max()) for past in self._before)
            self.returns += step > _LEAST_STEP and step > _RETURN * back
        self._before = (*self._before[-1:], position)

    def at(self, stamp_ns: int) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """Return positions, velocities and efforts of its joints at a time, (m,) each.

        Returns:
            None where it has no message before or at that time, or pauses there; NaN is unknown.
        """
        i = self._first_from(stamp_ns)
        if i < len(self.parts) and self.parts[i][0] == stamp_ns:
            return self.parts[i][1:]
        if not 0 < i < len(self.parts):
            return None
        one, other = self.parts[i - 1], self.parts[i]
        span_ns = other[0] - one[0]
        if span_ns > PAUSE_NS:
            return None
        return _between(one[1:], other[1:], (stamp_ns - one[0]) / span_ns, span_ns * 1e-9)

    def forget_before(self, stamp_ns: int) -> None:
        """Drop what no time from `stamp_ns` on lies beside."""
        del self.parts[: max(self._first_from(stamp_ns) - 1, 0)]

    def _first_from(self, stamp_ns: int) -> int:
        return bisect_left(self.parts, stamp_ns, key=lambda part: part[0])


def _between(
    one: tuple[np.ndarray, ...], other: tuple[np.ndarray, ...], share: float, span_s: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Interpolate positions by the cubic Hermite polynomial, the rest linearly."""
    (q0, v0, e0), (q1, v1, e1) = one, other
    linear = q0 + share * (q1 - q0)
    rise = q1 - q0
    bend = share * (1.0 - share)
    cubic = linear + bend * (
        (1.0 - share) * (v0 * span_s - rise) - share * (v1 * span_s - rise)
    )  # fmt: skip
    position = np.where(np.isnan(cubic), linear, cubic)
    return position, v0 + share * (v1 - v0), e0 + share * (e1 - e0)


class JointMerger:
    """Turns the messages of all sources into states of all joints.

    Args:
        joints: of the robot, in its order.

    Attributes:
        joints: of the robot.
        sources: by the indices of the joints in their messages.
        foreign: messages without a joint of the robot.
        unmatched: states left out because another source paused.
        looks_for_returns: whether to look for two publishers of the same joints.
    """

    def __init__(self, joints: Iterable[str]) -> None:
        self.joints = tuple(joints)
        self._places: dict[tuple[str, ...], tuple[Source, list[int]]] = {}
        self.sources: dict[frozenset[int], Source] = {}
        self.foreign = 0
        self.unmatched = 0
        self.looks_for_returns = False
        self._slowest: Source | None = None
        self._waiting: list[int] = []
        self._done_ns: int | None = None

    @property
    def missing(self) -> tuple[str, ...]:
        """Joints of the robot that no message has named so far."""
        owned = {joint for source in self.sources.values() for joint in source.owned}
        return tuple(name for j, name in enumerate(self.joints) if j not in owned)

    @property
    def shared(self) -> tuple[str, ...]:
        """Joints that several sources bring, or of which one source says two things."""
        found = {j for s in self.sources.values() for j in s.joints if j not in s.owned}
        found |= {
            j for s in self.sources.values() for j in s.owned if 2 * s.returns > s.received > 1
        }
        return tuple(self.joints[j] for j in sorted(found))

    @property
    def lost(self) -> int:
        """Messages missing by the periods of their sources."""
        return sum(source.missing.count for source in self.sources.values())

    def take(self, sample: JointSample) -> list[JointSample]:
        """Take a message and return the whole states that it completes, in order of stamps."""
        source, places = self._places.get(sample.names) or self._find(sample.names)
        if not source.joints:
            self.foreign += 1
            return []
        stamp_ns = sample.stamp_ns
        source.note(stamp_ns)
        if self.looks_for_returns:
            source.note_return(sample.position[places])
        if len(source.owned) < len(source.joints):
            self._inherit(source)
        if len(source.owned) == len(self.joints):
            return [sample]
        if not source.owned:
            return []
        if source.parts and stamp_ns <= source.parts[-1][0]:
            if stamp_ns > source.parts[-1][0] - PAUSE_NS:
                return []  # late or repeated
            self._restart()
        source.parts.append(_part(sample, places))
        if len(source.parts) > _MOST_PARTS:
            del source.parts[: _MOST_PARTS // 2]
        return [] if self.missing else self._complete(source, stamp_ns)

    def _find(self, names: tuple[str, ...]) -> tuple[Source, list[int]]:
        """Return the source of messages with these names, and the places of its joints there."""
        joints = frozenset(j for j, name in enumerate(self.joints) if name in names)
        source = self.sources.get(joints)
        if source is None:
            taken = {joint for other in self.sources.values() for joint in other.owned}
            source = self.sources[joints] = Source(joints)
            source.owned = [joint for joint in source.joints if joint not in taken]
        if len(self._places) >= _MOST_ORDERS:
            self._places = {}
        places = [names.index(self.joints[joint]) for joint in source.joints]
        self._places[names] = source, places
        return source, places

    def _inherit(self, source: Source) -> None:
        """Give a source the joints of others that have been silent."""
        for other in self.sources.values():
            if other is source or not source.misses(other):
                continue
            left = [joint for joint in other.owned if joint in source.joints]
            if left:
                other.owned = [joint for joint in other.owned if joint not in left]
                source.owned = sorted(source.owned + left)
                self._slowest = None
                self._restart()

    def _restart(self) -> None:
        """Forget what waits: a clock was set back, or joints come from elsewhere."""
        for source in self.sources.values():
            source.parts = []
        self._waiting = []
        self._done_ns = None

    def _owners(self) -> list[Source]:
        return [source for source in self.sources.values() if source.owned]

    def _complete(self, source: Source, newest_ns: int) -> list[JointSample]:
        slowest = self._slowest
        if slowest is None or source.missing.period_ns > _SLOWER * slowest.missing.period_ns:
            slowest = self._slowest = max(self._owners(), key=lambda part: part.missing.period_ns)
            done = self._done_ns
            self._waiting = [p[0] for p in slowest.parts if done is None or p[0] > done]
        elif source is slowest:
            self._waiting.append(newest_ns)
        states = []
        while self._waiting and self._is_known(self._waiting[0], newest_ns):
            stamp_ns = self._done_ns = self._waiting.pop(0)
            state = self._state(stamp_ns)
            self.unmatched += state is None
            if state is not None:
                states.append(state)
            for owner in self._owners():
                owner.forget_before(stamp_ns)
        return states

    def _is_known(self, stamp_ns: int, newest_ns: int) -> bool:
        """Whether every source has gone past a time, or pauses."""
        if newest_ns - stamp_ns > PAUSE_NS:
            return True
        return all(owner.parts and owner.parts[-1][0] >= stamp_ns for owner in self._owners())

    def _state(self, stamp_ns: int) -> JointSample | None:
        state = np.full((3, len(self.joints)), math.nan)
        for owner in self._owners():
            found = owner.at(stamp_ns)
            if found is None:
                return None
            chosen = [owner.joints.index(joint) for joint in owner.owned]
            state[:, owner.owned] = [values[chosen] for values in found]
        state.setflags(write=False)
        position, *others = state
        rates = (None if np.isnan(values).all() else values for values in others)
        return JointSample(stamp_ns, self.joints, position, *rates)


def _part(sample: JointSample, places: list[int]) -> Part:
    unknown = np.full(len(places), math.nan)
    rates = (sample.velocity, sample.effort)
    velocity, effort = (unknown if values is None else values[places] for values in rates)
    return sample.stamp_ns, sample.position[places], velocity, effort
