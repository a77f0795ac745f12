"""A folder of tables, one a quantity, as one table."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.engine.samples import JointSample
from sgp_ros.errors import RecordingError
from sgp_ros.recordings.imports import import_table
from sgp_ros.recordings.reader import open_recording
from sgp_ros.recordings.table_entries import JointHint

T = np.arange(300) * 0.01
Q = np.column_stack([np.sin(2.0 * T), 0.5 * np.cos(T)])
DQ = np.column_stack([2.0 * np.cos(2.0 * T), -0.5 * np.sin(T)])
TAU = np.column_stack([np.cos(T), np.sin(5.0 * T)])
HINTS = (JointHint('lift_joint'), JointHint('elbow_joint'))


def _csv(path, values, names=('lift_joint', 'elbow_joint'), times=T):
    np.savetxt(
        path, np.column_stack([times, values]), '%.9g', ',', header='time,' + ','.join(names),
        comments='',
    )  # fmt: skip


def _states(folder, out):
    summary = import_table(folder, None, out, HINTS)
    return summary, [
        e for e in open_recording(summary.path).events() if isinstance(e, JointSample)
    ]


def test_files_named_by_their_quantity_are_one_table(tmp_path):
    folder = tmp_path / 'run'
    folder.mkdir()
    for name, values in (('position', Q), ('velocity', DQ), ('effort_Nm', TAU)):
        _csv(folder / f'arm_{name}.csv', values)
    (folder / 'README.txt').write_text('of no joint')
    summary, states = _states(folder, tmp_path / 'out')
    assert summary.path.name == 'run.mcap'
    for part, values in (('position', Q), ('velocity', DQ), ('effort', TAU)):
        np.testing.assert_allclose([getattr(s, part) for s in states], values, atol=1e-8)


def test_arrays_of_numpy_are_named_by_their_files(tmp_path):
    for name, values in (('t', T), ('q', Q), ('dq', DQ), ('tau', TAU)):
        np.save(tmp_path / f'{name}.npy', values)
    _, states = _states(tmp_path, tmp_path / 'out')
    np.testing.assert_array_equal([s.effort for s in states], TAU)


def test_objects_are_not_unpickled(tmp_path):
    np.save(tmp_path / 'q.npy', np.array([{}], dtype=object), allow_pickle=True)
    np.save(tmp_path / 't.npy', T)
    with pytest.raises(RecordingError, match=r'q\.npy cannot be read'):
        import_table(tmp_path, None, tmp_path / 'out', HINTS)


def test_other_times_are_refused(tmp_path):
    _csv(tmp_path / 'q.csv', Q)
    _csv(tmp_path / 'tau.csv', TAU, times=T + 0.1)
    with pytest.raises(RecordingError, match=r'or other times; .* same times'):
        import_table(tmp_path, None, tmp_path / 'out', HINTS)
    _csv(tmp_path / 'tau.csv', TAU[1:], times=T[1:])
    with pytest.raises(RecordingError, match='have 300 and 299 rows'):
        import_table(tmp_path, None, tmp_path / 'out', HINTS)


def test_recordings_of_their_own_are_not_joined(tmp_path):
    for name in ('first', 'second'):
        _csv(tmp_path / f'{name}.csv', np.column_stack([Q[:, 0], TAU[:, 0]]), ('q', 'tau'))
    with pytest.raises(RecordingError, match=r'several recordings: first\.csv, second\.csv'):
        import_table(tmp_path, None, tmp_path / 'out', HINTS)


def test_a_folder_without_tables_says_what_it_needs(tmp_path):
    with pytest.raises(RecordingError, match='contains 0 tables; expected a folder of tables'):
        import_table(tmp_path, None, tmp_path / 'out', HINTS)
