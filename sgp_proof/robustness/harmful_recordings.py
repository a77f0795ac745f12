"""Recordings made to harm who reads them."""

from __future__ import annotations

import bz2
import os
import sqlite3
import struct
from collections.abc import Callable
from functools import partial
from pathlib import Path

import lz4.frame
import numpy as np
import zstandard
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.typesys import Stores, get_typestore

Make = Callable[[Path], object]
_MAGIC = b'\x89MCAP0\r\n'
_LARGE = 300 << 20
"""Bytes that a bomb unpacks to, beyond the bound of a chunk."""
_COMPRESSION = Ros1Writer.CompressionFormat


def _record(opcode: int, content: bytes) -> bytes:
    return struct.pack('<BQ', opcode, len(content)) + content


def _chunk(packed: bytes, size: int, kind: bytes = b'zstd') -> bytes:
    head = struct.pack('<QQQII', 0, 1, size, 0, len(kind)) + kind
    return _record(6, head + struct.pack('<Q', len(packed)) + packed)


def _text(text: bytes) -> bytes:
    return struct.pack('<I', len(text)) + text


_CHANNEL = _record(
    3, struct.pack('<H', 1) + _text(b'sensor_msgs/msg/JointState') + _text(b'ros2msg') + _text(b'')
) + _record(
    4, struct.pack('<HH', 1, 1) + _text(b'/joint_states') + _text(b'cdr') + struct.pack('<I', 0)
)


def _message(content: bytes, log_ns: int = 1) -> bytes:
    return _record(5, struct.pack('<HIQQ', 1, 0, log_ns, log_ns) + content)


def bomb(path: Path, size: int, kind: bytes = b'zstd', pack: Make = zstandard.compress) -> None:
    """Write a chunk that says little of what it unpacks to."""
    path.write_bytes(_MAGIC + _chunk(pack(bytes(size)), 100, kind))


