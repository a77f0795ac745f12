"""The fuzzer of files, short and with fixed seeds, and files made to harm."""

from __future__ import annotations

import bz2
import json
import os
import re
import subprocess
import sys
from functools import partial
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from rosbags.rosbag1 import Writer as Ros1Writer
from scipy.io import savemat

from sgp_proof.robustness import files
from sgp_proof.robustness import harmful_files as harm
from sgp_proof.robustness import harmful_recordings as bags
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

BZ2, LZ4 = Ros1Writer.CompressionFormat.BZ2, Ros1Writer.CompressionFormat.LZ4


@pytest.fixture(scope='module')
def samples(tmp_path_factory):
    return files.make_samples(tmp_path_factory.mktemp('samples'))


@pytest.mark.long
def test_intact_files_are_read(samples):
    for kind, path in samples.items():
        files.read(kind, path)


def test_damaged_files_are_read_or_refused_in_one_line(samples, tmp_path):
    """Seeds of the formats that are read in this process."""
    faults = Faults()
    others = {kind: path for kind, path in samples.items() if kind not in files.APART}
    outcomes = [
        files.run(seed, others, tmp_path, faults, has_commands=False)[1] for seed in range(120)
    ]
    assert dict(faults) == {}
    assert {'read', 'refused'} == set(outcomes)


@pytest.mark.long
def test_recordings_that_can_be_read_go_through_the_commands(samples, tmp_path):
    """Each says what of them was not read, and prints it."""
    faults = Faults()
    bags_only = {kind: samples[kind] for kind in (*files.BAGS, 'sdf')}
    outcomes = [files.run(seed, bags_only, tmp_path, faults) for seed in range(14)]
    assert dict(faults) == {}
    assert any(outcome == 'read' for kind, outcome in outcomes if kind in files.BAGS)


def test_a_recording_that_is_read_short_in_silence_is_a_fault(samples):
    """Of the fuzzer itself."""
    files.read_bag(samples['mcap'], files.STATES)
    with pytest.raises(AssertionError, match='200 of 201 read in silence'):
        files.read_bag(samples['mcap'], files.STATES + 1)


def _read_all(path):
    return list(open_recording(path).events())


def _columns(path):
    return load_columns(path, [])


def _robot(path):
    return load_robot(str(path))


