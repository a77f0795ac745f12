"""Records of MCAP files: chunks that unpack within bounds, checksums that are as stated.

Every checksum that a recorder wrote is compared: of a chunk when it is unpacked, of the data
section where a file is walked through, of the summary before its index is believed.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import replace
from io import BytesIO
from typing import IO

import zstandard
from lz4.frame import LZ4FrameDecompressor
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import Chunk, McapRecord
from mcap.stream_reader import StreamReader, breakup_chunk

from sgp_ros.strangers import bound, require_within

MAGIC = b'\x89MCAP0\r\n'
DAMAGE = (
    McapError, struct.error, ValueError, RuntimeError, KeyError, TypeError, AttributeError,
    IndexError, OverflowError, MemoryError, EOFError, zstandard.ZstdError,
)  # fmt: skip
"""What reading damaged records raises."""

_LOOSE_BYTES = 1 << 20
_RECORD_HEAD = struct.Struct('<BQ')
SOUND, DAMAGED, MISSING = 'sound', 'damaged', 'missing'
_FOOTER = struct.Struct('<BQQQI')
_DATA_END = struct.Struct('<BQI')


class Walk:
    """The data records of a file, one chunk or about 1 MiB of loose records at a time."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream
        self._size = stream.seek(0, 2)
        self.offset = len(MAGIC)
        self.is_complete = False
        self._sum = zlib.crc32(MAGIC)
        self._stated_sum = 0

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


def read_records(data: bytes) -> Iterator[McapRecord]:
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
