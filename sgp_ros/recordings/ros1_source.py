"""The `.bag` files of ROS 1: chunks of messages, and their index at the end."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from functools import partial
from io import BufferedReader, FileIO
from pathlib import Path, PosixPath
from typing import Any

from rosbags.rosbag1.reader import Chunk, IndexData, Reader, decompressors

from sgp_ros.errors import RecordingError, SgpError
from sgp_ros.recordings.ros1_walk import Found, walk
from sgp_ros.recordings.topics import RawMessage, Topic, merged_topics
from sgp_ros.recordings.typestore import short_type
from sgp_ros.recordings.unpacking import Unpacking
from sgp_ros.strangers import require_within


class Ros1Source:
    """The messages of a ROS 1 bag.

    Args:
        path: the `.bag` file.

    Raises:
        RecordingError: what rosbags says about a broken one.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._has_index, self._said = True, list[str]()
        counts: list[tuple[tuple[str, str, str], int]] = []
        try:
            with self._reader() as reader:
                number = Counter[int]()
                for info in reader.chunk_infos:
                    number.update(info.connection_counts)
                counts += [
                    ((c.topic, short_type(c.msgtype), 'ros1'), number[c.id])
                    for c in reader.connections
                ]
        except _DamagedError as error:
            counts = self._recovered(error)
        self.topics, said = merged_topics(counts)
        self._said += said

    @property
    def remarks(self) -> tuple[str, ...]:
        """Damage of the file and what is not read of it, one sentence each."""
        return tuple(dict.fromkeys(self._said))

    def messages(self, topics: Collection[Topic]) -> Iterator[RawMessage]:
        """Yield the messages of `topics` by log time."""
        wanted = {(topic.name, topic.type) for topic in topics}
        latest_ns = None
        try:
            for message in self._indexed(wanted) if self._has_index else self._walked(wanted):
                latest_ns = message.log_ns
                yield message
        except _DamagedError as error:
            if latest_ns is None:
                self._recovered(error)
                yield from self._walked(wanted)
            else:
                self._said.append(f'{self._path.name} is damaged ({error.__cause__}): nothing '
                                  f'after {latest_ns / 1e9:.9f} s is read')  # fmt: skip

    def _recovered(self, error: _DamagedError) -> list[tuple[tuple[str, str, str], int]]:
        """Return the number of messages of each topic and type that a walk finds.

        Raises:
            RecordingError: there is none.
        """
        counts, latest_ns = Counter[tuple[str, str, str]](), 0
        for x in self._walk():
            counts[x.topic, x.type, 'ros1'] += 1
            latest_ns = max(latest_ns, x.log_ns)
        if not counts:
            raise error
        self._has_index = False
        self._said.append(f'{self._path.name} is damaged ({error.__cause__}): recovered '
                          f'{counts.total()} messages, up to {latest_ns / 1e9:.9f} s')  # fmt: skip
        return list(counts.items())

    def _walk(self) -> Iterator[Found]:
        unpacking = Unpacking(self._path.stat().st_size)
        with _BoundedPath(self._path).open() as stream:
            for found in walk(stream, unpacking):
                unpacking.count_messages(1)
                yield found

    def _walked(self, wanted: Collection[tuple[str, str]]) -> Iterator[RawMessage]:
        """Yield messages of a bag without an index; chunks may overlap in time."""
        found, held = list[RawMessage](), 0
        for x in self._walk():
            if (x.topic, x.type) in wanted:
                found.append(RawMessage(x.log_ns, x.topic, x.data))
                held += len(x.data) + _OBJECT
                require_within(held / (1 << 20), 'HELD_MB', 'size of a bag without index in MB')
        yield from sorted(found, key=lambda x: x.log_ns)

    def _indexed(self, wanted: Collection[tuple[str, str]]) -> Iterator[RawMessage]:
        with self._reader() as reader:
            connections = [
                c for c in reader.connections if (c.topic, short_type(c.msgtype)) in wanted
            ]
            for connection, log_ns, data in reader.messages(connections):
                yield RawMessage(log_ns, connection.topic, data)

    @contextmanager
    def _reader(self) -> Iterator[Reader]:
        try:
            with _Ros1Reader(self._path) as reader:
                yield reader
        except SgpError:
            raise
        except Exception as error:  # the library raises what its parsers do
            raise _DamagedError(
                f'{self._path} cannot be read ({error})', 'an intact bag',
                'repair it with `rosbag reindex`',
            ) from error  # fmt: skip


class _DamagedError(RecordingError):
    """A bag that is not as a recorder writes it."""


class _Bounded(BufferedReader):
    """A file of which no more is read at once than a chunk may hold."""

    def read(self, size: int | None = -1) -> bytes:
        """Return the next bytes."""
        require_within((size or 0) / (1 << 20), 'CHUNK_MB', 'size of a record in MB')
        return super().read(size)

    def readline(self, _size: int | None = -1) -> bytes:
        """Return the first line, which is short."""
        return super().readline(_LINE)


class _BoundedPath(PosixPath):
    """A path whose file is read within bounds."""

    def open(self, *_: Any, **_named: Any) -> _Bounded:  # type: ignore[override]  # one mode
        """Return the file."""
        return _Bounded(FileIO(str(self)))


class _Ros1Reader(Reader):
    """A reader whose chunks and index are read within bounds."""

    def __init__(self, path: Path) -> None:
        super().__init__(_BoundedPath(path))
        self._unpacking = Unpacking(path.stat().st_size)
        self._held = 0

    def read_chunk(self) -> Chunk:
        """Return where a chunk is, with what unpacks it."""
        chunk = super().read_chunk()
        kind = _PACKED.get(chunk.decompressor)
        return chunk._replace(decompressor=partial(self._unpacked, kind))

    def read_index_data(self, pos: int, indexes: dict[int, list[IndexData]]) -> None:
        """Read where the messages of a connection are in a chunk."""
        assert self.bio is not None
        head = self.bio.read(_INDEX_HEAD.size)
        self.bio.seek(-len(head), 1)
        number = _INDEX_HEAD.unpack(head)[0] // _INDEX_BYTES
        self._unpacking.count_messages(number)
        self._held += number * _OBJECT
        require_within(
            self._held / (1 << 20), 'HELD_MB', f'size of the index of {self.path} in MB'
        )
        super().read_index_data(pos, indexes)

    def _unpacked(self, kind: str | None, data: bytes) -> bytes:
        """Return a chunk; an index may ask for the same one again and again."""
        if kind is not None:
            return self._unpacking.unpacked(kind, data)
        self._unpacking.count(len(data))
        return data


_INDEX_HEAD, _INDEX_BYTES = struct.Struct('<51xI'), 12
"""Of a record of the index: its size behind its head, and the size of an entry."""
_LINE = 80
"""Bytes of a first line, at most."""
_OBJECT = 256
"""Bytes that an entry takes."""

_PACKED = {decompressors['bz2']: 'bz2', decompressors['lz4']: 'lz4'}
