"""Records of MCAP files: chunks that unpack within bounds, checksums that are as stated.

Every checksum that a recorder wrote is compared: of a chunk when it is unpacked, of the data
section where a file is walked through, of the summary before its index is believed.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator
from io import BytesIO
from typing import IO, NamedTuple

import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Schema
from mcap.stream_reader import CRCValidationError

from sgp_ros.recordings.unpacking import Unpacking
from sgp_ros.strangers import require_within

MAGIC = b'\x89MCAP0\r\n'
DAMAGE = (
    McapError, struct.error, ValueError, RuntimeError, KeyError, TypeError, AttributeError,
    IndexError, OverflowError, MemoryError, EOFError, zstandard.ZstdError,
)  # fmt: skip
"""Exceptions from reading damaged records."""

_LOOSE_BYTES, _BLOCK_BYTES = 1 << 20, 1 << 16
_LEAST_RUN, _MANY = 8, 4096
"""Records that are looked at, and counted, at once."""
_RECORD_HEAD, _MESSAGE_HEAD = struct.Struct('<BQ'), struct.Struct('<H4xQ8x')
SOUND, DAMAGED, MISSING = 'sound', 'damaged', 'missing'
_HEADS = np.dtype({
    'names': ['channel', 'log_ns'], 'formats': ['<u2', '<u8'], 'itemsize': 31,
    'offsets': [_RECORD_HEAD.size, _RECORD_HEAD.size + 6],
})  # fmt: skip
"""Of a message and its record."""
_FOOTER = struct.Struct('<BQQQI')
_DATA_END = struct.Struct('<BQI')


class Messages(NamedTuple):
    """Messages one after the other: their channels, their log times [ns], their contents."""

    channels: list[int]
    log_ns: list[int]
    contents: list[bytes]


class Stamps(NamedTuple):
    """Heads of some messages: channels and log times [ns], (n,)."""

    channels: np.ndarray
    log_ns: np.ndarray


_READERS: dict[int, Callable[[ReadDataStream], Schema | Channel]] = {
    Opcode.SCHEMA: Schema.read, Opcode.CHANNEL: Channel.read,
}  # fmt: skip


_WALKED = (Opcode.MESSAGE, Opcode.CHUNK, *_READERS)
"""Records whose content is looked at."""


def require_chunk(size: int) -> None:
    """Refuse to read more at once than a chunk may hold, before it is read.

    Raises:
        TooMuchError: more than `CHUNK_MB`.
    """
    require_within(size / (1 << 20), 'CHUNK_MB', 'size of a record or an index in MB')


class _Run:
    """Finds how many messages of one length stand one after the other."""

    def __init__(self) -> None:
        self._before, self._look = (0, 0), _LEAST_RUN

    def length(self, head: tuple[int, int], data: bytes, begin: int) -> int:
        """Return how many records from a byte on have the kind and length of `head`; at least 1.

        They are looked at once two of them were seen, the more the longer the run is.
        """
        is_second, self._before = head == self._before, head
        size = _RECORD_HEAD.size + head[1]
        most = min((len(data) - begin) // size, self._look)
        if head[0] != Opcode.MESSAGE or not is_second or most < 2:
            return 1
        heads = np.frombuffer(data, np.uint8, most * size, begin).reshape(most, size)
        is_other = (heads[:, : _RECORD_HEAD.size] != heads[0, : _RECORD_HEAD.size]).any(axis=1)
        count = int(is_other.argmax()) if is_other.any() else most
        self._look = min(2 * self._look, _MANY) if count >= self._look else _LEAST_RUN
        return count


class Walk:
    """The data records of a file, one chunk or about 1 MiB of loose records at a time."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream
        self._size = stream.seek(0, 2)
        self.offset = len(MAGIC)
        self.is_complete = False
        self._sum = zlib.crc32(MAGIC)
        self._stated_sum = 0
        self._start, self._block = 0, b''

    def segments(self) -> Iterator[tuple[int, bytes]]:
        """Yield offset and bytes.

        Afterwards `is_complete` tells whether the data had an end, `offset` where they break off.
        """
        offset = start = len(MAGIC)
        run = _Run()
        while True:
            self.offset = offset
            opcode, length = self._head(offset)
            count = run.length((opcode, length), self._block, offset - self._start)
            end = offset + count * (_RECORD_HEAD.size + length)
            is_end = opcode in {0, Opcode.DATA_END, Opcode.FOOTER} or end > self._size
            if start < offset and (is_end or opcode == Opcode.CHUNK or end - start > _LOOSE_BYTES):
                yield start, self._read(start, offset)
                start = offset
            if is_end:
                self.is_complete = opcode in {Opcode.DATA_END, Opcode.FOOTER}
                if opcode == Opcode.DATA_END and length == _DATA_END.size - _RECORD_HEAD.size:
                    self._stated_sum = _DATA_END.unpack(self._at(offset, end))[2]
                return
            if opcode == Opcode.CHUNK:
                yield start, self._read(start, end)
                start = end
            elif opcode not in _WALKED and end - offset > _LOOSE_BYTES:
                if start < offset:
                    yield start, self._read(start, offset)
                self._pass(offset, end)
                start = end
            offset = end

    @property
    def is_sound(self) -> bool:
        """Whether the data walked through have the checksum that the file states, if any."""
        return self._stated_sum in {0, self._sum}

    def _head(self, offset: int) -> tuple[int, int]:
        """Return kind and length of the record there; 0 and 0 at the end of the file."""
        place = offset - self._start
        if not 0 <= place <= len(self._block) - _RECORD_HEAD.size:
            self._start, place = offset, 0
            self._block = self._at(offset, offset + _BLOCK_BYTES)
        if len(self._block) < _RECORD_HEAD.size:
            return 0, 0
        opcode, length = _RECORD_HEAD.unpack_from(self._block, place)
        return opcode, length

    def _read(self, start: int, end: int) -> bytes:
        require_chunk(end - start)
        data = self._at(start, end)
        self._sum = zlib.crc32(data, self._sum)
        return data

    def _pass(self, start: int, end: int) -> None:
        """Add to the checksum what nobody needs, such as an attachment of any size."""
        for place in range(start, end, _LOOSE_BYTES):
            self._sum = zlib.crc32(self._at(place, min(place + _LOOSE_BYTES, end)), self._sum)

    def _at(self, start: int, end: int) -> bytes:
        self._stream.seek(start)
        return self._stream.read(end - start)


