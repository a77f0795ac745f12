"""Tables become recordings in SI units, and all errors of a wrong map are reported at once."""

from __future__ import annotations

import json
import math
import re
import zipfile

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.io import savemat

from sgp_ros.errors import ConfigError, RecordingError
from sgp_ros.recordings.imports import import_table
from sgp_ros.recordings.reader import open_recording
from sgp_ros.recordings.table_files import load_columns
from sgp_ros.recordings.table_map import read_map
from sgp_ros.recordings.tables import read_table
from test.recordings import worlds

MAP = {
    'time': {'column': 't', 'unit': 's'},
    'joints': {'axis': {'position': {'column': 'q', 'unit': 'm'}}},
}


def _map(**position):
    return {**MAP, 'joints': {'axis': {'position': {'column': 'q', 'unit': 'm', **position}}}}


def _csv(path, text):
    path = path / 'x.csv'
    path.write_text(text)
    return path


READY = {
    'emps/emps_id.csv': ('emps', ('axis',), 24841),
    'panda/panda_exciting.npz': ('panda', tuple(f'panda_joint{i}' for i in range(1, 8)), 20544),
    'tiago/tiago_dynamic.npz': (
        'tiago', ('torso_lift_joint', *(f'arm_{i}_joint' for i in range(1, 8))), 8022,
    ),
    'dfki_simple_pendulum/energy_shaping.csv': ('dfki_simple_pendulum', ('pendulum',), 4000),
    'dfki_double_pendulum/design_C.0__20220914__sys_id__trajectory_00.npz': (
        'dfki_double_pendulum', ('shoulder', 'elbow'), 4993,
    ),
    'staubli_tx40/tx40_joint_test.npz': ('tx40', tuple(f'joint_{i}' for i in range(1, 7)), 20250),
    'tflex/tflex_slow.npz': ('tflex', ('axis',), 12999),
    'laas_cogging/settled_points.npz': ('laas_settled', ('axis',), 31666),
    'laas_cogging/constant_speed.npz': ('laas_speed', ('axis',), 30001),
}  # fmt: skip


@pytest.mark.parametrize('file', READY)
def test_ready_map_imports_its_recording(file, tmp_path):
    name, joints, n = READY[file]
    out = tmp_path / 'x.mcap'
    summary = import_table(worlds.DATA / file, worlds.MAPS / f'{name}.yaml', out)
    assert (summary.path, summary.joints, summary.samples) == (out, joints, n)
    assert summary.start_ns < summary.end_ns
    table = read_table(worlds.DATA / file, read_map(worlds.MAPS / f'{name}.yaml'))
    written = [worlds.exact(event) for event in table.events()]
    assert sorted(worlds.everything(open_recording(out))) == sorted(written)


def test_imported_currents_are_those_of_the_recorded_messages():
    """A robot file holds the gain: it must not matter whether the table or the bag was read."""
    table = read_table(
        worlds.DATA / 'tiago' / 'tiago_dynamic.npz', read_map(worlds.MAPS / 'tiago.yaml')
    )
    recorded = list(open_recording(worlds.DATA / 'tiago' / 'mcap_tiago_dynamic').events())
    imported = list(table.events())
    assert len(imported) == len(recorded)
    for ours, theirs in zip(imported, recorded, strict=True):
        assert ours.names == theirs.names
        for channel in ('position', 'velocity', 'effort'):
            np.testing.assert_array_equal(getattr(ours, channel), getattr(theirs, channel))


def test_every_ready_map_is_tested_here():
    assert {path.stem for path in worlds.MAPS.glob('*.yaml')} == {m for m, _, _ in READY.values()}


def test_folder_gets_a_recording_named_after_the_table(tmp_path):
    table = _csv(tmp_path, 't,q\n1,0\n')
    (tmp_path / 'map.yaml').write_text(json.dumps(MAP))
    summary = import_table(table, tmp_path / 'map.yaml', tmp_path / 'out' / 'import')
    assert summary.path == tmp_path / 'out' / 'import' / 'x.mcap'
    assert json.loads(json.dumps(summary.to_mapping())) == summary.to_mapping()
    assert len(worlds.everything(open_recording(summary.path))) == 1


def test_imported_numbers_are_those_of_the_table():
    path = worlds.DATA / 'panda' / 'panda_exciting.npz'
    table = read_table(path, read_map(worlds.MAPS / 'panda.yaml'))
    with np.load(path) as content:
        np.testing.assert_array_equal(table.channels['position'], content['q'])
        np.testing.assert_array_equal(table.channels['velocity'], content['dq'])
        np.testing.assert_array_equal(table.channels['effort'], content['tau'])
        assert abs(table.stamps_ns[5] - content['t'][5] * 1e9) <= 0.5


