"""Messages of a ROS 1 bag without its index, which stands at the end, up to its damage."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import suppress
from io import BytesIO
from typing import BinaryIO, NamedTuple

from rosbags.rosbag1.reader import Header, ReaderError, RecordType, normalize, read_uint32

from sgp_ros.recordings.typestore import short_type
from sgp_ros.recordings.unpacking import Unpacking

DAMAGE = (
    ReaderError, struct.error, ValueError, KeyError, RuntimeError, EOFError, OSError,
    AssertionError,
)  # fmt: skip
"""Exceptions from reading damaged records; bz2 raises an OSError."""


class Found(NamedTuple):
    """A message.

    Attributes:
        topic: its name.
        type: its short type.
        log_ns: time of logging [ns].
        data: the message.
    """

    topic: str
    type: str
    log_ns: int
    data: bytes


def walk(stream: BinaryIO, unpacking: Unpacking) -> Iterator[Found]:
    """Yield the messages in the order of the file, up to the first record that is not whole.

    Raises:
        TooMuchError: chunks that unpack to more than `CHUNK_MB` or `RATIO`.
    """
    topics: dict[int, tuple[str, str]] = {}
    stream.readline()
    with suppress(*DAMAGE):
        for head, data in _records(stream):
            if head.get_uint8('op') == RecordType.CHUNK:
                kind = head.get_string('compression')
                plain = data if kind == 'none' else unpacking.unpacked(kind, data)
                yield from _messages(BytesIO(plain), topics)


def _records(stream: BinaryIO) -> Iterator[tuple[Header, bytes]]:
    """Yield heads and contents; the last content may be cut off."""
    while True:
        head = Header.read(stream)
        size = read_uint32(stream)
        data = stream.read(size)
        yield head, data
        if len(data) < size:
            return


def _messages(chunk: BinaryIO, topics: dict[int, tuple[str, str]]) -> Iterator[Found]:
    """Yield the messages of a chunk; connections are added to the topics."""
    with suppress(*DAMAGE):
        while True:
            head = Header.read(chunk)
            key, kind = head.get_uint32('conn'), head.get_uint8('op')
            if kind == RecordType.CONNECTION:
                described = Header.read(chunk).get_string('type')
                topics[key] = normalize(head.get_string('topic')), short_type(described)
                continue
            size = read_uint32(chunk)
            data = chunk.read(size)
            if kind != RecordType.MSGDATA or len(data) < size:
                return
            yield Found(*topics[key], head.get_time('time'), data)
