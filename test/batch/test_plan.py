"""Laws of the choice of a filter from the recording."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.batch import plan
from sgp_ros.batch.least_squares import autocorrelation, joined, least_squares, solved, triangles
from sgp_ros.batch.plan import WHITE, choose_plan
from sgp_ros.batch.regression_data import filtered_data
from sgp_ros.batch.signals import collect_signals
from sgp_ros.engine.config import EngineConfig
from sgp_ros.errors import RecordingError
from sgp_ros.robots.registry import load_robot
from test.batch.worlds import AXIS_TRUTH, emps_signals, moved_axis, simulated_events

LINEAR_AXIS = load_robot('linear_axis')
REACTION_WHEEL = load_robot('reaction_wheel')

WORLDS = {
    'noisy force': {'force': 5.0, 'encoder': 1e-6},
    'noisy encoder': {'force': 0.5, 'encoder': 1e-4},
    'both': {'force': 2.0, 'encoder': 3e-5},
}


def _error(signals, filter_plan):
    data = filtered_data(signals, LINEAR_AXIS, filter_plan)
    w, _ = least_squares(data.F, data.y)
    return np.linalg.norm((w / AXIS_TRUTH - 1.0)[:3])


@pytest.mark.parametrize(
    'world', ['both', *(pytest.param(x, marks=pytest.mark.long) for x in WORLDS if x != 'both')]
)
def test_the_chosen_cutoff_is_nearly_as_good_as_the_best_one(world):
    """Over eight recordings the error of the coefficients is within half of the best fixed one.

    The worst fixed cut-off is at least four times worse where the encoder is noisy: the choice is
    not one that any cut-off would pass.
    """
    chosen, fixed = [], {}
    for seed in range(8):
        signals = moved_axis(seed, **WORLDS[world])
        choice = choose_plan(signals, LINEAR_AXIS)
        chosen.append(_error(signals, choice.plan))
        for candidate in choice.candidates:
            error = _error(signals, candidate.plan)
            fixed.setdefault(candidate.plan.cutoff, []).append(error)
    overall = [np.sqrt(np.mean(np.square(errors))) for errors in fixed.values()]
    assert np.sqrt(np.mean(np.square(chosen))) < 1.5 * min(overall)
    if world != 'noisy force':
        assert max(overall) > 4.0 * min(overall)


def test_more_noise_of_the_encoder_lowers_the_cutoff():
    """The noise of the acceleration grows with the square of the frequency."""
    cutoffs = []
    for encoder in (1e-6, 1e-3):
        choices = [
            choose_plan(moved_axis(seed, encoder=encoder), LINEAR_AXIS) for seed in range(3)
        ]
        cutoffs.append(np.median([choice.plan.cutoff for choice in choices]))
    assert cutoffs[0] > 2.0 * cutoffs[1]


def test_a_complete_model_leaves_a_white_residual():
    """The rows stand as far apart as white noise behind the filter needs."""
    choice = choose_plan(moved_axis(1, encoder=1e-6), LINEAR_AXIS)
    assert choice.autocorrelation < 2.0 * WHITE
    assert choice.plan.decimation == pytest.approx(100.0 / choice.plan.cutoff, rel=0.4)


def test_an_incomplete_model_is_said_to_leave_a_coloured_residual():
    """No thinning makes structure white, and the choice says so."""
    signals = moved_axis(1, extra=lambda v: 20.0 * np.tanh(v / 0.02) * v)
    choice = choose_plan(signals, LINEAR_AXIS)
    assert not choice.is_white


@pytest.mark.parametrize(('noise', 'source'), [(1e-4, 'measured'), (3e-2, 'position')])
def test_the_better_source_of_velocity_is_chosen(noise, source):
    """A good tachometer beats a noisy encoder, a bad one does not."""
    signals = moved_axis(2, encoder=1e-5)
    clean = moved_axis(2, encoder=0.0)
    speed = np.gradient(clean.position[:, 0], clean.time)[:, None]
    speed = speed + noise * np.random.default_rng(0).normal(size=speed.shape)
    choice = choose_plan(replace(signals, velocity=speed), LINEAR_AXIS)
    assert choice.plan.velocity_source == source
    for name in ('measured', 'position'):
        assert choice.least_regret(name).regret >= choice.least_regret(source).regret


def test_joints_of_different_size_count_alike():
    """Every joint is judged in its own unit: the slow pole beside the fast wheel."""
    events = list(simulated_events('reaction_wheel', 20.0))
    signals = collect_signals(events, REACTION_WHEEL, EngineConfig(max_gap=0.1))
    choice = choose_plan(signals, REACTION_WHEEL)
    data = filtered_data(signals, REACTION_WHEEL, choice.plan)
    w, _ = least_squares(data.F, data.y)
    error = data.y - data.F @ w
    assert np.all(np.std(error, axis=0) < 0.15 * np.std(data.y, axis=0))


def test_a_real_axis_gets_its_published_parameters():
    """EMPS: one of the plans under which they are right, chosen without knowing them."""
    signals = emps_signals()
    choice = choose_plan(signals, LINEAR_AXIS)
    data = filtered_data(signals, LINEAR_AXIS, choice.plan)
    w, rms = least_squares(data.F, data.y)
    assert w[:3] == pytest.approx([95.1089, 203.5034, 20.3935], rel=0.005)
    assert rms[0] < 0.0408 * np.sqrt(np.mean(data.y**2))
    assert not choice.is_white


def test_a_part_of_a_long_recording_decides_for_it(monkeypatch):
    """The choice from half of it gives coefficients within one per cent."""
    signals = moved_axis(0, duration=120.0, encoder=1e-4)
    whole = choose_plan(signals, LINEAR_AXIS)
    monkeypatch.setattr(plan, '_MOST_SAMPLES', 12_000)
    part = choose_plan(signals, LINEAR_AXIS)
    assert max(c.rows for c in part.candidates) < 0.6 * max(c.rows for c in whole.candidates)
    worst = max(_error(signals, candidate.plan) for candidate in whole.candidates)
    assert _error(signals, part.plan) < 0.01 < 0.1 * worst


def test_a_recording_too_short_for_every_filter_is_refused():
    """The error says what would do."""
    with pytest.raises(RecordingError, match='record longer'):
        choose_plan(moved_axis(0, duration=0.3), LINEAR_AXIS)


def test_leaving_out_a_block_equals_fitting_the_rest():
    """The triangular factors of the blocks hold all that the fit needs."""
    rng = np.random.default_rng(0)
    F, y, scale = rng.normal(size=(60, 2, 4)), rng.normal(size=(60, 2)), np.array([1.0, 3.0])
    parts = [joined(triangles(F[i : i + 20], y[i : i + 20]), scale) for i in (0, 20, 40)]
    direct = solved([joined(triangles(F[20:], y[20:]), scale)])
    assert solved(parts[1:]) == pytest.approx(direct, rel=1e-10)


def test_neighbours_in_different_blocks_do_not_correlate():
    """A step between two blocks is no correlation within them."""
    residual = np.concatenate([np.tile([1.0, -1.0], 20), np.tile([-1.0, 1.0], 20)])[:, None]
    block = np.repeat([0, 1], 40)
    assert autocorrelation(residual, block, 1) == pytest.approx(-1.0)