def tiny_messages(path: Path, n: int, chunks: int = 20) -> None:
    """Write chunks full of messages without content, a few bytes each."""
    content = _message(b'') * (n // chunks)
    chunk = _chunk(zstandard.compress(content), len(content))
    path.write_bytes(_MAGIC + _CHANNEL + chunk * chunks)


def noisy_messages(path: Path, n: int, chunks: int = 20) -> None:
    """Write messages without content that pack badly, so that the ratio is an honest one."""
    kinds = [('opcode', 'u1'), ('length', '<u8'), ('channel', '<u2'), ('sequence', '<u4'),
             ('log', '<u8'), ('publish', '<u8')]  # fmt: skip
    rows = np.zeros(n // chunks, dtype=kinds)
    rows['opcode'], rows['length'], rows['channel'] = 5, 22, 1
    rng = np.random.default_rng(0)
    with path.open('wb') as stream:
        stream.write(_MAGIC + _CHANNEL)
        for _ in range(chunks):
            rows['sequence'] = rng.integers(1 << 32, size=len(rows))
            rows['log'] = rng.integers(1 << 16, size=len(rows))
            content = rows.tobytes()
            stream.write(_chunk(zstandard.compress(content), len(content)))


def same_time(path: Path, n: int) -> None:
    """Write messages, uncompressed, none of which may be let go before the last."""
    content = _message(bytes(1000), 7) * 1000
    path.write_bytes(_MAGIC + _CHANNEL + _chunk(content, len(content), b'') * (n // 1000))


def liar(path: Path) -> None:
    """Write joint states that state four billion names."""
    content = b'\x00\x01\x00\x00' + struct.pack('<iIII', 1, 0, 0, 0xFFFFFFFF)
    path.write_bytes(_MAGIC + _CHANNEL + _message(content) * 100)


def view(path: Path) -> None:
    """Write a database whose messages never end."""
    with sqlite3.connect(path) as base:
        base.execute('CREATE TABLE topics(id, name, type, serialization_format)')
        base.execute('CREATE VIEW messages AS WITH RECURSIVE m(id, topic_id, timestamp, data) AS '
                     "(SELECT 1, 1, 1, x'00' UNION ALL SELECT id + 1, 1, 1, data FROM m) "
                     'SELECT * FROM m')  # fmt: skip
    base.close()


def tables(path: Path, columns: str, *keys: int) -> None:
    """Write a database with those columns beside the usual ones, and topics of those keys."""
    with sqlite3.connect(path) as base:
        base.execute('CREATE TABLE topics(id, name, type, serialization_format)')
        base.execute(f'CREATE TABLE messages(id, topic_id, timestamp, {columns})')
        query = (
            "INSERT INTO topics VALUES(?, '/joint_states', 'sensor_msgs/msg/JointState', 'cdr')"
        )
        base.executemany(query, [(key,) for key in keys])
    base.close()


def messages_of(path: Path, content: str, n: int = 1, stamp: str = 'x') -> None:
    """Write a database with n messages, content and stamp by an SQL expression of x, 1 to n."""
    tables(path, 'data', 1)
    with sqlite3.connect(path) as base:
        base.execute(
            'WITH RECURSIVE i(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM i LIMIT ?) '
            f'INSERT INTO messages SELECT {stamp}, 1, {stamp}, {content} FROM i',
            (n,),
        )
    base.close()


def packed_directory(path: Path, make: Make, name: str = 'x_0.db3') -> None:
    """Write a rosbag2 directory with one compressed file."""
    path.mkdir()
    make(path / name)
    packed = zstandard.compress((path / name).read_bytes())
    (path / f'{name}.zstd').write_bytes(packed)
    (path / name).unlink()


def zeros(path: Path, size: int) -> None:
    """Write zeros."""
    path.write_bytes(bytes(size))


def piped_directory(path: Path) -> None:
    """Write a rosbag2 directory with a pipe."""
    path.mkdir()
    os.mkfifo(path / 'x_0.mcap')


def deep_directory(path: Path) -> None:
    """Write a rosbag2 directory with deep metadata."""
    path.mkdir()
    liar(path / 'x_0.mcap')
    (path / 'metadata.yaml').write_text('[' * 3000)


def ros1(
    path: Path, kind: _COMPRESSION | None, pack: Callable[[bytes], bytes], n: int = 1
) -> None:
    """Write a ROS 1 bag of n messages without content whose chunks are what `pack` makes."""
    store = get_typestore(Stores.ROS1_NOETIC)
    state = store.types['sensor_msgs/msg/JointState'].__msgtype__
    writer = Ros1Writer(path)
    if kind is not None:
        writer.set_compression(kind)
        writer.compressor = pack
    with writer:
        connection = writer.add_connection('/joint_states', state, typestore=store)
        for stamp in range(n):
            writer.write(connection, stamp, b'')


def sparse(path: Path, opcode: int = 5, head: bytes = _MAGIC) -> None:
    """Write one record of 2.5 GB that takes no room on the disk."""
    size = 5 << 29
    path.write_bytes(head + struct.pack('<BQ', opcode, size))
    os.truncate(path, len(head) + 9 + size)


def sparse_ros1(path: Path) -> None:
    """Write a ROS 1 bag whose first header has 2.5 GB, on no disk."""
    path.write_bytes(b'#ROSBAG V2.0\n' + struct.pack('<I', 5 << 29))
    os.truncate(path, 6 << 29)


def _endless_line(path: Path) -> None:
    path.write_bytes(b'#ROSBAG V2.0')
    os.truncate(path, 5 << 29)


def _device(path: Path) -> None:
    path.symlink_to('/dev/zero')


PIPES: dict[str, Make] = {'pipe': os.mkfifo, 'device': _device}
RECORDINGS: dict[str, Make] = {
    'bomb.mcap': partial(bomb, size=_LARGE),
    'lz4.mcap': partial(bomb, size=_LARGE, kind=b'lz4', pack=lz4.frame.compress),
    'tiny.mcap': partial(tiny_messages, n=8_000_000),
    'noisy.mcap': partial(noisy_messages, n=4_000_000),
    'one_chunk.mcap': partial(tiny_messages, n=4_000_000, chunks=1),
    'loose.mcap': lambda path: path.write_bytes(_MAGIC + _CHANNEL + _message(b'') * 3_000_000),
    'same_time.mcap': partial(same_time, n=300_000),
    'liar.mcap': liar,
    'sparse.mcap': sparse,
    'sparse_chunk.mcap': partial(sparse, opcode=6),
    'sparse_behind.mcap': partial(sparse, head=_MAGIC + _CHANNEL),
    'sparse.bag': sparse_ros1,
    'line.bag': _endless_line,
    'zeros.mcap': lambda path: path.write_bytes(_MAGIC + bytes(1 << 20)),
    'view.db3': view,
    'twice.db3': lambda path: tables(path, 'data', 1, 1),
    'computed.db3': lambda path: tables(path, 'data AS (zeroblob(9e8))', 1),
    'types.db3': partial(messages_of, content="'text'"),
    'bz2.bag': lambda path: ros1(path, _COMPRESSION.BZ2, lambda _: bz2.compress(bytes(_LARGE))),
    'lz4.bag': lambda path: ros1(
        path, _COMPRESSION.LZ4, lambda _: lz4.frame.compress(bytes(_LARGE))),
    'packed': partial(packed_directory, make=partial(zeros, size=_LARGE)),
    'packed_rows': partial(
        packed_directory, make=partial(messages_of, content="x''", n=4_000_000)),
    'packed_message': partial(
        packed_directory, make=partial(messages_of, content=f'zeroblob({_LARGE})')),
    'packed_twice': partial(
        packed_directory, make=partial(bomb, size=250 << 20), name='x_0.mcap'),
    'piped': piped_directory, 'deep': deep_directory, 'empty': Path.mkdir,
    **{f'{name}.mcap': make for name, make in PIPES.items()},
}  # fmt: skip
"""Name to what writes the file."""