@pytest.mark.parametrize('mark', [',', ';', '\t', ' '])
def test_delimiter_is_found_in_the_header(mark, tmp_path):
    """A row without a position is no state."""
    text = 't,q\n0.5,1.25\n\n1.0,\n'.replace(',', mark) if mark != ' ' else 't q\n0.5 1.25\n1 nan'
    table = read_table(_csv(tmp_path, text), MAP)
    assert table.stamps_ns == (500_000_000,)
    np.testing.assert_array_equal(table.channels['position'], [[1.25]])
    assert '1 of 2 rows ignored' in table.remarks[0]


def test_decimal_comma_goes_with_semicolons(tmp_path):
    table = read_table(_csv(tmp_path, 't;q\n0,5;1,25\n'), MAP)
    assert (table.stamps_ns[0], table.channels['position'][0, 0]) == (500_000_000, 1.25)


@pytest.mark.parametrize(
    ('unit', 'channel', 'si'),
    [
        ('mm', 'position', 2e-3),
        ('deg', 'position', math.radians(2.0)),
        ('rev', 'position', 4.0 * math.pi),
        ('rpm', 'velocity', 2.0 * math.pi / 30.0),
        ('mm/s', 'velocity', 2e-3),
        ('mN m', 'effort', 2e-3),
        ('kN', 'effort', 2e3),
    ],
)
def test_units_lead_to_si(unit, channel, si, tmp_path):
    joint = {'position': {'column': 'q', 'unit': 'm'}, channel: {'column': 'q', 'unit': unit}}
    table = read_table(_csv(tmp_path, 't,q\n0,2\n'), {**MAP, 'joints': {'a': joint}})
    assert table.channels[channel][0, 0] == pytest.approx(si, rel=1e-15)


def test_scale_and_offset_apply_after_the_unit(tmp_path):
    content = _map(unit='counts', scale='1e-3', offset=-0.5)
    table = read_table(_csv(tmp_path, 't,q\n0,2000\n'), content)
    assert table.channels['position'][0, 0] == 1.5


@given(stamp_ns=st.integers(0, 2**31 * 10**9 - 1))
def test_decimal_text_and_integers_of_time_are_not_rounded(tmp_path_factory, stamp_ns):
    """A float cannot hold a present-day epoch to the nanosecond."""
    folder = tmp_path_factory.mktemp('table')
    text = f't,q\n{stamp_ns // 10**9}.{stamp_ns % 10**9:09d},0\n'
    assert read_table(_csv(folder, text), MAP).stamps_ns == (stamp_ns,)
    np.savez(folder / 'x.npz', t=np.array([stamp_ns]), q=np.zeros(1))
    content = {**MAP, 'time': {'column': 't', 'unit': 'ns'}}
    assert read_table(folder / 'x.npz', content).stamps_ns == (stamp_ns,)


def test_rate_replaces_a_time_column(tmp_path):
    content = {**MAP, 'time': {'rate': 300.0, 'start': 1700000000}}
    table = read_table(_csv(tmp_path, 'q\n1\n2\n3\n4\n'), content)
    start = 1_700_000_000 * 10**9
    assert [stamp - start for stamp in table.stamps_ns] == [0, 3_333_333, 6_666_667, 10_000_000]


@pytest.mark.parametrize(
    'time',
    [
        {'rate': 1e-10}, {'rate': 1e-300}, {'rate': 1.0, 'start': -5},
        {'rate': 1.0, 'start': 1e300},
        {'rate': 1.0, 'start': 2**31 - 1},
        {'column': 't', 'unit': 's', 'start': 2**31 - 3, 'episode': 'part'},
    ],
)  # fmt: skip
def test_rows_at_times_that_no_message_holds_are_refused(time, tmp_path):
    with pytest.raises(RecordingError, match='a row at'):
        read_table(_csv(tmp_path, 't,q,part\n1,0,0\n2,0,1\n'), {**MAP, 'time': time})


def test_time_that_does_not_grow_is_written_as_it_is(tmp_path):
    """The engine counts such samples; a repaired table would hide them."""
    table = read_table(_csv(tmp_path, 't,q\n2,0\n1,0\n1,0\n'), MAP)
    assert table.stamps_ns == (2 * 10**9, 10**9, 10**9)


