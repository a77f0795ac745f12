"""Choose the topics of a recording that the engine is fed from."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from sgp_ros.errors import RecordingError
from sgp_ros.recordings.command_types import COMMAND_TYPES, NO_COMMAND
from sgp_ros.recordings.messages import JOINT_STATE

CHANGES_TOPIC = '/sgp/changes'
"""Where a record keeps the changes of settings."""

GAINS_TOPIC = '/gains'
"""Where gains that change with time are: JointState with kp as position and kd as velocity."""

_OWN_OUTPUTS = (
    'predicted_joint_states', 'prediction', 'prediction_variance', 'prediction_raw_variance',
    'gains',
)  # fmt: skip
_COMMAND_NAMES = ('command', 'commands')


@dataclass(frozen=True, slots=True)
class Topic:
    """One topic of a recording.

    Attributes:
        name: full name, such as `/joint_states`.
        type: message type without its `msg` part, such as `sensor_msgs/JointState`.
        count: number of messages.
        encoding: how the messages are serialised, `cdr` (ROS 2) or `ros1`.
    """

    name: str
    type: str
    count: int
    encoding: str = 'cdr'

    @property
    def last_name(self) -> str:
        """Part of the name after the last slash."""
        return self.name.rsplit('/', 1)[-1]


def merged_topics(
    counts: Iterable[tuple[tuple[str, str, str], int]],
) -> tuple[tuple[Topic, ...], tuple[str, ...]]:
    """Return the topics by name, each with the type that most messages have, and remarks.

    Args:
        counts: name, type and encoding, with a number of messages; they may repeat.
    """
    total: dict[tuple[str, str, str], int] = {}
    for key, count in counts:
        total[key] = total.get(key, 0) + count
    found: dict[str, Topic] = {}
    for (name, kind, encoding), count in total.items():
        if name not in found or count > found[name].count:
            found[name] = Topic(name, kind, count, encoding)
    remarks = [
        f'{name}: {count} messages of type {kind or "none"} ({encoding or "no encoding"}) are '
        f'not read, beside {found[name].count} of type {found[name].type or "none"}'
        for (name, kind, encoding), count in total.items()
        if count and (kind, encoding) != (found[name].type, found[name].encoding)
    ]
    return tuple(found[name] for name in sorted(found)), tuple(remarks)


class RawMessage(NamedTuple):
    """One message as it was recorded.

    Attributes:
        log_ns: time of logging [ns].
        topic: name of its topic.
        data: serialised message.
    """

    log_ns: int
    topic: str
    data: bytes


class Source(Protocol):
    """Topics and raw messages of a recording, whatever its format."""

    @property
    def topics(self) -> tuple[Topic, ...]:
        """All topics."""

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks for the user on its state."""

    def messages(self, topics: Collection[Topic]) -> Iterator[RawMessage]:
        """Yield the messages of `topics` by log time."""


def choose_joint_states(topics: Sequence[Topic], wanted: str | None) -> Topic:
    """Return the topic of the joint states.

    Args:
        topics: all topics of the recording.
        wanted: its name; None chooses the only one, or the one called `joint_states`. What
            `sgp_ros` itself publishes and topics called `command(s)` are never chosen.

    Raises:
        RecordingError: there is none, or several are equally likely.
    """
    if wanted is not None:
        return _named(topics, wanted, (JOINT_STATE,), '--joint-states')
    candidates = [
        topic
        for topic in topics
        if topic.type == JOINT_STATE and topic.last_name not in _OWN_OUTPUTS + _COMMAND_NAMES
    ]
    if not candidates:
        raise RecordingError(
            f'no {JOINT_STATE} topic with measured joints among {_listing(topics)}',
            'a topic with the measured joint states',
            'record /joint_states, or name the topic with --joint-states TOPIC',
        )
    likely = [topic for topic in candidates if topic.last_name == 'joint_states']
    return _only(candidates, likely, '/joint_states', '--joint-states')


def choose_command(topics: Sequence[Topic], states: Topic, wanted: str | None) -> Topic | None:
    """Return the topic of the commands, None where the effort comes in the joint states.

    Args:
        topics: all topics of the recording.
        states: the topic of the joint states.
        wanted: its name, or `none`. None chooses the one called `command` or `commands`, else the
            only topic of a type without joint names, else the only one of no JointState.

    Raises:
        RecordingError: the named one does not exist, or several are equally likely.
    """
    if wanted == NO_COMMAND:
        return None
    if wanted is not None:
        return _named(topics, wanted, tuple(COMMAND_TYPES), '--command')
    candidates = [
        topic
        for topic in topics
        if topic.type in COMMAND_TYPES and topic != states and topic.last_name not in _OWN_OUTPUTS
    ]
    likely = [topic for topic in candidates if topic.last_name in _COMMAND_NAMES]
    if likely:
        return _only(likely, likely, '/command', '--command')
    plain = [topic for topic in candidates if not COMMAND_TYPES[topic.type].has_names]
    for group in (plain, [topic for topic in candidates if topic.type != JOINT_STATE]):
        if len(group) == 1:
            return group[0]
    return None


def _only(candidates: list[Topic], likely: list[Topic], preferred: str, option: str) -> Topic:
    for group in (candidates, likely, [t for t in likely if t.name == preferred]):
        if len(group) == 1:
            return group[0]
    raise RecordingError(
        f'several possible topics: {_listing(likely or candidates)}',
        'one topic',
        f'name it with {option} TOPIC',
    )


def _named(topics: Sequence[Topic], name: str, types: tuple[str, ...], option: str) -> Topic:
    found = [topic for topic in topics if topic.name.lstrip('/') == name.lstrip('/')]
    if not found:
        raise RecordingError(f'no topic {name} ({option})', f'one of {_listing(topics)}')
    if found[0].type not in types:
        raise RecordingError(
            f'topic {name} ({option}) has the type {found[0].type}', ' or '.join(types)
        )
    return found[0]


def _listing(topics: Sequence[Topic]) -> str:
    return ', '.join(f'{topic.name} ({topic.type})' for topic in topics) or 'no topics at all'
