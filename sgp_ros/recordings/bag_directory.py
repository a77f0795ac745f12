"""Directories of rosbag2: their files, their metadata.yaml, their compression."""

from __future__ import annotations

import re
import weakref
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import yaml
import zstandard

from sgp_ros.errors import RecordingError, SgpError
from sgp_ros.markup import load_yaml
from sgp_ros.recordings.mcap_source import McapSource
from sgp_ros.recordings.sqlite_source import SqliteSource
from sgp_ros.recordings.topics import RawMessage, Source, Topic
from sgp_ros.recordings.unpacking import Unpacking
from sgp_ros.scratch import Scratch
from sgp_ros.strangers import read_text, require_file

_KINDS: dict[str, type[McapSource | SqliteSource]] = {'.mcap': McapSource, '.db3': SqliteSource}
_PACKED = '.zstd'
_LONGEST = 100


def read_directory(path: Path) -> tuple[Source, tuple[str, ...]]:
    """Return the messages of a directory, and what the user should know of it.

    Raises:
        RecordingError: no file of a recording in it, or a damaged one.
        TooMuchError: not a regular file, or one that unpacks to more than `RATIO`.
    """
    metadata = _read_metadata(path)
    missing = [name for name in metadata.files if not (path / name).exists()]
    remarks = [f'metadata.yaml lists {", ".join(missing)}, which is missing'] if missing else []
    there = sorted((file for file in path.iterdir() if _kind(file) in _KINDS), key=_natural_order)
    files = [path / name for name in dict.fromkeys(metadata.files) if name not in missing] or there
    if metadata.damage:
        remarks.append(f'metadata.yaml is damaged ({metadata.damage}): {len(files)} files in its '
                       'folder are read without it')  # fmt: skip
    kinds = {_kind(file) for file in files}
    if len(kinds) != 1 or not kinds <= set(_KINDS):
        raise RecordingError(
            f'directory {path} contains no .mcap or .db3 file',
            'a rosbag2 directory with files of one of these kinds',
        )
    for file in files:
        require_file(file)
    has_packed_files = any(file.suffix == _PACKED for file in files)
    kind = _KINDS[kinds.pop()]
    source: Source = _of_packed(files, kind) if has_packed_files else kind(files)
    if metadata.is_compressed and not has_packed_files:
        source = _PackedMessages(source, _size(files))
    remarks += [
        f'{file.name} is not read, because metadata.yaml does not list it ({_content(file)})'
        for file in there if file not in files
    ]  # fmt: skip
    return source, (*remarks, *_differences(metadata, source))


def _content(file: Path) -> str:
    """Return what a file that is not read contains, in words."""
    if file.suffix == _PACKED:
        return 'compressed'
    try:
        require_file(file)
        source = _KINDS[file.suffix]([file])
    except (SgpError, OSError) as error:
        return ' '.join(str(error).split())[:200]
    return f'{sum(topic.count for topic in source.topics)} messages'


def _differences(metadata: _Metadata, source: Source) -> list[str]:
    """Say where the files contain another number of messages than metadata.yaml counts."""
    found = {topic.name: topic.count for topic in source.topics}
    remarks = [
        f'metadata.yaml counts {count} messages on {name}, the files contain {found.get(name, 0)}'
        for name, count in metadata.counts.items()
        if found.get(name, 0) != count
    ]
    number = sum(found.values())
    if metadata.total not in {None, number}:
        remarks.append(f'the files contain {number} of the {metadata.total} messages that '
                       'metadata.yaml counts')  # fmt: skip
    return remarks


@dataclass(frozen=True, slots=True)
class _PackedMessages:
    """A recording each message of which is compressed.

    Attributes:
        inner: the recording.
        size: of its files [bytes].
    """

    inner: Source
    size: int

    @property
    def topics(self) -> tuple[Topic, ...]:
        return self.inner.topics

    @property
    def remarks(self) -> tuple[str, ...]:
        return self.inner.remarks

    def messages(self, topics: Collection[Topic]) -> Iterator[RawMessage]:
        unpacking = Unpacking(self.size)
        for message in self.inner.messages(topics):
            data = b''  # of a damaged one, which whoever decodes it counts
            with suppress(zstandard.ZstdError):
                data = unpacking.unpacked('zstd', message.data)
            yield message._replace(data=data)


def _of_packed(files: Sequence[Path], kind: type[McapSource | SqliteSource]) -> Source:
    """Return the recording of compressed files, unpacked into a folder that goes with it."""
    scratch, size = Scratch(), _size(files)
    unpacking, plain = Unpacking(size), [scratch.path / file.stem for file in files]
    for file, target in zip(files, plain, strict=True):
        unpacking.unpack_file(file, target)
    source = kind(plain, size)
    weakref.finalize(source, scratch.remove)
    return source


def _size(files: Sequence[Path]) -> int:
    return sum(file.stat().st_size for file in files)


@dataclass(frozen=True, slots=True)
class _Metadata:
    """Contents of metadata.yaml; empty if it is missing or broken, as after a crash.

    Attributes:
        files: names of the files.
        is_compressed: whether messages or files are.
        counts: topic to number of messages.
        total: number of all messages; None where it is not stated.
        damage: why it cannot be read; empty where it can.
    """

    files: Sequence[str] = ()
    is_compressed: bool = False
    counts: Mapping[str, int] = field(default_factory=dict)
    total: int | None = None
    damage: str = ''


def _read_metadata(path: Path) -> _Metadata:
    try:
        content = load_yaml(read_text(path / 'metadata.yaml'))
        information = content['rosbag2_bagfile_information']
        names = [Path(str(name)).name for name in information['relative_file_paths']]
        counts = {
            str(entry['topic_metadata']['name']): int(entry['message_count'])
            for entry in information.get('topics_with_message_count') or ()
        }
        total = information.get('message_count')
        return _Metadata(
            names, bool(information.get('compression_format')), counts,
            None if total is None else int(total),
        )  # fmt: skip
    except FileNotFoundError:
        return _Metadata()
    except (
        yaml.YAMLError, KeyError, TypeError, AttributeError, ValueError, OverflowError,
    ) as error:  # fmt: skip
        reason = ' '.join(f'{type(error).__name__}: {error}'.split())
        return _Metadata(damage=reason[:_LONGEST])


def _kind(file: Path) -> str:
    """Return the ending of a file, that before the compression where it is compressed."""
    return Path(file.stem).suffix if file.suffix == _PACKED else file.suffix


def _natural_order(path: Path) -> list[tuple[int, str]]:
    """Order split files by their numbers: `bag_10` after `bag_9`."""
    return [(int(part or 0), text) for text, part in re.findall(r'(\D*)(\d*)', path.name)]
