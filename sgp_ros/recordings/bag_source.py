"""Bags that are not plain MCAP: SQLite3, compressed rosbag2 directories, ROS 1."""

from __future__ import annotations

import heapq
import sqlite3
from collections.abc import Collection, Iterator, Sequence
from contextlib import closing
from pathlib import Path

from rosbags.rosbag1 import Reader as Ros1Reader
from rosbags.rosbag2 import Reader as Ros2Reader

from sgp_ros.errors import RecordingError
from sgp_ros.recordings.topics import RawMessage, Topic
from sgp_ros.recordings.typestore import short_type


class SqliteSource:
    """The messages of one or several `.db3` files of a rosbag2 recording.

    Args:
        paths: the files, in the order in which they were written.

    Raises:
        RecordingError: a file without the tables of rosbag2.
    """

    remarks: tuple[str, ...] = ()

    def __init__(self, paths: Sequence[Path]) -> None:
        self._paths = tuple(paths)
        counts: dict[tuple[str, str, str], int] = {}
        for path in self._paths:
            self._require_tables(path)
            for name, kind, encoding, count in self._rows(path, _COUNT_QUERY):
                key = (str(name), short_type(str(kind)), str(encoding))
                counts[key] = counts.get(key, 0) + int(str(count))
        self.topics = tuple(
            Topic(name, kind, count, encoding)
            for (name, kind, encoding), count in sorted(counts.items())
        )

    def messages(self, topics: Collection[Topic]) -> Iterator[RawMessage]:
        """Yield the messages of `topics` by log time; equal times keep the order of the file."""
        names = tuple(topic.name for topic in topics)
        query = _MESSAGE_QUERY.format(', '.join('?' * len(names)))
        streams = [self._file_messages(path, query, names) for path in self._paths]
        yield from heapq.merge(*streams, key=lambda message: message.log_ns)

    def _file_messages(
        self, path: Path, query: str, names: tuple[str, ...]
    ) -> Iterator[RawMessage]:
        for log_ns, name, data in self._rows(path, query, names):
            if not isinstance(log_ns, int) or not isinstance(data, bytes):
                raise RecordingError(
                    f'{path}: a message of {type(log_ns).__name__} and {type(data).__name__}',
                    'an integer time and binary data',
                )
            yield RawMessage(log_ns, str(name), data)

    def _require_tables(self, path: Path) -> None:
        """Refuse views and virtual tables, which may compute without end."""
        found = {str(name): str(sql) for name, sql in self._rows(path, _TABLES_QUERY)}
        wrong = [n for n in ('topics', 'messages') if not found.get(n, '').startswith(_TABLE)]
        if wrong:
            raise RecordingError(f'{path} has no plain tables {wrong}', 'a .db3 file of rosbag2')

    def _rows(
        self, path: Path, query: str, values: tuple[str, ...] = ()
    ) -> Iterator[tuple[object, ...]]:
        try:
            with closing(sqlite3.connect(f'{path.absolute().as_uri()}?mode=ro', uri=True)) as base:
                yield from base.execute(query, values)
        except sqlite3.DatabaseError as error:
            raise RecordingError(
                f'{path} cannot be read as a rosbag2 database ({error})',
                'an intact .db3 file',
                'repair it with `sqlite3 FILE .recover`',
            ) from error


_TABLE = 'CREATE TABLE'
_TABLES_QUERY = "SELECT name, sql FROM sqlite_master WHERE name IN ('topics', 'messages')"
_COUNT_QUERY = (
    'SELECT name, type, serialization_format, count(messages.id) FROM topics '
    'LEFT JOIN messages ON topics.id == messages.topic_id GROUP BY topics.id'
)
_MESSAGE_QUERY = (
    'SELECT timestamp, name, data FROM messages JOIN topics ON topics.id == messages.topic_id '
    'WHERE name IN ({}) ORDER BY timestamp, messages.id'
)


class RosbagsSource:
    """The messages of a ROS 1 bag, or of a rosbag2 directory with compression.

    Args:
        path: the `.bag` file or the directory.

    Raises:
        RecordingError: what rosbags says about a broken one.
    """

    remarks: tuple[str, ...] = ()

    def __init__(self, path: Path) -> None:
        self._path = path
        self._encoding = 'ros1' if path.is_file() else 'cdr'
        try:
            with self._reader() as reader:
                self.topics = tuple(
                    Topic(name, short_type(info.msgtype or ''), info.msgcount, self._encoding)
                    for name, info in sorted(reader.topics.items())
                )
        except RecordingError:
            raise
        except Exception as error:  # the library raises what its parsers do
            raise self._broken(error) from error

    def messages(self, topics: Collection[Topic]) -> Iterator[RawMessage]:
        """Yield the messages of `topics` by log time."""
        names = {topic.name for topic in topics}
        try:
            with self._reader() as reader:
                connections = [c for c in reader.connections if c.topic in names]
                for connection, log_ns, data in reader.messages(connections):
                    yield RawMessage(log_ns, connection.topic, data)
        except RecordingError:
            raise
        except Exception as error:  # the library raises what its parsers do
            raise self._broken(error) from error

    def _reader(self) -> Ros1Reader | Ros2Reader:
        return Ros1Reader(self._path) if self._path.is_file() else Ros2Reader(self._path)

    def _broken(self, error: Exception) -> RecordingError:
        remedy = 'repair it with `rosbag reindex`' if self._encoding == 'ros1' else ''
        return RecordingError(f'{self._path} cannot be read ({error})', 'an intact bag', remedy)
