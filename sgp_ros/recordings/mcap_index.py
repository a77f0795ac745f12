"""Find where the messages of an MCAP file lie, also when a crash cut the file off.

A file is a sequence of segments: compressed chunks, or stretches of loose messages. Their places
and first times come from the index at the end of the file. A file without one is scanned once,
up to the last complete segment.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import IO, NamedTuple

import zstandard
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Channel, McapRecord, Message, Schema
from mcap.stream_reader import StreamReader

from sgp_ros.errors import RecordingError
from sgp_ros.recordings.typestore import short_type

MAGIC = b'\x89MCAP0\r\n'
DAMAGE = (McapError, struct.error, ValueError, RuntimeError, KeyError, zstandard.ZstdError)
"""What reading damaged records raises."""

_LOOSE_BYTES = 1 << 20
_RECORD_HEAD = struct.Struct('<BQ')


class Segment(NamedTuple):
    """A stretch of a file that holds messages.

    Attributes:
        start_ns: first log time [ns].
        file: number of the file.
        offset: first byte.
        length: number of bytes.
    """

    start_ns: int
    file: int
    offset: int
    length: int


@dataclass(slots=True)
class FileIndex:
    """What is known of one file.

    Attributes:
        channels: channel number to (topic, type, encoding).
        counts: channel number to number of messages.
        segments: where the messages are.
        remark: what the user should know of the state of the file; may be empty.
    """

    channels: dict[int, tuple[str, str, str]] = field(default_factory=dict)
    counts: Counter[int] = field(default_factory=Counter)
    segments: list[Segment] = field(default_factory=list)
    remark: str = ''


def index_file(path: Path, number: int) -> FileIndex:
    """Return the index of the file at `path`, its segments marked with `number`.

    Raises:
        RecordingError: it is no MCAP file.
    """
    with path.open('rb') as stream:
        magic = stream.read(len(MAGIC))
        if magic and not MAGIC.startswith(magic):
            raise RecordingError(
                f'{path} starts with {magic!r}', f'an MCAP file ({MAGIC!r})', 'check the file'
            )
        try:
            index = _read_index(stream, number)
        except (*DAMAGE, OSError):
            index = None
        return index or _scan(stream, path, number)


def _read_index(stream: IO[bytes], number: int) -> FileIndex | None:
    """Return the index at the end of the file, None where it is incomplete."""
    stream.seek(0)
    summary = make_reader(stream).get_summary()
    if summary is None or summary.statistics is None:
        return None
    counts = Counter(summary.statistics.channel_message_counts)
    chunks = summary.chunk_indexes
    if (counts.total() and not chunks) or not set(counts) <= set(summary.channels):
        return None
    channels = {key: _describe(c, summary.schemas) for key, c in summary.channels.items()}
    segments = [
        Segment(c.message_start_time, number, c.chunk_start_offset, c.chunk_length) for c in chunks
    ]
    return FileIndex(channels, counts, segments)


def _scan(stream: IO[bytes], path: Path, number: int) -> FileIndex:
    """Walk the records of a file without index, up to the last complete segment."""
    index = FileIndex()
    schemas: dict[int, Schema] = {}
    latest_ns = 0
    walk = _Walk(stream)
    try:
        for offset, data in walk.segments():
            times = []
            for record in list(read_records(data)):
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    index.channels[record.id] = _describe(record, schemas)
                elif isinstance(record, Message):
                    index.counts[record.channel_id] += 1
                    times.append(record.log_time)
            if times:
                index.segments.append(Segment(min(times), number, offset, len(data)))
                latest_ns = max(latest_ns, *times)
    except DAMAGE:
        walk.is_complete = False
    if not walk.is_complete:
        index.remark = (
            f'{path.name} has no proper end, as after a crash of the recorder: recovered '
            f'{index.counts.total()} messages'
        )
        if latest_ns:
            index.remark += f', up to {latest_ns // 10**9}.{latest_ns % 10**9:09d} s'
    return index


class _Walk:
    """The data records of a file, one chunk or about 1 MiB of loose records at a time."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream
        self._size = stream.seek(0, 2)
        self.is_complete = False

    def segments(self) -> Iterator[tuple[int, bytes]]:
        """Yield offset and bytes; `is_complete` tells afterwards whether the data had an end."""
        offset = start = len(MAGIC)
        while True:
            self._stream.seek(offset)
            head = self._stream.read(_RECORD_HEAD.size)
            opcode, length = (
                _RECORD_HEAD.unpack(head) if len(head) == _RECORD_HEAD.size else (0, 0)
            )
            end = offset + len(head) + length
            is_end = opcode in {0, Opcode.DATA_END, Opcode.FOOTER} or end > self._size
            if start < offset and (is_end or opcode == Opcode.CHUNK or end - start > _LOOSE_BYTES):
                yield start, self._read(start, offset)
                start = offset
            if is_end:
                self.is_complete = opcode in {Opcode.DATA_END, Opcode.FOOTER}
                return
            if opcode == Opcode.CHUNK:
                yield start, self._read(start, end)
                start = end
            offset = end

    def _read(self, start: int, end: int) -> bytes:
        self._stream.seek(start)
        return self._stream.read(end - start)


def read_records(data: bytes) -> Iterator[McapRecord]:
    """Yield the records in `data`, those of chunks included; a wrong checksum raises."""
    reader = StreamReader(BytesIO(data), skip_magic=True, validate_crcs=True)
    try:
        yield from reader.records
    except EndOfFile:
        return


def _describe(channel: Channel, schemas: dict[int, Schema]) -> tuple[str, str, str]:
    schema = schemas.get(channel.schema_id)
    kind = short_type(schema.name) if schema else ''
    return channel.topic, kind, channel.message_encoding