@pytest.mark.parametrize('time', ['nan', '', 'inf', '-1', 'soon', '1e30'])
def test_row_without_a_possible_time_is_refused(time, tmp_path):
    with pytest.raises(RecordingError, match='column t, row 2'):
        read_table(_csv(tmp_path, f't,q\n0,0\n{time},0\n'), MAP)


def test_channel_that_one_joint_lacks_is_nan_there(tmp_path):
    joints = {
        'a': {'position': {'column': 'q', 'unit': 'rad'}},
        'b': {
            'position': {'column': 'q', 'unit': 'rad'},
            'velocity': {'column': 'q', 'unit': 'rad/s'},
        },
    }
    table = read_table(_csv(tmp_path, 't,q\n0,2\n'), {**MAP, 'joints': joints})
    np.testing.assert_array_equal(table.channels['velocity'], [[math.nan, 2.0]])
    assert set(table.channels) == {'position', 'velocity'}


@pytest.mark.parametrize('kind', ['std_msgs/Float64MultiArray', 'sensor_msgs/JointState'])
def test_commands_are_written_before_the_state_of_their_row(kind, tmp_path):
    path = _csv(tmp_path, 't,q,u\n1,0,3\n2,0,4\n')
    (tmp_path / 'map.yaml').write_text(
        'time: {column: t, unit: s}\n'
        'joints: {axis: {position: {column: q, unit: m}}}\n'
        'commands: {axis: {column: u, unit: V, scale: 10}}\n'
        f'command_type: {kind}\n'
    )
    summary = import_table(path, tmp_path / 'map.yaml', tmp_path / 'x.mcap')
    events = list(open_recording(summary.path).events())
    assert summary.commands == 2
    assert [event.stamp_ns // 10**9 for event in events] == [1, 1, 2, 2]
    assert events[0].effort.tolist() == [30.0]
    assert events[0].names == (('axis',) if kind == 'sensor_msgs/JointState' else None)


def test_mat_structures_and_matrices_are_reached_by_name_and_index(tmp_path):
    matrix = np.array([[1.0, 2.0], [3.0, 4.0]])
    savemat(tmp_path / 'x.mat', {'log': {'t': np.array([[0.0], [1.0]]), 'q': matrix}, 'note': 'x'})
    content = {**_map(column='log.q', index=1), 'time': {'column': 'log.t', 'unit': 's'}}
    table = read_table(tmp_path / 'x.mat', content)
    assert table.channels['position'].tolist() == [[2.0], [4.0]]


def test_objects_in_npz_are_never_unpickled(tmp_path):
    np.savez(tmp_path / 'x.npz', t=np.zeros(1), q=np.array([{}]))
    with pytest.raises(ConfigError, match=r'q.*not in the table'):
        read_table(tmp_path / 'x.npz', MAP)


def test_an_array_that_is_damaged_is_not_left_out(tmp_path):
    """Beside one of objects, which is, and is said."""
    path = tmp_path / 'x.npz'
    np.savez(path, t=np.arange(3.0), q=np.arange(3.0), o=np.array([{}]))
    remarks = []
    columns, _ = load_columns(path, remarks)
    assert set(columns) == {'t', 'q'}
    assert remarks == ["x.npz: ['o'] contain Python objects and are not read"]
    with zipfile.ZipFile(path) as file:
        parts = {name: file.read(name) for name in file.namelist()}
    with zipfile.ZipFile(path, 'w') as file:
        for name, data in parts.items():
            file.writestr(name, data.replace(b'(3,)', b'(9,)') if name == 'q.npy' else data)
    with pytest.raises(RecordingError, match='cannot be read'):
        load_columns(path, [])


@pytest.mark.parametrize('wrong', ['12..5', '1_0', '0x10', '1d5', 'two'])
def test_a_cell_that_is_no_number_does_not_cost_its_column_in_silence(wrong, tmp_path):
    """A few are refused by line, more are reported; a column of texts is nobody's loss."""
    rows = [f'{i},{i},{wrong if i % 30 == 7 else i},label' for i in range(60)]
    path = _csv(tmp_path, '\n'.join(['t,q,tau,note', *rows]))
    with pytest.raises(RecordingError, match=rf"line 9, column tau: '{re.escape(wrong)}'"):
        load_columns(path, [])
    rows = [f'{i},{i},{wrong if i % 3 == 0 else i},label' for i in range(60)]
    remarks = []
    load_columns(_csv(tmp_path, '\n'.join(['t,q,tau,note', *rows])), remarks)
    assert len(remarks) == 1
    assert 'column tau' in remarks[0]
    assert 'a column with 20 such cells is not used' in remarks[0]


def test_missing_cells_and_texts_are_no_mistakes(tmp_path):
    rows = [f'{i},{i},{"" if i % 3 else i},note {i}' for i in range(20)]
    remarks = []
    load_columns(_csv(tmp_path, '\n'.join(['t,q,tau,note', *rows])), remarks)
    assert remarks == []


@pytest.mark.parametrize(
    ('name', 'content', 'reason'),
    [
        ('x.csv', b'', 'no data'),
        ('x.csv', b't,q\n', 'no data'),
        ('x.csv', b't,q\n1,2,3\n', 'line 2 has 3 values'),
        ('x.csv', b't,q\n1,two\n', 'column q'),
        ('x.csv', b'\xff\xfe\x00', 'NUL characters'),
        ('x.csv', b't,q\n0,\x81\n', 'not a text file'),
        ('x.npz', b'hello', 'cannot be read'),
        ('x.mat', b'MATLAB 7.3 MAT-file'.ljust(124) + b'\x00\x02IM', 'HDF5'),
        ('x.mat', b'hello', 'cannot be read'),
        ('x.xls', b'hello', "file type '.xls'"),
        ('x.csv.gz', b'hello', 'unpack it first'),
    ],
)
def test_table_that_cannot_be_read_says_why(name, content, reason, tmp_path):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(RecordingError, match=reason):
        read_table(tmp_path / name, MAP)
    with pytest.raises(RecordingError, match='no table'):
        read_table(tmp_path / 'nothing.csv', MAP)


def test_the_position_of_a_wheel_is_the_integral_of_its_velocity(tmp_path):
    """In turns of any unit; a velocity that is missing is taken from its neighbours."""
    text = 't,speed\n0,0\n1,60\n3,60\n4,\n5,60\n'
    wheel = {'velocity': {'column': 'speed', 'unit': 'rpm'}}
    path = tmp_path / 'map.yaml'
    path.write_text(json.dumps({**MAP, 'joints': {'wheel': wheel}}))
    table = read_table(_csv(tmp_path, text), read_map(path))
    turns = table.channels['position'][:, 0] / (2.0 * math.pi)
    np.testing.assert_allclose(turns, [0.0, 0.5, 2.5, 3.5, 4.5])
    assert table.remarks == ('x.csv: the position of wheel is the integral of its velocity',)
    assert import_table(tmp_path / 'x.csv', path, tmp_path).samples == 5


def test_everything_wrong_with_a_map_is_in_one_error(tmp_path):
    content = {
        'time': {'column': 'time', 'unit': 'h', 'scale': 1.0, 'start': 'now'},
        'joints': {
            'a': {'position': {'column': 'q', 'unit': 'furlong'}, 'jerk': {}},
            'b': {'effort': {'column': 'q', 'unit': 'A'}},
            'e': {'velocity': {'column': 'q', 'unit': 'counts/s'}},
            'c': {'position': {'column': 'q', 'unit': 'rad', 'index': 3, 'scale': 'big'}},
            'd': 7,
        },
        'commands': {'a': {'column': 'q', 'unit': 'V'}},
        'command_type': 'std_msgs/String',
        'jonits': {},
    }
    with pytest.raises(ConfigError) as caught:
        read_table(_csv(tmp_path, 't,q\n0,0\n'), content)
    for part in (
        "'time': not in the table", "time.unit 'h'", "time: unknown key 'scale'", "start 'now'",
        "'furlong'", "joints.a: unknown key 'jerk'", 'joints.b: position is missing',
        'joints.e.velocity: unit counts/s needs a scale', 'index 3', "scale 'big'",
        'joints.d: expected a mapping', 'commands.a: unit V needs a scale', "'std_msgs/String'",
        "unknown key 'jonits'", 'the table has t [1], q [1]',
    ):  # fmt: skip
        assert part in str(caught.value)


@pytest.mark.parametrize(
    ('array', 'index', 'reason'),
    [
        (np.zeros((3, 2)), None, 'has 2 columns, expected an index'),
        (np.zeros((3, 2)), 2, 'index 2'),
        (np.zeros((3, 2, 2)), None, '3 dimensions'),
        (np.zeros(4), None, 'different length'),
        (np.array([1j, 2j, 3j]), None, 'not numeric'),
        (np.zeros((3, 2)), 'x', "index 'x'"),
    ],
)
def test_array_of_another_shape_is_refused(array, index, reason, tmp_path):
    np.savez(tmp_path / 'x.npz', t=np.arange(3), q=array)
    content = _map() if index is None else _map(index=index)
    with pytest.raises(ConfigError, match=reason):
        read_table(tmp_path / 'x.npz', content)


@pytest.mark.parametrize(
    ('text', 'reason'), [(None, 'no map'), ('[1, 2]', 'not a mapping'), ('a: [', 'not YAML')]
)
def test_map_file_must_be_a_yaml_mapping(text, reason, tmp_path):
    path = tmp_path / 'map.yaml'
    if text is not None:
        path.write_text(text)
    with pytest.raises(ConfigError, match=reason):
        read_map(path)


def test_rate_must_be_positive_and_alone(tmp_path):
    content = {**MAP, 'time': {'rate': 0.0, 'column': 't'}}
    with pytest.raises(ConfigError, match=r"unknown key 'column'.*time.rate 0.0"):
        read_table(_csv(tmp_path, 't,q\n0,0\n'), content)


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('t,q\n1,0\n2,0.5\n3', 'the last line, 4, ends after 1 of 2'),
        ('t,q\ns,m\n1,0\n2,0.5\n', 'lines [2] contain no numbers'),
        ('t,q\n1,0\n\n2,1e280\n3,0.5\n4,nan\n', '2 of 4 rows ignored, lines 4, 6'),
        ('% robot 7\n# t,q\n1,0\n2,0.5\n', ''),
        ('# made by a logger\nt,q\n# units: s,m\n1,0\n2,0.5\n', ''),
        ('"t","q"\n"1","0"\n2,0.5\n', ''),
    ],
    ids=['cut off', 'units', 'impossible', 'header as comment', 'comments', 'quotes'],
)
def test_what_can_be_read_of_a_table_is_used_and_the_rest_is_reported(text, said, tmp_path):
    """Two whole rows in each; what is left out has its line in a remark."""
    table = read_table(_csv(tmp_path, text), MAP)
    np.testing.assert_array_equal(table.channels['position'], [[0.0], [0.5]])
    assert len(table.stamps_ns) == 2
    assert len(table.remarks) == bool(said)
    assert said in ''.join(table.remarks)


