"""The `.db3` files of rosbag2: messages in a SQLite database."""

from __future__ import annotations

import heapq
import sqlite3
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from sgp_ros.errors import RecordingError
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
