"""MCAP files in the order of log time, also those that a crash cut off.

A file is a sequence of segments: compressed chunks, or stretches of loose messages. Their places
and first times come from the index at the end of the file. A file without one is scanned once,
up to the last complete segment. One segment after the other is read, so that memory holds about
one segment however long the recording is.
"""

from __future__ import annotations

import struct
from bisect import bisect_left
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace
from io import BytesIO
from operator import itemgetter
from pathlib import Path
from typing import IO, NamedTuple

import zstandard
from lz4.frame import LZ4FrameDecompressor
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, McapRecord, Message, Schema
from mcap.stream_reader import StreamReader, breakup_chunk

from sgp_ros.errors import RecordingError
from sgp_ros.recordings.topics import RawMessage, Topic
from sgp_ros.recordings.typestore import short_type
from sgp_ros.strangers import bound, require_within

MAGIC = b'\x89MCAP0\r\n'
_DAMAGE = (
    McapError, struct.error, ValueError, RuntimeError, KeyError, TypeError, AttributeError,
    IndexError, OverflowError, MemoryError, EOFError, zstandard.ZstdError,
)  # fmt: skip
"""What reading damaged records raises."""

_LOOSE_BYTES = 1 << 20
_RECORD_HEAD = struct.Struct('<BQ')


class McapSource:
    """The messages of one or several MCAP files, as one recording.

    Args:
        paths: the files, in the order in which they were written.

    Raises:
        RecordingError: a file that is no MCAP file.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        self._paths = tuple(paths)
        self._files = [_index_file(path, number) for number, path in enumerate(self._paths)]
        self._damage: dict[tuple[int, int], str] = {}

    @property
    def topics(self) -> tuple[Topic, ...]:
        """The topics of all files, by name; a topic with two types keeps the first."""
        found: dict[str, Topic] = {}
        for file in self._files:
            for channel, (name, kind, encoding) in sorted(file.channels.items()):
                known = found.get(name, Topic(name, kind, 0, encoding))
                if (known.type, known.encoding) == (kind, encoding):
                    count = known.count + file.counts[channel]
                    found[name] = Topic(name, kind, count, encoding)
        return tuple(found[name] for name in sorted(found))

    @property
    def remarks(self) -> tuple[str, ...]:
        """What was wrong with the files, one sentence each."""
        return (*(file.remark for file in self._files if file.remark), *self._damage.values())

    def messages(self, topics: Collection[Topic]) -> Iterator[RawMessage]:
        """Yield the messages of `topics` by log time; equal times keep the order of the file.

        What is damaged is left out, and said in `remarks` from then on.
        """
        wanted = {(topic.name, topic.type, topic.encoding) for topic in topics}
        segments = [segment for file in self._files for segment in file.segments]
        order = sorted(range(len(segments)), key=lambda place: segments[place].start_ns)
        following = [segments[place].start_ns for place in order[1:]]
        pending: list[tuple[int, int, RawMessage]] = []
        for number, place in enumerate(order):
            read = self._segment_messages(segments[place], wanted)
            pending += ((message.log_ns, place, message) for message in read)
            pending.sort(key=itemgetter(0, 1))
            if number < len(following):
                ready = bisect_left(pending, following[number], key=itemgetter(0))
                yield from (message for _, _, message in pending[:ready])
                del pending[:ready]
        yield from (message for _, _, message in pending)

    def _segment_messages(
        self, segment: _Segment, wanted: Collection[tuple[str, str, str]]
    ) -> Iterator[RawMessage]:
        path = self._paths[segment.file]
        channels = self._files[segment.file].channels
        names = {number: channel[0] for number, channel in channels.items() if channel in wanted}
        with path.open('rb') as stream:
            stream.seek(segment.offset)
            data = stream.read(segment.length)
        try:
            for record in _read_records(data):
                if isinstance(record, Message) and record.channel_id in names:
                    yield RawMessage(record.log_time, names[record.channel_id], record.data)
        except _DAMAGE as error:
            place = path.name, segment.offset
            self._damage[segment.file, segment.offset] = (
                f'{place[0]}: damaged from byte {place[1]} to byte '
                f'{segment.offset + segment.length} ({" ".join(str(error).split())[:80]}); '
                'the intact data before and after it were used'
            )


class _Segment(NamedTuple):
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
class _FileIndex:
    """What is known of one file.

    Attributes:
        channels: channel number to (topic, type, encoding).
        counts: channel number to number of messages.
        segments: where the messages are.
        remark: what the user should know of the state of the file; may be empty.
    """

    channels: dict[int, tuple[str, str, str]] = field(default_factory=dict)
    counts: Counter[int] = field(default_factory=Counter)
    segments: list[_Segment] = field(default_factory=list)
    remark: str = ''


def _index_file(path: Path, number: int) -> _FileIndex:
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
        except (*_DAMAGE, OSError):
            index = None
        return index or _scan(stream, path, number)


def _read_index(stream: IO[bytes], number: int) -> _FileIndex | None:
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
        _Segment(c.message_start_time, number, c.chunk_start_offset, c.chunk_length)
        for c in chunks
    ]
    return _FileIndex(channels, counts, segments)


def _scan(stream: IO[bytes], path: Path, number: int) -> _FileIndex:
    """Walk the records of a file without index, up to the last complete segment."""
    index = _FileIndex()
    schemas: dict[int, Schema] = {}
    latest_ns = 0
    walk = _Walk(stream)
    try:
        for offset, data in walk.segments():
            times = []
            for record in list(_read_records(data)):
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    index.channels[record.id] = _describe(record, schemas)
                elif isinstance(record, Message):
                    index.counts[record.channel_id] += 1
                    times.append(record.log_time)
            if times:
                index.segments.append(_Segment(min(times), number, offset, len(data)))
                latest_ns = max(latest_ns, *times)
    except _DAMAGE:
        walk.is_complete = False
    if not walk.is_complete:
        index.remark = (
            f'{path.name} is incomplete, as after a crash of the recorder: recovered '
            f'{index.counts.total()} messages'
        )
        if latest_ns:
            index.remark += f', up to {latest_ns // 10**9}.{latest_ns % 10**9:09d} s'
        index.remark += f'; the rest is damaged, from byte {walk.offset} on'
    return index


class _Walk:
    """The data records of a file, one chunk or about 1 MiB of loose records at a time."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream
        self._size = stream.seek(0, 2)
        self.offset = len(MAGIC)
        self.is_complete = False

    def segments(self) -> Iterator[tuple[int, bytes]]:
        """Yield offset and bytes.

        Afterwards `is_complete` tells whether the data had an end, `offset` where they break off.
        """
        offset = start = len(MAGIC)
        while True:
            self.offset = offset
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