@pytest.mark.parametrize(
    ('name', 'make', 'read', 'says'),
    [
        ('x.urdf', harm.long_urdf, _robot, 'SGP_MOST_LINKS'),
        ('deep.urdf', harm.ROBOTS['deep.urdf'], _robot, 'SGP_MOST_DEPTH'),
        ('deep.yaml', harm.SETTINGS['deep.yaml'], load_parameters, 'SGP_MOST_DEPTH'),
        ('many.yaml', harm.SETTINGS['aliases.yaml'], load_parameters, 'SGP_MOST_ALIASES'),
        ('x.db3', bags.view, open_recording, 'no plain tables'),
        ('x.mcap', partial(bags.bomb, size=1 << 21), open_recording, 'SGP_MOST_CHUNK_MB'),
        ('lz4.mcap', partial(bags.bomb, size=1 << 21, kind=b'lz4', pack=lz4.frame.compress),
         open_recording, 'SGP_MOST_CHUNK_MB'),
        ('zeros.mcap', bags.RECORDINGS['zeros.mcap'], open_recording, 'damaged'),
        ('sparse.mcap', bags.sparse, open_recording, 'SGP_MOST_CHUNK_MB'),
        ('chunk.mcap', bags.RECORDINGS['sparse_chunk.mcap'], open_recording, 'SGP_MOST_CHUNK_MB'),
        ('behind.mcap', bags.RECORDINGS['sparse_behind.mcap'], open_recording,
         'SGP_MOST_CHUNK_MB'),
        ('sparse.bag', bags.sparse_ros1, open_recording, 'SGP_MOST_CHUNK_MB'),
        ('line.bag', bags.RECORDINGS['line.bag'], open_recording, 'cannot be read'),
        ('tiny.mcap', partial(bags.tiny_messages, n=600_000), open_recording, 'SGP_MOST_RATIO'),
        ('bz2.bag', partial(bags.ros1, kind=BZ2, pack=lambda _: bz2.compress(bytes(1 << 21))),
         _read_all, 'SGP_MOST_CHUNK_MB'),
        ('lz4.bag', partial(bags.ros1, kind=LZ4, pack=lambda _: lz4.frame.compress(
            bytes(1 << 21))), _read_all, 'SGP_MOST_CHUNK_MB'),
        ('packed', partial(bags.packed_directory, make=partial(bags.zeros, size=17 << 20)),
         open_recording, 'SGP_MOST_RATIO'),
        ('rows', partial(bags.packed_directory, make=partial(
            bags.messages_of, content="x''", n=200_000, stamp='1')), open_recording,
         'SGP_MOST_RATIO'),
        ('message', partial(bags.packed_directory, make=partial(
            bags.messages_of, content='zeroblob(2e6)')), _read_all, 'SGP_MOST_CHUNK_MB'),
        ('piped', bags.piped_directory, open_recording, 'not a regular file'),
        ('deep', bags.deep_directory, open_recording, 'SGP_MOST_DEPTH'),
        ('twice.db3', bags.RECORDINGS['twice.db3'], open_recording, 'several topics'),
        ('types.db3', bags.RECORDINGS['types.db3'], _read_all, 'a message of int and str'),
        ('computed.db3', bags.RECORDINGS['computed.db3'], open_recording, 'no plain tables'),
        ('laughs.yaml', harm.laughs, load_parameters, 'SGP_MOST_ENTRIES'),
        ('long.sdf', harm.long_sdf, _robot, 'links of long.sdf'),
        ('sixty.yaml', harm.SETTINGS['sixty.yaml'], load_parameters, 'SGP_MOST_LINE'),
        ('wide.jsonl', harm.TABLES['wide.jsonl'], _columns, 'SGP_MOST_UNPACKED_MB'),
        ('lists.json', harm.TABLES['lists.json'], _columns, 'SGP_MOST_'),
        ('circle.yaml', harm.SETTINGS['circle.yaml'], load_parameters, 'has no anchor before it'),
        ('date.yaml', harm.SETTINGS['date.yaml'], load_parameters, 'month'),
        ('pipe.sdf', os.mkfifo, _robot, 'nor a file'),
        ('pipe.yaml', os.mkfifo, lambda p: read_gains(p, (), ()), 'not a regular file'),
        ('pipe.json', os.mkfifo, load_truth, 'not a regular file'),
        ('deep.json', harm.TRUTHS['deep.json'], load_truth, 'cannot be read'),
        ('endless.xacro', harm.ROBOTS['endless.xacro'], _robot, 'SGP_MOST_SECONDS'),
        ('many.xml', harm.ROBOTS['many.xml'], _robot, 'SGP_MOST_'),
        ('x.npz', lambda p: np.savez_compressed(p, t=np.zeros(1 << 26)), _columns,
         'SGP_MOST_UNPACKED_MB'),
        ('pipe.mcap', os.mkfifo, open_recording, 'not a regular file'),
        ('pipe.npz', os.mkfifo, load_model, 'not a regular file'),
        ('twice.csv', harm.TABLES['twice.csv'], _columns, 'several columns named'),
        ('nul.csv', harm.TABLES['nul.csv'], _columns, 'NUL'),
        ('long.csv', harm.TABLES['long.csv'], _columns, 'SGP_MOST_LINE'),
        ('rows.csv', harm.TABLES['rows.csv'], _columns, 'SGP_MOST_ROWS'),
        ('cells.csv', harm.TABLES['cells.csv'], _columns, 'SGP_MOST_CELLS'),
        ('wide_cell.csv', harm.TABLES['wide_cell.csv'], _columns, 'SGP_MOST_UNPACKED_MB'),
    ],
)  # fmt: skip
def test_files_made_to_harm_are_refused(tmp_path, monkeypatch, name, make, read, says):
    """By bounds that are low here; `sgp_proof.robustness.harmful` runs them as they are."""
    for bound, value in (('CHUNK_MB', '1'), ('UNPACKED_MB', '200'), ('SECONDS', '2')):
        monkeypatch.setenv(f'SGP_MOST_{bound}', value)
    path = tmp_path / name
    make(path)
    with pytest.raises(SgpError, match=says):
        read(path)


def test_every_bound_is_documented_with_its_default():
    page = (Path(__file__).parents[3] / 'docs' / 'security.md').read_text(encoding='utf-8')
    named = re.findall(r'`SGP_MOST_(\w+)` \| (\d+) \|', page)
    assert {name: int(default) for name, default in named} == strangers.DEFAULTS


def _of_depth(path):
    path.write_text('/**: {ros__parameters: {a: ' + '{a: ' * 120 + '1' + '}' * 120 + '}}')


def _bag(path, n=4, step=1):
    with RecordingWriter(path) as writer:
        for i in range(n):
            writer.write_event(JointSample(1 + i * step, ('hinge',), np.zeros(1)))


def _zeros(path):
    path.write_bytes(zstandard.compress(bytes(17 << 20)))


def _unpack(path):
    out = path.with_name(str(strangers.bound('RATIO')))
    Unpacking(path.stat().st_size).unpack_file(path, out)


