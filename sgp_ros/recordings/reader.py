"""Recordings as the events of the engine.

`open_recording` takes an MCAP file, a rosbag2 directory or a ROS 1 bag and tells by the content
which it is. `Recording.events` yields what a node would have consumed, in the order of log time.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import Protocol, cast

import yaml

from sgp_ros.engine.samples import Event, Reset, SettingsChange
from sgp_ros.errors import MessageError, RecordingError
from sgp_ros.recordings.bag_source import RosbagsSource, SqliteSource
from sgp_ros.recordings.command_types import COMMAND_TYPES
from sgp_ros.recordings.mcap_source import MAGIC, McapSource
from sgp_ros.recordings.messages import TEXT, Message, change_from_text, joint_sample
from sgp_ros.recordings.topics import (
    CHANGES_TOPIC,
    RawMessage,
    Topic,
    choose_command,
    choose_joint_states,
)
from sgp_ros.recordings.typestore import decoder

_TABLES = ('.csv', '.npz', '.mat', '.parquet', '.h5', '.json', '.jsonl')
_KINDS = 'an .mcap file, a rosbag2 directory or a ROS 1 .bag'


class Source(Protocol):
    """Topics and raw messages of a recording, whatever its format."""

    @property
    def topics(self) -> tuple[Topic, ...]:
        """All topics."""

    @property
    def remarks(self) -> tuple[str, ...]:
        """What the user should know of its state."""

    def messages(self, topics: Collection[Topic]) -> Iterator[RawMessage]:
        """Yield the messages of `topics` by log time."""


class Recording:
    """One recording, opened by `open_recording`.

    Attributes:
        path: where it lies.
        topics: its topics with type and number of messages.
        remarks: sentences for the user, such as what was recovered of a truncated file.
        unreadable: "topic: reason" to the number of messages that the latest pass of `events`
            skipped.
    """

    def __init__(self, path: Path, source: Source, remarks: tuple[str, ...]) -> None:
        self._source = source
        self.path = path
        self.topics = source.topics
        self.remarks = remarks
        self.unreadable: Counter[str] = Counter()

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
            RecordingError: a topic is missing, of a wrong type, or ambiguous.
        """
        states = choose_joint_states(self.topics, joint_states)
        chosen: dict[str, tuple[Topic, Callable[[Message, int], Event]]] = {}
        commands = choose_command(self.topics, states, command)
        if commands:
            chosen[commands.name] = commands, COMMAND_TYPES[commands.type].decode
        for topic in self.topics:
            if topic.name == changes and topic.type == TEXT:
                chosen[topic.name] = topic, _change
        chosen[states.name] = states, joint_sample
        return self._convert(chosen)

    def messages(self, name: str) -> Iterator[tuple[int, Message]]:
        """Yield log time [ns] and message of one topic, in the order of log time.

        Raises:
            RecordingError: no such topic.
        """
        topics = [topic for topic in self.topics if topic.name == name]
        if not topics:
            found = [topic.name for topic in self.topics]
            raise RecordingError(f'{self.path} has topics {found}', f'topic {name}')
        decode = decoder(topics[0].type, topics[0].encoding)
        for log_ns, _, data in self._source.messages(topics):
            yield log_ns, decode(data)

    def _convert(
        self, chosen: dict[str, tuple[Topic, Callable[[Message, int], Event]]]
    ) -> Iterator[Event]:
        unreadable = self.unreadable = Counter[str]()
        decoders = {
            name: decoder(topic.type, topic.encoding) for name, (topic, _) in chosen.items()
        }
        for log_ns, name, data in self._source.messages([topic for topic, _ in chosen.values()]):
            try:
                event = chosen[name][1](decoders[name](data), log_ns)
            except MessageError as error:  # noqa: PERF203 - each message fails on its own
                unreadable[f'{name}: {error.found}'] += 1
            else:
                yield event


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
    source, remarks = _directory_source(path) if path.is_dir() else (_file_source(path), ())
    if not any(topic.count for topic in source.topics):
        raise RecordingError(f'{path} holds no message', 'a recording with joint states')
    return Recording(path, source, remarks + source.remarks)


def _file_source(path: Path) -> Source:
    with path.open('rb') as stream:
        head = stream.read(16)
    if not head:
        raise RecordingError(f'{path} is empty', _KINDS, 'was the recorder stopped properly?')
    if head.startswith(MAGIC[: len(head)]):
        return McapSource([path])
    if head.startswith(b'SQLite format 3'):
        return SqliteSource([path])
    if head.startswith(b'#ROSBAG V2'):
        return RosbagsSource(path)
    remedy = f'turn a table into one: sgp import {path}' if path.suffix in _TABLES else ''
    raise RecordingError(f'{path} is no recording (starts with {head[:8]!r})', _KINDS, remedy)


def _directory_source(path: Path) -> tuple[Source, tuple[str, ...]]:
    listed, is_compressed = _metadata(path)
    if is_compressed or any(path.glob('*.zstd')):
        return RosbagsSource(path), ()
    missing = [name for name in listed if not (path / name).is_file()]
    remarks = (f'metadata.yaml lists {", ".join(missing)}: not there',) if missing else ()
    files = [path / name for name in listed if name not in missing] or sorted(
        (file for file in path.iterdir() if file.suffix in {'.mcap', '.db3'}), key=_natural_order
    )
    if files and all(file.suffix == '.mcap' for file in files):
        return McapSource(files), remarks
    if files and all(file.suffix == '.db3' for file in files):
        return SqliteSource(files), remarks
    raise RecordingError(f'directory {path} without .mcap files or .db3 files', _KINDS)


def _metadata(path: Path) -> tuple[list[str], bool]:
    """Return the files that metadata.yaml lists, and whether rosbag2 compressed them.

    A missing or broken metadata.yaml, as after a crash of the recorder, lists nothing.
    """
    try:
        content = yaml.safe_load((path / 'metadata.yaml').read_text(encoding='utf-8'))
        information = content['rosbag2_bagfile_information']
        names = [Path(str(name)).name for name in information['relative_file_paths']]
        return names, bool(information.get('compression_format'))
    except (FileNotFoundError, yaml.YAMLError, KeyError, TypeError, UnicodeDecodeError):
        return [], False


def _natural_order(path: Path) -> list[tuple[int, str]]:
    """Order split files by their numbers: `bag_10` after `bag_9`."""
    return [(int(part or 0), text) for text, part in re.findall(r'(\D*)(\d*)', path.name)]


def _change(message: Message, _receipt_ns: int) -> SettingsChange | Reset:
    return change_from_text(cast('str', message.data))
