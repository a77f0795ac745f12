"""Recordings as the events of the engine.

`open_recording` takes an MCAP file, a rosbag2 directory or a ROS 1 bag and tells by the content
which it is. `Recording.events` yields what a node would have consumed, in the order of log time.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path
from typing import TypeVar, cast

from sgp_ros.engine.samples import CommandSample, Event, JointSample, Reset, SettingsChange
from sgp_ros.errors import MessageError, RecordingError
from sgp_ros.recordings.bag_directory import read_directory
from sgp_ros.recordings.command_types import COMMAND_TYPES
from sgp_ros.recordings.mcap_records import MAGIC
from sgp_ros.recordings.mcap_source import McapSource
from sgp_ros.recordings.messages import (
    TEXT,
    Message,
    change_from_text,
    joint_sample,
    require_stamp,
)
from sgp_ros.recordings.ros1_source import Ros1Source
from sgp_ros.recordings.sqlite_source import SqliteSource
from sgp_ros.recordings.topics import (
    CHANGES_TOPIC,
    Source,
    Topic,
    choose_command,
    choose_joint_states,
)
from sgp_ros.recordings.typestore import decoder
from sgp_ros.strangers import readable, require_file

_TABLES = ('.csv', '.npz', '.mat', '.parquet', '.h5', '.json', '.jsonl')
_WRONG = (
    struct.error,
    ValueError,
    IndexError,
    OverflowError,
    AttributeError,
    TypeError,
    MemoryError,
    RecursionError,
)
"""Exceptions from decoding a damaged message, beside `MessageError`."""
_HOPELESS, _MOST, _LONGEST = 20_000, 0.9, 200
"""Unreadable messages, and their share, beyond which no more are tried; length of a reason."""
_KINDS = 'an .mcap file, a rosbag2 directory or a ROS 1 .bag'
_T = TypeVar('_T')
_E = TypeVar('_E', JointSample, CommandSample)
_Convert = Callable[[Message, int], Event]


class Recording:
    """One recording, opened by `open_recording`.

    Attributes:
        path: where it lies.
        topics: its topics with type and number of messages.
    """

    def __init__(self, path: Path, source: Source, remarks: tuple[str, ...]) -> None:
        self._source = source
        self.path = path
        self.topics = source.topics
        self._remarks = remarks
        self._missing: dict[str, str] = {}
        self._skipped: dict[str, Counter[str]] = {}

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences for the user: what was recovered of the file, what the last passes missed.

        They are complete once the topics that are wanted have been read to their ends.
        """
        skipped = [
            f'{count} messages of {self.path.name} could not be read: {why}'
            for why, count in self.unreadable.items()
        ]
        return (*self._remarks, *self._source.remarks, *self._missing.values(), *skipped)

    @property
    def unreadable(self) -> Counter[str]:
        """Number of messages that the last pass over each topic skipped, by "topic: reason"."""
        return sum(self._skipped.values(), Counter())

    def events(
        self,
        joint_states: str | None = None,
        command: str | None = None,
        changes: str = CHANGES_TOPIC,
    ) -> Iterator[Event]:
        """Return the events in the order of log time; equal times keep the order of the file.

        Args:
            joint_states: topic of the joint states; None chooses, see `choose_joint_states`.
            command: topic of the commands, `none` for no commands; None chooses, see
                `choose_command`.
            changes: topic of the changes of settings that a node recorded; empty for none.

        Raises:
            RecordingError: a topic is missing, of a wrong type, or ambiguous; or, at the end, not
                one message could be read.
        """
        states = choose_joint_states(self.topics, joint_states)
        chosen: dict[str, tuple[Topic, _Convert]] = {}
        commands = choose_command(self.topics, states, command)
        if commands:
            chosen[commands.name] = commands, _stamped(COMMAND_TYPES[commands.type].decode)
        for topic in self.topics:
            if topic.name == changes and topic.type == TEXT:
                chosen[topic.name] = topic, _change
        chosen[states.name] = states, _stamped(joint_sample)
        return self._convert(chosen)

    def joint_samples(self, name: str) -> Iterator[JointSample]:
        """Yield the messages of one topic of joint states, in the order of log time.

        Raises:
            RecordingError: no such topic, or not one message of it could be read.
        """
        yield from self._convert({name: (self._topic(name), _stamped(joint_sample))})

    def messages(self, name: str) -> Iterator[tuple[int, Message]]:
        """Yield log time [ns] and message of one topic, in the order of log time.

        Raises:
            RecordingError: no such topic, or not one message of it could be read.
        """
        yield from self._convert({name: (self._topic(name), lambda message, ns: (ns, message))})

    def _topic(self, name: str) -> Topic:
        for topic in self.topics:
            if topic.name == name:
                return topic
        found = [topic.name for topic in self.topics]
        raise RecordingError(f'{self.path} has the topics {found}', f'topic {name}')

    def _convert(
        self, chosen: Mapping[str, tuple[Topic, Callable[[Message, int], _T]]]
    ) -> Iterator[_T]:
        """Yield what messages become; those that become nothing are counted and skipped."""
        self._skipped |= {name: Counter() for name in chosen}
        decoders = {
            name: decoder(topic.type, topic.encoding) for name, (topic, _) in chosen.items()
        }
        found, wrong = Counter[str](), 0
        topics = [topic for topic, _ in chosen.values()]
        with readable(self.path, RecordingError, _KINDS):
            for log_ns, name, data in self._source.messages(topics):
                found[name] += 1
                try:
                    event = chosen[name][1](decoders[name](data), log_ns)
                except (MessageError, *_WRONG) as error:
                    reason = (
                        error.found if isinstance(error, MessageError) else type(error).__name__
                    )
                    self._skipped[name][f'{name}: {reason[:_LONGEST]}'] += 1
                    wrong += 1
                    if wrong > _HOPELESS and wrong > _MOST * found.total():
                        raise self._hopeless(wrong, found.total()) from None
                else:
                    yield event
        if wrong and wrong == found.total():
            raise self._hopeless(wrong, wrong)
        self._compare(topics, found)

    def _hopeless(self, wrong: int, found: int) -> RecordingError:
        reason, _ = self.unreadable.most_common(1)[0]
        return RecordingError(
            f'{self.path}: {wrong} of the first {found} messages cannot be read ({reason})',
            'an intact recording',
        )

    def _compare(self, topics: Collection[Topic], found: Counter[str]) -> None:
        """Say where the file holds another number of messages than it says it does."""
        missing = {
            topic.name: f'{topic.name}: only {found[topic.name]} of {topic.count} messages read'
            for topic in topics
            if topic.count is not None and found[topic.name] != topic.count
        }
        read = {topic.name for topic in topics}
        self._missing = {n: x for n, x in self._missing.items() if n not in read} | missing
        if missing and not found.total():
            raise RecordingError(
                f'{self.path}: {"; ".join((*missing.values(), *self._source.remarks))}',
                'an intact recording',
            )