def _read_records(data: bytes) -> Iterator[McapRecord]:
    """Yield the records in `data`, those of chunks included; a wrong checksum raises."""
    reader = StreamReader(BytesIO(data), skip_magic=True, validate_crcs=True, emit_chunks=True)
    try:
        for record in reader.records:
            if isinstance(record, Chunk):
                yield from breakup_chunk(_unpacked(record), validate_crc=True)
            else:
                yield record
    except EndOfFile:
        return


def _unpacked(chunk: Chunk) -> Chunk:
    """Return a chunk whose data are plain, or can be unpacked to what it says itself.

    Raises:
        TooMuchError: it unpacks to more than `CHUNK_MB`, whatever it says.
    """
    most = bound('CHUNK_MB') << 20
    size = chunk.uncompressed_size
    if chunk.compression == 'zstd':
        size = max(size, zstandard.frame_content_size(chunk.data))
    elif chunk.compression == 'lz4' and size <= most:
        data = LZ4FrameDecompressor().decompress(chunk.data, max_length=most + 1)
        chunk, size = replace(chunk, compression='', data=data), len(data)
    require_within(size / (1 << 20), 'CHUNK_MB', 'chunk size in MB')
    return chunk


def _describe(channel: Channel, schemas: dict[int, Schema]) -> tuple[str, str, str]:
    schema = schemas.get(channel.schema_id)
    kind = short_type(schema.name) if schema else ''
    return channel.topic, kind, channel.message_encoding