@pytest.mark.parametrize(
    ('bound', 'low', 'high', 'name', 'make', 'read'),
    [
        ('TEXT_MB', 0, 1, 'x.yaml', lambda p: p.write_text('/**: {ros__parameters: {}}'),
         load_parameters),
        ('TABLE_MB', 0, 1, 'x.csv', lambda p: p.write_text('t,q\n1,2\n'), _columns),
        ('UNPACKED_MB', 1, 3, 'x.npz', lambda p: np.savez(p, t=np.zeros(1 << 18)), _columns),
        ('UNPACKED_MB', 100, 768, 'x.mat', lambda p: savemat(p, {'t': np.zeros((1 << 22, 4))},
         do_compression=True), _columns),
        ('CHUNK_MB', 0, 1, 'x.mcap', _bag, _read_all),
        ('RATIO', 10, 100_000, 'x.zstd', _zeros, _unpack),
        ('MESSAGES', 3, 20, 'x.mcap', _bag, _read_all),
        ('MESSAGES', 3, 4, 'x.db3', partial(bags.messages_of, content="x'00'", n=4),
         open_recording),
        ('MESSAGES', 3, 4, 'x.bag', partial(bags.ros1, kind=None, pack=bytes, n=4),
         open_recording),
        ('HELD_MB', 1, 2, 'x.mcap', partial(_bag, n=4000, step=0), _read_all),
        ('HELD_MB', 1, 2, 'x.bag', partial(bags.ros1, kind=None, pack=bytes, n=5000),
         open_recording),
        ('DEPTH', 100, 130, 'x.yaml', _of_depth, load_parameters),
        ('ENTRIES', 300, 800, 'x.yaml', lambda p: p.write_text(
            '/**: {ros__parameters: {a: [' + '1,' * 600 + ']}}'), load_parameters),
        ('ALIASES', 100, 300, 'x.yaml', lambda p: p.write_text(
            '/**: {ros__parameters: {a: &a 1.0, b: [' + '*a,' * 200 + ']}}'), load_parameters),
        ('LINKS', 3, 8, 'x.urdf', partial(harm.long_urdf, n=5), parse_urdf),
        ('LINE', 10, 90, 'x.csv', lambda p: p.write_text('t,q\n1,' + '2' * 50 + '\n'), _columns),
        ('SECONDS', 0, 30, 'x.mat', lambda p: savemat(p, {'t': np.zeros(9)}), _columns),
    ],
)  # fmt: skip
def test_each_bound_may_be_raised(tmp_path, monkeypatch, bound, low, high, name, make, read):
    make(tmp_path / name)
    _refused_then_read(monkeypatch, bound, (low, high), lambda: read(tmp_path / name))


def _refused_then_read(monkeypatch, bound, values, read):
    monkeypatch.setenv(f'SGP_MOST_{bound}', str(values[0]))
    with pytest.raises(SgpError, match=f'SGP_MOST_{bound}'):
        read()
    monkeypatch.setenv(f'SGP_MOST_{bound}', str(values[1]))
    read()


@pytest.mark.parametrize(('bound', 'least'), [('ROWS', files.N), ('CELLS', 2 * files.N)])
@pytest.mark.parametrize('kind', ['csv', 'npz', 'json', 'mat', 'h5', 'parquet'])
def test_rows_and_cells_of_every_table_are_counted(samples, monkeypatch, kind, bound, least):
    values = least - 1, 3 * least
    _refused_then_read(monkeypatch, bound, values, lambda: load_columns(samples[kind], []))


@pytest.mark.parametrize('ending', ['.npz', '.json', pytest.param('.csv', marks=pytest.mark.long)])
def test_a_large_table_is_read_in_bounded_memory(tmp_path, ending):
    """A process whose data may take 500 MB; the text of the cells alone would take more."""
    path = tmp_path / f'x{ending}'
    t = np.arange(1_000_000) * 0.001
    if ending == '.csv':
        np.savetxt(path, np.stack([t, np.sin(t)], axis=1), delimiter=',', header='t,q',
                   comments='')  # fmt: skip
    elif ending == '.npz':
        np.savez(path, t=t, q=np.sin(t))
    else:
        path.write_text(json.dumps({'t': t.tolist(), 'q': np.sin(t).tolist()}))
    program = (
        'import resource, sys; from pathlib import Path\n'
        'from sgp_ros.recordings.table_files import load_columns\n'
        'resource.setrlimit(resource.RLIMIT_DATA, (500 << 20, 800 << 20))\n'
        'columns, _ = load_columns(Path(sys.argv[1]), [])\n'
        'assert columns["q"].dtype == float and len(columns["t"]) == 1_000_000\n'
    )
    subprocess.run([sys.executable, '-c', program, str(path)], check=True)


@pytest.mark.parametrize('kind', files.APART)
def test_a_file_that_ends_its_reader_ends_nothing_else(samples, monkeypatch, kind):
    """It is read in a process of its own, here by one that is killed at once."""
    monkeypatch.setattr(sys, 'executable', '/bin/false')
    with pytest.raises(SgpError, match='the reader stopped with status'):
        files.read(kind, samples[kind])


def test_quoted_numbers_are_read(tmp_path):
    (tmp_path / 'x.csv').write_text('"t","q"\n"0.0","1.5"\n"0.1","2.5"\n')
    columns, _ = load_columns(tmp_path / 'x.csv', [])
    assert columns['q'].tolist() == [1.5, 2.5]


def test_a_command_ends_with_status_2_and_one_line(tmp_path):
    bags.view(tmp_path / 'x.db3')
    done = subprocess.run(
        [sys.executable, '-m', 'sgp_ros.cli', 'replay', str(tmp_path / 'x.db3'), '--robot',
         'toy_pendulum', '--out', str(tmp_path / 'out')],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.count('\n') == 1
    assert not (tmp_path / 'out').exists()
