"""Laws of the filtered equation of motion."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.batch import regression_data
from sgp_ros.batch.regression_data import FilterPlan, filtered_data
from sgp_ros.errors import ConfigError, RecordingError
from sgp_ros.robots.registry import load_robot
from test.batch.worlds import AXIS_TRUTH, axis_signals, emps_signals

LINEAR_AXIS = load_robot('linear_axis')

PLAN = FilterPlan(cutoff=10.0, state_cutoff=50.0, decimation=10)
PUBLISHED = np.array([95.1089, 203.5034, 20.3935, -3.1648])
"""Janot, Gautier, Brunot 2019, by least squares [kg, N s/m, N, N]."""


@pytest.fixture(scope='module')
def signals():
    """Half a minute of the simulated axis."""
    return axis_signals()


def _least_squares(data):
    F, y = data.F[:, 0], data.y[:, 0]
    w = np.linalg.lstsq(F, y, rcond=None)[0]
    return w, np.linalg.norm(y - F @ w) / np.linalg.norm(y)


@pytest.mark.long
def test_the_equation_of_motion_survives_the_filter(signals):
    """The true coefficients explain the filtered force of a simulated axis to one per cent."""
    data = filtered_data(signals, LINEAR_AXIS, PLAN)
    error = data.y - data.F @ AXIS_TRUTH
    assert np.sqrt(np.mean(error**2)) < 0.01 * np.std(data.y)
    w, _ = _least_squares(data)
    assert w == pytest.approx(AXIS_TRUTH, rel=0.02)


@pytest.mark.long
def test_a_change_of_direction_is_smeared_in_column_and_force_alike(signals):
    """Columns of filtered states instead of filtered columns leave several times the error."""
    data = filtered_data(signals, LINEAR_AXIS, PLAN)
    parallel = data.y - data.F @ AXIS_TRUTH
    naive = data.y - LINEAR_AXIS.regressor(data.motion) @ AXIS_TRUTH
    assert np.std(naive) > 3.0 * np.std(parallel)


def test_chunks_do_not_show(signals, monkeypatch):
    """Columns computed piece by piece are those computed at once."""
    plan = FilterPlan(20.0, 80.0, 3)
    whole = filtered_data(signals, LINEAR_AXIS, plan)
    monkeypatch.setattr(regression_data, 'CHUNK_BYTES', 16_000)
    pieces = filtered_data(signals, LINEAR_AXIS, plan)
    assert np.abs(pieces.F - whole.F).max() < 1e-6
    assert np.array_equal(pieces.y, whole.y)


def test_decimation_keeps_rows_and_changes_none(signals):
    """Thinning afterwards equals decimating at once."""
    fine = filtered_data(signals, LINEAR_AXIS, FilterPlan(10.0, 50.0, 2))
    coarse = filtered_data(signals, LINEAR_AXIS, FilterPlan(10.0, 50.0, 6))
    thinned = fine.thinned(3)
    assert np.array_equal(thinned.F, coarse.F)
    assert np.array_equal(thinned.time, coarse.time)
    assert thinned.rate == coarse.rate == pytest.approx(200.0 / 6)
    assert np.diff(coarse.time) == pytest.approx(6 / 200.0)


def test_a_hole_starts_a_new_block(signals):
    """Rows are neighbours only where nothing was taken out between them."""
    data = filtered_data(signals, LINEAR_AXIS, PLAN)
    mask = np.ones(len(data.time), dtype=bool)
    mask[5:8] = False
    assert data.rows(mask).block[:7].tolist() == [0, 0, 0, 0, 0, 1, 1]
    assert len(data.rows(np.zeros(0, dtype=int)).block) == 0


def test_a_segment_shorter_than_the_transient_is_refused():
    """The error says how long a recording has to be."""
    short = axis_signals(duration=0.5)
    with pytest.raises(RecordingError, match='longest segment lasts'):
        filtered_data(short, LINEAR_AXIS, PLAN)


def test_a_velocity_that_was_not_measured_is_refused(signals):
    """The simulated axis has an encoder alone."""
    with pytest.raises(ConfigError, match='no velocity was recorded'):
        filtered_data(signals, LINEAR_AXIS, FilterPlan(10.0, 50.0, 10, 'measured'))


@pytest.mark.parametrize('cutoff', [10.0, 20.0, 30.0])
def test_the_published_parameters_of_a_real_axis_are_found(cutoff):
    """EMPS: every published value within one per cent, error below the published 4.08 %."""
    plan = FilterPlan(cutoff, 5 * cutoff, round(500 / cutoff))
    w, error = _least_squares(filtered_data(emps_signals(), LINEAR_AXIS, plan))
    assert error < 0.0408
    assert w[:3] == pytest.approx(PUBLISHED[:3], rel=0.01)
    assert w[3] == pytest.approx(PUBLISHED[3], rel=0.03)
