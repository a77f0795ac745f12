"""The fuzzer of files, short and with fixed seeds, and files made to harm."""

from __future__ import annotations

import bz2
import os
import re
import sqlite3
import struct
import subprocess
import sys
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.typesys import Stores, get_typestore
from scipy.io import savemat

from sgp_proof.robustness import files
from sgp_proof.robustness.events import Faults
from sgp_ros import strangers
from sgp_ros.apps.replay import load_truth
from sgp_ros.engine.samples import JointSample
from sgp_ros.errors import SgpError
from sgp_ros.recordings.model_files import load_model, load_parameters
from sgp_ros.recordings.reader import open_recording
from sgp_ros.recordings.table_files import load_columns
from sgp_ros.recordings.unpacking import Unpacking
from sgp_ros.recordings.writer import RecordingWriter
from sgp_ros.rigid.urdf_text import parse_urdf
from sgp_ros.robots.gains import read_gains
from sgp_ros.robots.registry import load_robot


@pytest.fixture(scope='module')
def samples(tmp_path_factory):
    return files.make_samples(tmp_path_factory.mktemp('samples'))


def test_intact_files_are_read(samples):
    for kind, path in samples.items():
        files.read(kind, path)


def test_damaged_files_are_read_or_refused_in_one_line(samples, tmp_path):
    """Seeds of the formats that are read in this process."""
    faults = Faults()
    others = {kind: path for kind, path in samples.items() if kind not in files.APART}
    outcomes = [files.run(seed, others, tmp_path, faults)[1] for seed in range(120)]
    assert dict(faults) == {}
    assert {'read', 'refused'} == set(outcomes)


def _long_urdf(path, n=5000):
    links = ''.join(f'<link name="l{i}"/>' for i in range(n + 1))
    joints = ''.join(
        f'<joint name="j{i}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/>'
        '<axis xyz="0 0 1"/></joint>'
        for i in range(n)
    )
    path.write_text(f'<robot name="x">{links}{joints}</robot>')


def _long_sdf(path, n=300):
    links = ''.join(f'<link name="l{i}"/>' for i in range(n))
    joint = '<joint name="j" type="revolute"><parent>l0</parent><child>l1</child></joint>'
    path.write_text(f'<sdf version="1.9"><model name="m">{links}{joint}</model></sdf>')


def _laughs(path):
    """Few aliases that stand for 43 million entries."""
    levels = [
        f'  a{i}: &a{i} {{' + ', '.join(f'k{j}: *a{i - 1}' for j in range(9)) + '}'
        for i in range(1, 9)
    ]
    path.write_text('\n'.join(['/**:', ' ros__parameters:', '  a0: &a0 {x: 1}', *levels]))


def _view(path):
    with sqlite3.connect(path) as base:
        base.execute('CREATE TABLE topics(id, name, type, serialization_format)')
        base.execute('CREATE VIEW messages AS WITH RECURSIVE m(id, topic_id, timestamp, data) AS '
                     "(SELECT 1, 1, 1, x'00' UNION ALL SELECT id + 1, 1, 1, data FROM m) "
                     'SELECT * FROM m')  # fmt: skip
    base.close()


def _bomb(path, kind=b'zstd', pack=zstandard.compress):
    """A chunk that says little of what it unpacks to."""
    packed = pack(bytes(1 << 21))
    body = struct.pack('<QQQII', 0, 1, 100, 0, len(kind)) + kind + struct.pack('<Q', len(packed))
    chunk = b'\x06' + struct.pack('<Q', len(body) + len(packed)) + body + packed
    path.write_bytes(b'\x89MCAP0\r\n' + chunk)


def _empty_messages(path):
    """A small file of several chunks, each full of messages without content."""
    message = b'\x05' + struct.pack('<QHIQQ', 22, 1, 0, 1, 1)
    packed = zstandard.compress(message * 30_000)
    body = (
        struct.pack('<QQQII', 1, 1, 31 * 30_000, 0, 4) + b'zstd' + struct.pack('<Q', len(packed))
    )
    chunk = b'\x06' + struct.pack('<Q', len(body) + len(packed)) + body + packed
    path.write_bytes(b'\x89MCAP0\r\n' + chunk * 20)


def _ros1_bomb(path, kind, pack):
    state = get_typestore(Stores.ROS1_NOETIC).types['sensor_msgs/msg/JointState'].__msgtype__
    writer = Ros1Writer(path)
    writer.set_compression(kind)
    writer.compressor = lambda _: pack(bytes(1 << 21))
    with writer:
        store = get_typestore(Stores.ROS1_NOETIC)
        writer.write(writer.add_connection('/joint_states', state, typestore=store), 1, b'')


def _packed_zeros(path):
    path.write_bytes(zstandard.compress(bytes(17 << 20)))


def _packed_directory(path):
    path.mkdir()
    _packed_zeros(path / 'x_0.db3.zstd')


def _piped_directory(path):
    path.mkdir()
    os.mkfifo(path / 'x_0.mcap')