def state_of_summary(stream: IO[bytes]) -> str:
    """Return `SOUND`, `DAMAGED` or, where there is no footer that has one, `MISSING`.

    The footer states the checksum of all from the first record of the summary to itself; 0 stands
    for none.
    """
    stream.seek(-(_FOOTER.size + len(MAGIC)), 2)
    place = stream.tell()
    opcode, length, start, _, stated = _FOOTER.unpack(stream.read(_FOOTER.size))
    if opcode != Opcode.FOOTER or length != _FOOTER.size - _RECORD_HEAD.size:
        return MISSING
    if stream.read() != MAGIC or not (start == 0 or len(MAGIC) <= start <= place):
        return DAMAGED
    begin, end, found = start or place, place + _FOOTER.size - 4, 0
    require_chunk(end - begin)
    stream.seek(begin)
    while stated and begin < end:
        data = stream.read(min(_LOOSE_BYTES, end - begin))
        begin, found = begin + len(data), zlib.crc32(data, found)
    if stated != found:
        return DAMAGED
    return SOUND if start else MISSING


def read_records(data: bytes, unpacking: Unpacking) -> Iterator[Schema | Channel | Messages]:
    """Yield schemas, channels and messages of complete records, those in chunks included.

    Args:
        data: of one segment.
        unpacking: bounds what chunks unpack to, and the number of records.

    Raises:
        TooMuchError: beyond `CHUNK_MB`, `MESSAGES` or `RATIO`.
        McapError: a wrong checksum, or bytes that are not a record; others of `DAMAGE`.
    """
    for found, begin, size, number in _runs(data, unpacking):
        if isinstance(found, bytes) and number == 1:
            channel, log_ns = _MESSAGE_HEAD.unpack_from(found, begin + _RECORD_HEAD.size)
            yield Messages([channel], [log_ns], [found[begin + _HEADS.itemsize : begin + size]])
        elif isinstance(found, bytes):
            stamps = _stamps(found, begin, size, number)
            starts = range(begin, begin + number * size, size)
            contents = [found[start + _HEADS.itemsize : start + size] for start in starts]
            yield Messages(stamps.channels.tolist(), stamps.log_ns.tolist(), contents)
        else:
            yield found


def read_stamps(data: bytes, unpacking: Unpacking) -> Iterator[Schema | Channel | Stamps]:
    """Yield the same, of messages only what their heads say, many at once."""
    for found, begin, size, number in _runs(data, unpacking):
        if isinstance(found, bytes):
            yield _stamps(found, begin, size, number)
        else:
            yield found


def _stamps(data: bytes, begin: int, size: int, number: int) -> Stamps:
    rows = np.frombuffer(data, np.uint8, number * size, begin).reshape(number, size)
    heads = np.ascontiguousarray(rows[:, : _HEADS.itemsize]).view(_HEADS)[:, 0]
    return Stamps(heads['channel'], heads['log_ns'])


def _runs(
    data: bytes, unpacking: Unpacking, *, is_chunk: bool = False
) -> Iterator[tuple[bytes | Schema | Channel, int, int, int]]:
    """Yield runs of messages of one length, or a schema or channel.

    Of a run the bytes that hold it, its first byte, the length of a record, the number of them.
    """
    end, number, run = 0, 0, _Run()
    while end < len(data):
        head = _RECORD_HEAD.unpack_from(data, end)
        opcode, length = head
        begin, size = end, _RECORD_HEAD.size + length
        if opcode == 0 or begin + size > len(data):
            raise McapError(f'no record at byte {begin} of it')
        count = run.length(head, data, begin)
        end = begin + count * size
        if opcode == Opcode.MESSAGE:
            if length < _MESSAGE_HEAD.size:
                raise McapError(f'a message of {length} bytes at byte {begin} of it')
            yield data, begin, size, count
        elif opcode in _READERS:
            content = data[begin + _RECORD_HEAD.size : end]
            yield _READERS[opcode](ReadDataStream(BytesIO(content))), 0, 0, 1
        elif opcode == Opcode.CHUNK and not is_chunk:
            chunk = Chunk.read(ReadDataStream(BytesIO(data[begin + _RECORD_HEAD.size : end])))
            yield from _runs(_plain(chunk, unpacking), unpacking, is_chunk=True)
        number += count
        if number >= _MANY:
            unpacking.count_messages(number)
            number = 0
    unpacking.count_messages(number)


def _plain(chunk: Chunk, unpacking: Unpacking) -> bytes:
    data = chunk.data
    if chunk.compression:
        data = unpacking.unpacked(chunk.compression, data)
    if len(data) != chunk.uncompressed_size:
        raise McapError(f'a chunk of {len(data)} bytes that states {chunk.uncompressed_size}')
    if chunk.uncompressed_crc not in {0, zlib.crc32(data)}:
        raise CRCValidationError(chunk.uncompressed_crc, zlib.crc32(data), chunk)
    return data