def test_a_table_without_header_says_so(tmp_path):
    with pytest.raises(RecordingError, match=r'no header: line 1 already contains numbers'):
        read_table(_csv(tmp_path, '1,0\n2,0.5\n'), MAP)


def test_a_list_in_a_cell_is_a_row_of_a_matrix(tmp_path):
    """For any separator of the cells, in quotes or not."""
    content = _map(index=1)
    for text in ('t,q\n1,"[0.1, 0.2]"\n2,"[0.3, 0.4]"\n', 't,q\n1,[0.1, 0.2]\n2,[0.3, 0.4]\n',
                 't q\n1 [0.1, 0.2]\n2 [0.3, 0.4]\n'):  # fmt: skip
        table = read_table(_csv(tmp_path, text), content)
        np.testing.assert_array_equal(table.channels['position'], [[0.2], [0.4]])


def test_iso_times_keep_their_nanoseconds(tmp_path):
    """UTC where no zone is named; 02:00 in the zone +02:00 is midnight."""
    text = 't,q\n1970-01-02T00:00:00.123456789Z,0\n1970-01-02 02:00:01+02:00,0\n'
    table = read_table(_csv(tmp_path, text), MAP)
    assert table.stamps_ns == (86_400_123_456_789, 86_401_000_000_000)


def test_cells_and_arrays_of_structures_of_a_mat_file_are_reached_by_number(tmp_path):
    cells = np.empty(2, dtype=object)
    cells[:] = [np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.2, 0.3])]
    runs = np.array([(np.array([5.0, 6.0]),), (np.array([7.0, 8.0]),)], dtype=[('q', object)])
    savemat(tmp_path / 'x.mat', {'data': cells, 'runs': runs})
    time = {'column': 'data.0', 'unit': 's'}
    content = {'time': time, 'joints': {'axis': {'position': {'column': 'data.1', 'unit': 'm'}}}}
    table = read_table(tmp_path / 'x.mat', content)
    np.testing.assert_array_equal(table.channels['position'][:, 0], [0.1, 0.2, 0.3])
    content = _map(column='runs.1.q')
    content['time'] = {'rate': 1.0}
    table = read_table(tmp_path / 'x.mat', content)
    np.testing.assert_array_equal(table.channels['position'][:, 0], [7.0, 8.0])
