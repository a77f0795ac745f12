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

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Schema
from mcap.stream_reader import CRCValidationError

from sgp_ros.recordings.unpacking import Unpacking

MAGIC = b'\x89MCAP0\r\n'
DAMAGE = (
    McapError, struct.error, ValueError, RuntimeError, KeyError, TypeError, AttributeError,
    IndexError, OverflowError, MemoryError, EOFError, zstandard.ZstdError,
)  # fmt: skip
"""What reading damaged records raises."""

_LOOSE_BYTES, _BLOCK_BYTES = 1 << 20, 1 << 16
_MANY = 4096
"""Records that are counted at once."""
_RECORD_HEAD, _MESSAGE_HEAD = struct.Struct('<BQ'), struct.Struct('<H4xQ8x')
SOUND, DAMAGED, MISSING = 'sound', 'damaged', 'missing'
_FOOTER = struct.Struct('<BQQQI')
_DATA_END = struct.Struct('<BQI')


class Message(NamedTuple):
    """What a record of a message says: its channel, its log time [ns], its content."""

    channel_id: int
    log_time: int
    data: bytes


Record = Schema | Channel | Message
_READERS: dict[int, Callable[[ReadDataStream], Record]] = {
    Opcode.SCHEMA: Schema.read, Opcode.CHANNEL: Channel.read,
}  # fmt: skip


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
        while True:
            self.offset = offset
            opcode, length = self._head(offset)
            end = offset + _RECORD_HEAD.size + length
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
        data = self._at(start, end)
        self._sum = zlib.crc32(data, self._sum)
        return data

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
    stream.seek(begin)
    while stated and begin < end:
        data = stream.read(min(_LOOSE_BYTES, end - begin))
        begin, found = begin + len(data), zlib.crc32(data, found)
    if stated != found:
        return DAMAGED
    return SOUND if start else MISSING


def read_records(data: bytes, unpacking: Unpacking, *, is_chunk: bool = False) -> Iterator[Record]:
    """Yield schemas, channels and messages of complete records, those in chunks included.

    Args:
        data: of one segment.
        unpacking: bounds what chunks unpack to, and the number of records.
        is_chunk: whether they are the content of a chunk, where there are no others.

    Raises:
        TooMuchError: beyond `CHUNK_MB`, `MESSAGES` or `RATIO`.
        McapError: a wrong checksum, or what is no record; others of `DAMAGE`.
    """
    end = number = 0
    while end < len(data):
        number += 1
        if number == _MANY:
            unpacking.count_messages(number)
            number = 0
        opcode, length = _RECORD_HEAD.unpack_from(data, end)
        start, end = end + _RECORD_HEAD.size, end + _RECORD_HEAD.size + length
        if opcode == 0 or end > len(data):
            raise McapError(f'no record at byte {start - _RECORD_HEAD.size} of it')
        if opcode == Opcode.MESSAGE:
            channel, log_ns = _MESSAGE_HEAD.unpack_from(data, start)
            yield Message(channel, log_ns, data[start + _MESSAGE_HEAD.size : end])
        elif opcode in _READERS:
            yield _READERS[opcode](ReadDataStream(BytesIO(data[start:end])))
        elif opcode == Opcode.CHUNK and not is_chunk:
            chunk = Chunk.read(ReadDataStream(BytesIO(data[start:end])))
            yield from read_records(_plain(chunk, unpacking), unpacking, is_chunk=True)
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
