"""Bags that are not MCAP: SQLite3 and ROS 1."""

from __future__ import annotations

import heapq
import sqlite3
import struct
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from contextlib import closing, contextmanager
from functools import partial
from io import BufferedReader, FileIO
from pathlib import Path, PosixPath
from typing import Any

from rosbags.rosbag1.reader import Chunk, IndexData, Reader, decompressors

from sgp_ros.errors import RecordingError, SgpError
from sgp_ros.recordings.topics import RawMessage, Topic
from sgp_ros.recordings.typestore import short_type
from sgp_ros.recordings.unpacking import Unpacking
from sgp_ros.strangers import bound, require_within


class SqliteSource:
    """The messages of one or several `.db3` files of a rosbag2 recording.

    Args:
        paths: the files, in the order in which they were written.
        size: of the files that these were unpacked from [bytes]; None where they were not.

    Raises:
        RecordingError: a file without the tables of rosbag2.
        TooMuchError: more messages than `MESSAGES`.
    """

    remarks: tuple[str, ...] = ()

    def __init__(self, paths: Sequence[Path], size: int | None = None) -> None:
        self._paths = tuple(paths)
        counts: Counter[tuple[str, str, str]] = Counter()
        unpacking = Unpacking(size or sum(path.stat().st_size for path in paths))
        for path in self._paths:
            self._require_tables(path)
            unpacking.count_messages(*next(self._rows(path, _NUMBER_QUERY)))
            number = dict(self._rows(path, _COUNT_QUERY))
            for key, *described in self._topics(path):
                counts[described[0], described[1], described[2]] += int(str(number.get(key, 0)))
        self.topics = tuple(
            Topic(name, kind, count, encoding)
            for (name, kind, encoding), count in sorted(counts.items())
        )

    def messages(self, topics: Collection[Topic]) -> Iterator[RawMessage]:
        """Yield the messages of `topics` by log time; equal times keep the order of the file."""
        wanted = {topic.name for topic in topics}
        streams = [self._file_messages(path, wanted) for path in self._paths]
        yield from heapq.merge(*streams, key=lambda message: message.log_ns)

    def _file_messages(self, path: Path, wanted: Collection[str]) -> Iterator[RawMessage]:
        names = {key: name for key, name, *_ in self._topics(path) if name in wanted}
        query = _MESSAGE_QUERY.format(', '.join('?' * len(names)))
        most = bound('CHUNK_MB') << 20
        for log_ns, key, data in self._rows(path, query, (most, *names)):
            if isinstance(data, int):
                require_within(data / (1 << 20), 'CHUNK_MB', 'size of a message in MB')
            if not isinstance(log_ns, int) or not isinstance(data, bytes):
                raise RecordingError(
                    f'{path}: a message of {type(log_ns).__name__} and {type(data).__name__}',
                    'an integer time and binary data',
                )
            yield RawMessage(log_ns, names[key], data)

    def _topics(self, path: Path) -> Iterator[tuple[object, str, str, str]]:
        """Yield key, name, type and encoding of the topics of a file.

        Raises:
            RecordingError: several topics of one key, or more than `ENTRIES`.
        """
        known: set[object] = set()
        for key, name, kind, encoding in self._rows(path, _TOPIC_QUERY):
            if key in known:
                raise RecordingError(f'{path} has several topics of key {key}', 'one of each')
            known.add(key)
            require_within(len(known), 'ENTRIES', f'number of topics in {path}')
            yield key, str(name), short_type(str(kind)), str(encoding)

    def _require_tables(self, path: Path) -> None:
        """Refuse views, virtual tables and columns, which may compute without end."""
        found = {str(name): str(sql) for name, sql in self._rows(path, _TABLES_QUERY)}
        wrong = [
            name
            for name in ('topics', 'messages')
            if not found.get(name, '').startswith(_TABLE)
            or any(hidden for (hidden,) in self._rows(path, _COLUMNS_QUERY, (name,)))
        ]
        if wrong:
            raise RecordingError(f'{path} has no plain tables {wrong}', 'a .db3 file of rosbag2')

    def _rows(
        self, path: Path, query: str, values: tuple[object, ...] = ()
    ) -> Iterator[tuple[Any, ...]]:
        try:
            with closing(sqlite3.connect(f'{path.absolute().as_uri()}?mode=ro', uri=True)) as base:
                base.execute('PRAGMA trusted_schema = OFF')
                yield from base.execute(query, values)
        except sqlite3.DatabaseError as error:
            raise RecordingError(
                f'{path} cannot be read as a rosbag2 database ({error})',
                'an intact .db3 file',
                'repair it with `sqlite3 FILE .recover`',
            ) from error


_TABLE = 'CREATE TABLE'
_TABLES_QUERY = "SELECT name, sql FROM sqlite_master WHERE name IN ('topics', 'messages')"
_COLUMNS_QUERY = 'SELECT hidden FROM pragma_table_xinfo(?)'
_TOPIC_QUERY = 'SELECT id, name, type, serialization_format FROM topics'
_NUMBER_QUERY = 'SELECT count(*) FROM messages'
_COUNT_QUERY = 'SELECT topic_id, count(*) FROM messages GROUP BY topic_id'
_MESSAGE_QUERY = (
    "SELECT timestamp, topic_id, CASE WHEN typeof(data) <> 'blob' THEN typeof(data) "
    'WHEN length(data) > ? THEN length(data) ELSE data END '
    'FROM messages WHERE topic_id IN ({}) ORDER BY timestamp, id'
)


class Ros1Source:
    """The messages of a ROS 1 bag.

    Args:
        path: the `.bag` file.

    Raises:
        RecordingError: what rosbags says about a broken one.
    """

    remarks: tuple[str, ...] = ()

    def __init__(self, path: Path) -> None:
        self._path = path
        with self._reader() as reader:
            self.topics = tuple(
                Topic(name, short_type(info.msgtype or ''), info.msgcount, 'ros1')
                for name, info in sorted(reader.topics.items())
            )

    def messages(self, topics: Collection[Topic]) -> Iterator[RawMessage]:
        """Yield the messages of `topics` by log time."""
        names = {topic.name for topic in topics}
        with self._reader() as reader:
            connections = [c for c in reader.connections if c.topic in names]
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
            raise RecordingError(
                f'{self._path} cannot be read ({error})', 'an intact bag',
                'repair it with `rosbag reindex`',
            ) from error  # fmt: skip


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
