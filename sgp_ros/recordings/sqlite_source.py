"""The `.db3` files of rosbag2: messages in a SQLite database.

Of a damaged file, such as one that was cut off, the rows up to the first that cannot be read are
used. A file whose last transaction is in a journal beside it is as its recorder left it in the
middle of writing; only SQLite, with write access, can complete it.
"""

from __future__ import annotations

import heapq
import math
import sqlite3
import struct
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

from sgp_ros.errors import RecordingError
from sgp_ros.recordings.topics import RawMessage, Topic, merged_topics
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

    def __init__(self, paths: Sequence[Path], size: int | None = None) -> None:
        self._paths = tuple(paths)
        self._unpacking = Unpacking(size or sum(path.stat().st_size for path in paths))
        self._readable: dict[Path, int] = {}
        remarks, counts = list[str](), list[tuple[tuple[str, str, str], int]]()
        for path in self._paths:
            try:
                number = self._numbers(path)
            except _DamagedError as error:
                number = self._recovered(path, error, remarks)
            counts += [
                ((name, kind, encoding), number.pop(key, 0))
                for key, name, kind, encoding in self._topics(path)
            ]
            if number:
                remarks.append(
                    f'{path.name}: {sum(number.values())} messages belong to no topic and are '
                    'not read'
                )
        self.topics, said = merged_topics(counts)
        self._said = [*remarks, *said]

    @property
    def remarks(self) -> tuple[str, ...]:
        """Damage of the files and what is not read of them, one sentence each."""
        return tuple(dict.fromkeys(self._said))

    def _numbers(self, path: Path) -> dict[object, int]:
        """Return how many messages each key of a topic has."""
        _require_whole_pages(path)
        self._require_tables(path)
        self._unpacking.count_messages(*next(self._rows(path, _NUMBER_QUERY)))
        return dict(self._rows(path, _COUNT_QUERY))

    def _recovered(
        self, path: Path, error: _DamagedError, remarks: list[str]
    ) -> dict[object, int]:
        """Return the same of the rows before the first that cannot be read.

        Raises:
            RecordingError: there is none.
        """
        self._readable[path] = -1
        try:
            self._require_tables(path)
        except RecordingError:
            raise error from None
        number, last, latest_ns = Counter[object](), -math.inf, 0
        with suppress(_DamagedError):
            values = (bound('CHUNK_MB') << 20,)
            for key, log_ns, topic, data in self._rows(path, _ALL_QUERY, values):
                is_whole = isinstance(log_ns, int) and isinstance(data, (bytes, int))
                if not (isinstance(key, int) and key > last and is_whole):
                    break  # a page of which only a part is there
                last, latest_ns = key, max(latest_ns, log_ns)
                number[topic] += 1
                self._unpacking.count_messages(1)
        if not number:
            raise error
        self._readable[path] = number.total()
        remarks.append(f'{path.name} is damaged ({error.reason}): recovered {number.total()} '
                       f'messages, up to {latest_ns / 1e9:.9f} s')  # fmt: skip
        return dict(number)

    def messages(self, topics: Collection[Topic]) -> Iterator[RawMessage]:
        """Yield the messages of `topics` by log time; equal times keep the order of the file."""
        wanted = {(topic.name, topic.type, topic.encoding) for topic in topics}
        streams = [self._file_messages(path, wanted) for path in self._paths]
        yield from heapq.merge(*streams, key=lambda message: message.log_ns)

    def _file_messages(
        self, path: Path, wanted: Collection[tuple[str, str, str]]
    ) -> Iterator[RawMessage]:
        latest_ns = None
        try:
            for message in self._whole_messages(path, wanted):
                latest_ns = message.log_ns
                yield message
        except _DamagedError as error:
            if path in self._readable:
                raise
            if latest_ns is None:
                self._recovered(path, error, self._said)
                yield from self._whole_messages(path, wanted)
            else:
                self._said.append(f'{path.name} is damaged ({error.reason}): nothing after '
                                  f'{latest_ns / 1e9:.9f} s is read')  # fmt: skip

    def _whole_messages(
        self, path: Path, wanted: Collection[tuple[str, str, str]]
    ) -> Iterator[RawMessage]:
        names = {key: name for key, name, *kind in self._topics(path) if (name, *kind) in wanted}
        rows = _SOME_ROWS.format(self._readable[path]) if path in self._readable else 'messages'
        query = _MESSAGE_QUERY.format(rows, ', '.join('?' * len(names)))
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
                if path in self._readable:  # else nothing is read of a file that lacks its end
                    base.execute('PRAGMA writable_schema = ON')
                yield from base.execute(query, values)
        except sqlite3.DatabaseError as error:
            _refuse_journal(path, error)
            raise _damaged(path, str(error)) from error


class _DamagedError(RecordingError):
    """A database that is not as SQLite writes it.

    Attributes:
        reason: what is wrong with it.
    """

    reason = ''


def _damaged(path: Path, reason: str) -> _DamagedError:
    error = _DamagedError(
        f'{path} cannot be read as a rosbag2 database ({reason})',
        'an intact .db3 file',
        'repair it with `sqlite3 FILE .recover`',
    )
    error.reason = reason
    return error


def _require_whole_pages(path: Path) -> None:
    """Refuse a file that ends within a page, the rest of which SQLite would take for zeros.

    Raises:
        RecordingError: it does.
    """
    with path.open('rb') as stream:
        head = stream.read(_PAGE.size)
    page = _PAGE.unpack(head)[0] if len(head) == _PAGE.size else 0
    if path.stat().st_size % (_LARGEST_PAGE if page <= 1 else page):
        raise _damaged(path, 'it ends within a page')


def _refuse_journal(path: Path, error: Exception) -> None:
    """Refuse a database whose last transaction is in a journal.

    Raises:
        RecordingError: it is.
    """
    for ending in ('-journal', '-wal'):
        journal = path.with_name(path.name + ending)
        if journal.exists() and journal.stat().st_size:
            raise RecordingError(
                f'{path} was not closed: its last transaction is in {journal.name} ({error})',
                'a complete .db3 file',
                f"complete it with write access: sqlite3 {path} 'PRAGMA quick_check'",
            ) from error


_PAGE, _LARGEST_PAGE = struct.Struct('>16xH'), 1 << 16
"""Head of a file with the size of its pages, where 1 stands for the largest [bytes]."""
_TABLE = 'CREATE TABLE'
_TABLES_QUERY = "SELECT name, sql FROM sqlite_master WHERE name IN ('topics', 'messages')"
_COLUMNS_QUERY = 'SELECT hidden FROM pragma_table_xinfo(?)'
_TOPIC_QUERY = 'SELECT id, name, type, serialization_format FROM topics'
_NUMBER_QUERY = 'SELECT count(*) FROM messages'
_COUNT_QUERY = 'SELECT topic_id, count(*) FROM messages GROUP BY topic_id'
_COLUMNS = (
    "timestamp, topic_id, CASE WHEN typeof(data) <> 'blob' THEN typeof(data) "
    'WHEN length(data) > ? THEN length(data) ELSE data END'
)
_MESSAGE_QUERY = f'SELECT {_COLUMNS} FROM {{}} WHERE topic_id IN ({{}}) ORDER BY timestamp, id'  # noqa: S608
_ALL_QUERY = f'SELECT id, {_COLUMNS} FROM messages NOT INDEXED ORDER BY id'  # noqa: S608 - our own
_SOME_ROWS = '(SELECT * FROM messages NOT INDEXED ORDER BY id LIMIT {})'
