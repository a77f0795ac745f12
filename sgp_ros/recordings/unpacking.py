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
    """One pass over a recording: how much of it was unpacked, out of how much."""

    def __init__(self) -> None:
        self._packed = self._unpacked = 0

    def count(self, packed: int, unpacked: int) -> None:
        """Add numbers of bytes.

        Raises:
            TooMuchError: altogether more than `RATIO` unpacked for each compressed one.
        """
        self._packed += packed
        self._unpacked += unpacked
        if self._unpacked > _FREE:
            ratio = self._unpacked / max(self._packed, 1)
            require_within(ratio, 'RATIO', 'ratio of the unpacked size to the compressed one')

    def unpacked(self, kind: str, data: bytes) -> bytes:
        """Return what data of kind `zstd`, `lz4` or `bz2` unpack to.

        Raises:
            TooMuchError: more than `CHUNK_MB` at once, whatever they say, or `RATIO` altogether.
        """
        most = bound('CHUNK_MB') * _MEGABYTE
        found = _KINDS[kind](data, most + 1)
        require_within(len(found) / _MEGABYTE, 'CHUNK_MB', 'size of compressed data in MB')
        self.count(len(data), len(found))
        return found

    def unpack_file(self, path: Path, out: Path) -> None:
        """Write what a file of kind `zstd` unpacks to.

        Raises:
            TooMuchError: more than `RATIO` altogether.
            zstandard.ZstdError: a damaged file.
        """
        with path.open('rb') as source, out.open('xb') as target:
            taken = 0
            with zstandard.ZstdDecompressor().stream_reader(source) as stream:
                while data := stream.read(_MEGABYTE):
                    self.count(source.tell() - taken, len(data))
                    taken = source.tell()
                    target.write(data)