def _tables(path, columns, *rows):
    with sqlite3.connect(path) as base:
        base.execute('CREATE TABLE topics(id, name, type, serialization_format)')
        base.execute(f'CREATE TABLE messages(id, topic_id, timestamp, {columns})')
        base.executemany("INSERT INTO topics VALUES(?, '/a', 'b', 'cdr')", [(r,) for r in rows])
    base.close()


def _xacro(path, text):
    path.write_text(f'<robot name="x" xmlns:xacro="http://www.ros.org/wiki/xacro">{text}</robot>')


def _zip(path):
    np.savez_compressed(path, t=np.zeros(1 << 18))


@pytest.mark.parametrize(
    ('name', 'make', 'read', 'says'),
    [
        ('x.urdf', _long_urdf, lambda p: load_robot(str(p)), 'SGP_MOST_LINKS'),
        ('deep.urdf', lambda p: p.write_text('<robot>' + '<a>' * 3000),
         lambda p: load_robot(str(p)), 'SGP_MOST_DEPTH'),
        ('deep.yaml', lambda p: p.write_text('[' * 3000), load_parameters, 'SGP_MOST_DEPTH'),
        ('many.yaml', lambda p: p.write_text('a: &a [1]\nb: [' + '*a,' * 200 + ']'),
         load_parameters, 'SGP_MOST_ALIASES'),
        ('x.db3', _view, open_recording, 'no plain tables'),
        ('x.mcap', _bomb, open_recording, 'SGP_MOST_CHUNK_MB'),
        ('lz4.mcap', lambda p: _bomb(p, b'lz4', lz4.frame.compress), open_recording,
         'SGP_MOST_CHUNK_MB'),
        ('zeros.mcap', lambda p: p.write_bytes(b'\x89MCAP0\r\n' + bytes(1 << 20)), open_recording,
         'damaged'),
        ('empty.mcap', _empty_messages, lambda p: list(open_recording(p).messages('/a')),
         'SGP_MOST_RATIO'),
        ('bz2.bag', lambda p: _ros1_bomb(p, Ros1Writer.CompressionFormat.BZ2, bz2.compress),
         lambda p: list(open_recording(p).events()), 'SGP_MOST_CHUNK_MB'),
        ('lz4.bag', lambda p: _ros1_bomb(p, Ros1Writer.CompressionFormat.LZ4, lz4.frame.compress),
         lambda p: list(open_recording(p).events()), 'SGP_MOST_CHUNK_MB'),
        ('packed', _packed_directory, open_recording, 'SGP_MOST_RATIO'),
        ('piped', _piped_directory, open_recording, 'not a regular file'),
        ('twice.db3', lambda p: _tables(p, 'data', 1, 1), open_recording, 'several topics'),
        ('computed.db3', lambda p: _tables(p, 'data AS (zeroblob(9e8))', 1), open_recording,
         'no plain tables'),
        ('laughs.yaml', _laughs, load_parameters, 'SGP_MOST_ENTRIES'),
        ('long.sdf', _long_sdf, lambda p: load_robot(str(p)), 'links of long.sdf'),
        ('sixty.yaml', lambda p: p.write_text('a: 1' + ':59' * 40_000), load_parameters,
         'SGP_MOST_LINE'),
        ('wide.jsonl', lambda p: p.write_text(
            ''.join(f'{{"c{i}": 1}}\n' for i in range(10_000))), lambda p: load_columns(p, []),
         'SGP_MOST_UNPACKED_MB'),
        ('circle.yaml', lambda p: p.write_text('/**:\n  ros__parameters: &p\n    a: *p\n'),
         load_parameters, 'stands for nothing'),
        ('date.yaml', lambda p: p.write_text('a: 2001-13-45'), load_parameters, 'month'),
        ('pipe.sdf', os.mkfifo, lambda p: load_robot(str(p)), 'nor a file'),
        ('pipe.yaml', os.mkfifo, lambda p: read_gains(p, (), ()), 'not a regular file'),
        ('pipe.json', os.mkfifo, load_truth, 'not a regular file'),
        ('deep.json', lambda p: p.write_text('[' * 3000), load_truth, 'cannot be read'),
        ('endless.xacro', lambda p: _xacro(p, '<link name="${9**9**9}"/>'),
         lambda p: load_robot(str(p)), 'SGP_MOST_SECONDS'),
        ('many.xml', lambda p: p.write_text(
            '<mujoco><worldbody><replicate count="1000000"><geom size="1"/>'
            '</replicate></worldbody></mujoco>'), lambda p: load_robot(str(p)), 'SGP_MOST_'),
        ('x.npz', _zip, lambda p: load_columns(p, []), 'SGP_MOST_UNPACKED_MB'),
        ('pipe.mcap', os.mkfifo, open_recording, 'not a regular file'),
        ('pipe.npz', os.mkfifo, load_model, 'not a regular file'),
        ('twice.csv', lambda p: p.write_text('t,q,q\n1,2,3\n'), lambda p: load_columns(p, []),
         'several columns named'),
        ('nul.csv', lambda p: p.write_text('t,q\n1,2\0\n'), lambda p: load_columns(p, []), 'NUL'),
        ('long.csv', lambda p: p.write_text('t,q\n1,' + '2' * 200_000),
         lambda p: load_columns(p, []), 'SGP_MOST_LINE'),
    ],
)  # fmt: skip
def test_files_made_to_harm_are_refused(tmp_path, monkeypatch, name, make, read, says):
    monkeypatch.setenv('SGP_MOST_CHUNK_MB', '1')
    monkeypatch.setenv('SGP_MOST_UNPACKED_MB', '1' if name == 'x.npz' else '200')
    monkeypatch.setenv('SGP_MOST_SECONDS', '2')
    path = tmp_path / name
    make(path)
    with pytest.raises(SgpError, match=says):
        read(path)


