"""A few rows of a long recording stand for all of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.diagnosis.compare import sample
from sgp_ros.diagnosis.compare.sample import sampled
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.fitted_model import floors
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.screening import screen
from sgp_ros.physics.catalogue import EFFECTS


@pytest.fixture
def few(monkeypatch):
    """Recordings of ten seconds count as long."""
    monkeypatch.setattr(sample, 'SCREENED_ROWS', 160)
    monkeypatch.setattr(sample, 'BLOCK', 16)


def _picked(whole, part):
    """Return the rows of a whole by the times of a part."""
    return np.searchsorted(whole.time, part.time)


def test_a_short_recording_is_taken_as_it_is(equations_for, perfect):
    """The same object, so that nothing is computed twice."""
    _, equations = equations_for(perfect[2])
    assert sampled(equations) is equations
    columns = Columns(equations)
    assert columns.sample is columns


def test_rows_are_those_of_the_whole(equations_for, perfect, few):
    """Target, bases, filtered signals and filtered efforts of late commands."""
    _, equations = equations_for(perfect[2])
    part = sampled(equations)
    rows = _picked(equations, part)
    assert 100 < len(rows) <= 160
    np.testing.assert_array_equal(part.d, equations.d[rows])
    for own, whole in zip(part.bases, equations.bases, strict=True):
        np.testing.assert_array_equal(own, whole[rows])
    for x in ('position', 'velocity', 'effort', 'nominal_effort'):
        own, whole = (e.filter(getattr(e.motion, x)) for e in (part, equations))
        np.testing.assert_allclose(own, whole[rows], rtol=1e-9, atol=1e-9)
    for numbers in ({'delay': 0.02}, {'time_constant': 0.05}):
        own, whole = (e.filter(e.motion.drive.effort(1, **numbers)) for e in (part, equations))
        np.testing.assert_allclose(own, whole[rows], rtol=1e-6, atol=1e-6)


def test_what_is_rare_is_among_them(equations_for, perfect, few):
    """A discrepancy in one block of many, wherever it lies."""
    _, equations = equations_for(perfect[1])
    for row in range(7, len(equations.d), 61):
        d = equations.d.copy()
        d[row, 0] += 100.0
        assert sampled(replace(equations, d=d)).d.max() > 50.0


def test_no_block_reaches_across_a_pause(equations_for, perfect, few):
    """Blocks of one stretch that follow each other are one; those beside a pause stay apart."""
    _, equations = equations_for(perfect[1])
    low = equations.filter
    middle = len(equations.motion.time) // 2
    cut = replace(low, segments=(slice(0, middle), slice(middle, low.segments[0].stop)))
    none = np.zeros((len(cut.rows), 1))
    time = equations.motion.time[cut.rows]
    paused = replace(equations, filter=cut, d=none, time=time, bases=(none,))
    part = sampled(paused)
    times = part.motion.time
    for s in part.filter.segments:
        assert np.ptp(np.diff(times[s])) < 1e-9
        assert not times[s][0] < equations.motion.time[middle] <= times[s][-1]


def test_screening_finds_the_same_law(equations_for, dry, few, monkeypatch):
    """With a gain that stands for all rows."""
    _, equations = equations_for(dry)

    def best(columns):
        start = np.sqrt((equations.d**2).mean(axis=0) + floors(equations))
        laws = [EFFECTS[name] for name in ('coulomb_friction', 'viscous_friction', 'spring')]
        return screen(columns, fit(columns, (), start, is_free=False), laws)[0]

    columns = Columns(equations)
    assert columns.sample is not columns
    gain, law = best(columns)
    monkeypatch.setattr(sample, 'SCREENED_ROWS', 10**6)
    whole, alone = best(Columns(equations))
    assert law.key == alone.key
    assert law.name == 'coulomb_friction'
    assert gain == pytest.approx(whole, rel=0.2)