def open_recording(path: str | Path) -> Recording:
    """Open a recording.

    Args:
        path: an MCAP file, a rosbag2 directory (MCAP or SQLite3, split or not, with or without
            `metadata.yaml`) or a ROS 1 bag.

    Raises:
        RecordingError: nothing there, something else, or a recording without messages.
    """
    path = Path(path)
    if not path.exists():
        raise RecordingError(f'no recording at {path}', _KINDS, 'check the path')
    with readable(path, RecordingError, _KINDS):
        source, remarks = read_directory(path) if path.is_dir() else (_file_source(path), ())
    if not any(topic.count for topic in source.topics):
        why = ''.join(f' ({remark})' for remark in (*remarks, *source.remarks))
        raise RecordingError(f'{path} contains no messages{why}', 'a recording with joint states')
    return Recording(path, source, remarks)


def _file_source(path: Path) -> Source:
    require_file(path)
    with path.open('rb') as stream:
        head = stream.read(16)
    if not head:
        raise RecordingError(f'{path} is empty', _KINDS, 'was the recorder stopped properly?')
    if head.startswith(MAGIC[: len(head)]):
        return McapSource([path])
    if head.startswith(b'SQLite format 3'):
        return SqliteSource([path])
    if head.startswith(b'#ROSBAG V2'):
        return Ros1Source(path)
    remedy = f'convert the table first: sgp import {path}' if path.suffix in _TABLES else ''
    raise RecordingError(
        f'{path} is not a recording (it starts with {head[:8]!r})', _KINDS, remedy
    )


def _stamped(convert: Callable[[Message, int], _E]) -> Callable[[Message, int], _E]:
    """Return a conversion that refuses stamps that no clock has."""

    def converted(message: Message, receipt_ns: int) -> _E:
        event = convert(message, receipt_ns)
        require_stamp(event.stamp_ns)
        return event

    return converted


def _change(message: Message, _receipt_ns: int) -> SettingsChange | Reset:
    return change_from_text(cast('str', message.data))