def test_every_bound_is_documented_with_its_default():
    page = (Path(__file__).parents[3] / 'docs' / 'security.md').read_text(encoding='utf-8')
    told = re.findall(r'`SGP_MOST_(\w+)` \| (\d+) \|', page)
    assert {name: int(default) for name, default in told} == strangers.DEFAULTS


def _of_depth(path):
    path.write_text('/**: {ros__parameters: {a: ' + '{a: ' * 120 + '1' + '}' * 120 + '}}')


def _small_bag(path):
    with RecordingWriter(path) as writer:
        for stamp in range(1, 5):
            writer.write_event(JointSample(stamp, ('hinge',), np.zeros(1)))


def _columns(path):
    return load_columns(path, [])


@pytest.mark.parametrize(
    ('bound', 'low', 'high', 'name', 'make', 'read'),
    [
        ('TEXT_MB', 0, 1, 'x.yaml', lambda p: p.write_text('/**: {ros__parameters: {}}'),
         load_parameters),
        ('TABLE_MB', 0, 1, 'x.csv', lambda p: p.write_text('t,q\n1,2\n'), _columns),
        ('UNPACKED_MB', 1, 3, 'x.npz', lambda p: np.savez(p, t=np.zeros(1 << 18)), _columns),
        ('UNPACKED_MB', 100, 768, 'x.mat', lambda p: savemat(p, {'t': np.zeros(1 << 24)},
         do_compression=True), _columns),
        ('CHUNK_MB', 0, 1, 'x.mcap', _small_bag, lambda p: list(open_recording(p).events())),
        ('RATIO', 10, 100_000, 'x.zstd', _packed_zeros,
         lambda p: Unpacking().unpack_file(p, p.parent / str(strangers.bound('RATIO')))),
        ('DEPTH', 100, 130, 'x.yaml', _of_depth, load_parameters),
        ('ENTRIES', 300, 800, 'x.yaml', lambda p: p.write_text(
            '/**: {ros__parameters: {a: [' + '1,' * 600 + ']}}'), load_parameters),
        ('ALIASES', 100, 300, 'x.yaml', lambda p: p.write_text(
            '/**: {ros__parameters: {a: &a 1.0, b: [' + '*a,' * 200 + ']}}'), load_parameters),
        ('LINKS', 3, 8, 'x.urdf', lambda p: _long_urdf(p, 5), parse_urdf),
        ('LINE', 10, 90, 'x.csv', lambda p: p.write_text('t,q\n1,' + '2' * 50 + '\n'), _columns),
        ('SECONDS', 0, 30, 'x.mat', lambda p: savemat(p, {'t': np.zeros(9)}), _columns),
    ],
)  # fmt: skip
def test_each_bound_may_be_raised(tmp_path, monkeypatch, bound, low, high, name, make, read):
    make(tmp_path / name)
    monkeypatch.setenv(f'SGP_MOST_{bound}', str(low))
    with pytest.raises(SgpError, match=f'SGP_MOST_{bound}'):
        read(tmp_path / name)
    monkeypatch.setenv(f'SGP_MOST_{bound}', str(high))
    read(tmp_path / name)


@pytest.mark.parametrize('kind', files.APART)
def test_a_file_that_ends_its_reader_ends_nothing_else(samples, monkeypatch, kind):
    """It is read in a process of its own, here by one that is killed at once."""
    monkeypatch.setattr(sys, 'executable', '/bin/false')
    with pytest.raises(SgpError, match='the reader stopped with status'):
        load_columns(samples[kind], [])


def test_quoted_numbers_are_read(tmp_path):
    (tmp_path / 'x.csv').write_text('"t","q"\n"0.0","1.5"\n"0.1","2.5"\n')
    columns, _ = load_columns(tmp_path / 'x.csv', [])
    assert columns['q'].tolist() == ['1.5', '2.5']


def test_a_command_ends_with_status_2_and_one_line(tmp_path):
    _view(tmp_path / 'x.db3')
    done = subprocess.run(
        [sys.executable, '-m', 'sgp_ros.cli', 'replay', str(tmp_path / 'x.db3'), '--robot',
         'toy_pendulum', '--out', str(tmp_path / 'out')],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.count('\n') == 1
    assert not (tmp_path / 'out').exists()
