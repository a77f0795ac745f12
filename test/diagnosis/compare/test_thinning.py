"""A high rate adds rows, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.diagnosis.compare.parallel_filter import ParallelFilter
from sgp_ros.diagnosis.compare.several import join
from sgp_ros.diagnosis.compare.thinning import thinned
from sgp_ros.diagnosis.compare.trajectory import (
    HIGHEST_CUTOFF_HZ,
    Bandwidth,
    RawTrajectory,
    observe,
    parallel_filter,
)
from sgp_ros.physics.drive import Drive
from sgp_ros.robots.gains import Gains

RATE, SECONDS = 1000.0, 6.0


def _raw(effort=None, drive=None, rate=RATE, segments=None, **more):
    """Return a swinging joint at a rate [Hz]."""
    n = round(SECONDS * rate)
    t = np.arange(n) / rate
    q = np.sin(2 * np.pi * 0.7 * t)[:, None]
    return RawTrajectory(
        t, 1.0 / rate, q, None, effort, drive, segments or (slice(0, n),), {}, np.zeros(1), 0,
        **more,
    )  # fmt: skip


def _drive(rate=RATE):
    """Return commands at half of the rate of the states, of slow motion."""
    n = round(SECONDS * rate)
    times = np.arange(0.0, SECONDS, 2.0 / rate)
    return Drive(times, np.sin(2 * np.pi * times)[:, None], ((0.0, n),), 1.0 / rate)


@pytest.mark.parametrize('rate', [100.0, 200.0, 250.0, 390.0])
def test_rows_that_the_band_needs_all_stay(rate):
    """The same object."""
    raw = _raw(np.zeros((round(SECONDS * rate), 1)), rate=rate)
    assert thinned(raw) is raw


def test_settled_points_and_position_targets_stay_as_they_are():
    """Rows of the first are no motion; a drive holds its targets between the rows."""
    still = _raw(np.zeros((6000, 1)), approach=np.ones((6000, 1)))
    held = _raw(drive=_drive(), gains=Gains(np.ones(1), np.ones(1)))
    assert thinned(still) is still
    assert thinned(held) is held


@pytest.mark.parametrize('rate', [400.0, 500.0, 1000.0, 4000.0])
def test_eight_rows_per_period_of_the_highest_cutoff_stay(rate):
    """Of whatever rate, and fewer than twice as many."""
    raw = _raw(np.zeros((round(SECONDS * rate), 1)), rate=rate)
    few = thinned(raw)
    assert 8.0 <= 1.0 / few.step / HIGHEST_CUTOFF_HZ < 16.0
    np.testing.assert_allclose(np.diff(few.time), few.step, rtol=1e-9)
    assert few.segments == (slice(0, len(few.time)),)


def test_noise_above_the_band_does_not_fold_into_it():
    """White noise of the effort is as large behind the filter as at the full rate."""
    noise = np.random.default_rng(0).standard_normal((6000, 1))
    raw = _raw(noise)
    few, band = thinned(raw), Bandwidth(HIGHEST_CUTOFF_HZ, 60.0)
    whole = parallel_filter(raw, band)(raw.effort).std()
    assert parallel_filter(few, band)(few.effort).std() == pytest.approx(whole, rel=0.03)
    every = round(few.step * RATE)
    left_out = ParallelFilter(RATE / every, HIGHEST_CUTOFF_HZ, few.segments)(noise[::every])
    assert left_out.std() > 1.8 * whole  # what the low-pass is for


def test_the_motion_is_that_of_the_full_rate(robots):
    """Positions, speeds and accelerations in the band, at the same times."""
    raw = _raw(np.zeros((6000, 1)))
    band, tree = Bandwidth(HIGHEST_CUTOFF_HZ, 2.5 * HIGHEST_CUTOFF_HZ), robots[1][1]
    whole, few = observe(raw, tree, band), observe(thinned(raw), tree, band)
    rows = np.searchsorted(whole.time, few.time - 1e-9)
    inner = slice(60, -60)
    for x in ('position', 'velocity', 'acceleration'):
        own, full = getattr(few, x)[inner], getattr(whole, x)[rows][inner]
        np.testing.assert_allclose(own, full, atol=1e-4 * np.abs(full).max())


def test_commands_keep_their_times():
    """On fewer rows they give the same efforts as before, delayed or not."""
    raw = _raw(drive=_drive())
    few = thinned(raw)
    rows = np.searchsorted(raw.time, few.time - 1e-9)
    for delay in (0.0, 0.013):
        own, full = few.drive.effort(0, delay=delay), raw.drive.effort(0, delay=delay)
        np.testing.assert_allclose(own[20:-20], full[rows][20:-20], atol=2e-3)


def test_stretches_and_recordings_are_thinned_each_from_its_start():
    """No row of one is left out for the end of another, with commands and without."""
    n = 6000
    cut = Drive(_drive().times, _drive().values, ((0.0, 2003), (2.003, n - 2003)), 1.0 / RATE)
    paused = _raw(drive=cut, segments=(slice(0, 2003), slice(2003, n)))
    few = thinned(join([paused, paused]))
    lengths = [s.stop - s.start for s in few.segments]
    assert lengths == 2 * [401, 800]
    assert few.drive.rows == len(few.time) == len(few.recording) == sum(lengths)
    np.testing.assert_array_equal(few.recording, np.repeat([0, 1], sum(lengths) // 2))
    starts = [few.time[s.start] for s in few.segments]
    np.testing.assert_allclose(starts, [0.0, 2.003, 0.0, 2.003])
    measured = thinned(replace(paused, drive=None, effort=np.ones((n, 1))))
    np.testing.assert_allclose(measured.effort, 1.0)
    assert len(measured.effort) == 1201
