"""Unpacking of what strangers compressed, within bounds of size and ratio."""

from __future__ import annotations

import bz2
import io
from collections.abc import Callable
from pathlib import Path

import zstandard
from lz4.frame import LZ4FrameDecompressor

from sgp_ros.strangers import bound, require_within

_MEGABYTE = 1 << 20
_OBJECT = 1000
"""Bytes that a message counts beside its content, for what is made of it."""
_FREE = 16 * _MEGABYTE
"""Bytes that may be unpacked at any ratio: a short recording of a dark camera."""


def _unzstd(data: bytes, most: int) -> bytes:
    size = zstandard.frame_content_size(data)  # -1 where it is not stated
    require_within(size / _MEGABYTE, 'CHUNK_MB', 'size of compressed data in MB')
    with zstandard.ZstdDecompressor().stream_reader(io.BytesIO(data)) as stream:
        return stream.read(most if size < 0 else size)


_KINDS: dict[str, Callable[[bytes, int], bytes]] = {
    'zstd': _unzstd,
    'lz4': lambda data, most: LZ4FrameDecompressor().decompress(data, max_length=most),
    'bz2': lambda data, most: bz2.BZ2Decompressor().decompress(data, most),
}


class Unpacking:
    """One pass over a recording: how much was made of how much.

    Args:
        size: of its files, as they were before anything was unpacked [bytes].
    """

    def __init__(self, size: int) -> None:
        self._size = size
        self._unpacked = self._messages = 0

    def count(self, unpacked: int) -> None:
        """Add a number of bytes.

        Raises:
            TooMuchError: altogether more than `RATIO` for each byte of the recording.
        """
        self._unpacked += unpacked
        if self._unpacked > _FREE:
            ratio = self._unpacked / max(self._size, 1)
            require_within(ratio, 'RATIO', 'ratio of the unpacked size to the compressed one')

    def count_messages(self, number: int) -> None:
        """Add a number of messages or other records.

        Raises:
            TooMuchError: altogether more than `MESSAGES`, or than fits the `RATIO`.
        """
        self._messages += number
        require_within(self._messages, 'MESSAGES', 'number of messages')
        self.count(number * _OBJECT)

    def unpacked(self, kind: str, data: bytes) -> bytes:
        """Return what data of kind `zstd`, `lz4` or `bz2` unpack to.

        Raises:
            TooMuchError: more than `CHUNK_MB` at once, whatever they say, or `RATIO` altogether.
        """
        most = bound('CHUNK_MB') * _MEGABYTE
        found = _KINDS[kind](data, most + 1)
        require_within(len(found) / _MEGABYTE, 'CHUNK_MB', 'size of compressed data in MB')
        self.count(len(found))
        return found

    def unpack_file(self, path: Path, out: Path) -> None:
        """Write what a file of kind `zstd` unpacks to.

        Raises:
            TooMuchError: more than `RATIO` altogether.
            zstandard.ZstdError: a damaged file.
        """
        unpacker = zstandard.ZstdDecompressor()
        with path.open('rb') as source, out.open('xb') as target:
            for data in unpacker.read_to_iter(source, write_size=_MEGABYTE):
                self.count(len(data))
                target.write(data)
