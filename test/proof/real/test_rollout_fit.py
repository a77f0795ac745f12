"""Laws of the output-error fit: planted coefficients are found where regression is biased."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_proof.real.rollout_fit import RolloutFitOptions, fit_rollouts
from sgp_ros.batch.rollout import Windows, cut_windows, joined, roll_out
from sgp_ros.errors import ConfigError, NumericalError
from sgp_ros.robots.registry import load_robot

pytestmark = pytest.mark.long

STEP = 0.01
PENDULUM, DOUBLE = load_robot('simple_pendulum'), load_robot('double_pendulum')
W = np.array([0.15, 3.0, 0.05, 0.1, 0.05])
W_DOUBLE = np.array([0.14, 0.03, 0.04, 0.03, 2.4, 1.0, 0.02, 0.01, 0.15, 0.1, 0.01, -0.02])


def _recorded(robot, w, seed, noise, seconds=12.0):
    """Windows of a recording that the model itself made, positions and velocities noisy."""
    rng = np.random.default_rng(seed)
    k, n = len(robot.joints), round(seconds / STEP)
    time = STEP * np.arange(n + 1)
    phase = rng.uniform(0.0, 6.0, size=(4, 1, k))
    tones = np.array([2.0, 5.0, 9.0, 15.0])[:, None, None]
    effort = 0.4 * np.sin(tones * time[:, None] + phase).sum(axis=0)
    held = 0.5 * (effort[1:] + effort[:-1])
    q, v = roll_out(robot, w, rng.normal(size=(1, k)), np.zeros((1, k)), held[None], STEP)
    q, v = (
        q[0] + noise * rng.normal(size=q[0].shape),
        v[0] + 5 * noise * rng.normal(size=q[0].shape),
    )
    return cut_windows(time, q, v, effort, 0.3, 0.1)


def test_planted_coefficients_are_recovered_without_noise():
    """From a start that is off by a third, to the accuracy of the search."""
    windows = _recorded(PENDULUM, W, 0, 0.0)
    fit = fit_rollouts(windows, PENDULUM, W * [1.3, 0.7, 1.3, 0.7, 1.3])
    assert fit.is_converged
    assert fit.diverged == 0
    np.testing.assert_allclose(fit.W, W, rtol=1e-4, atol=1e-5)


def test_planted_coefficients_of_two_joints_are_recovered():
    """Coupled inertias and dry friction in both joints."""
    windows = _recorded(DOUBLE, W_DOUBLE, 1, 0.0, seconds=2.0)
    start = W_DOUBLE * np.random.default_rng(0).uniform(0.9, 1.1, 12)
    fit = fit_rollouts(windows, DOUBLE, start, RolloutFitOptions(compare_every=10))
    np.testing.assert_allclose(fit.W, W_DOUBLE, rtol=1e-3, atol=1e-4)


def test_intervals_are_of_the_size_of_the_errors():
    """Chi-squared of three fits of five coefficients: 15 within five standard deviations of it."""
    chi_squared = 0.0
    for seed in range(3):
        windows = _recorded(PENDULUM, W, seed, 2e-3, seconds=20.0)
        fit = fit_rollouts(windows, PENDULUM, W, RolloutFitOptions(compare_every=10))
        error = fit.W - W
        chi_squared += error @ np.linalg.solve(fit.covariance, error)
    assert 2.0 < chi_squared < 15.0 + 5.0 * np.sqrt(2.0 * 15.0)


def test_too_few_blocks_give_no_intervals():
    """Four stretches say nothing of the scatter of five coefficients; the fit itself stands."""
    fit = fit_rollouts(_recorded(PENDULUM, W, 0, 0.0, seconds=2.5), PENDULUM, W)
    assert np.isnan(fit.std).all()
    assert np.isfinite(fit.W).all()


def test_a_scale_of_one_effort_is_found():
    """The torque constant of one joint is wrong, that of the other is the unit."""
    windows = _recorded(DOUBLE, W_DOUBLE, 1, 0.0, seconds=2.0)
    wrong = replace(windows, effort=windows.effort / [1.0, 1.2])
    options = RolloutFitOptions(compare_every=10, free_gains=('elbow',))
    fit = fit_rollouts(wrong, DOUBLE, W_DOUBLE, options)
    np.testing.assert_allclose(fit.gains, [1.0, 1.2], rtol=1e-3)
    assert fit.covariance.shape == (13, 13)
    assert fit.std.shape == (12,)


def test_bounds_hold():
    """A recording with no viscous friction asks for none or less."""
    truth = W * [1.0, 1.0, -1.0, 1.0, 1.0]
    windows = _recorded(PENDULUM, truth, 3, 0.0, seconds=3.0)
    fit = fit_rollouts(windows, PENDULUM, W, RolloutFitOptions(lower={'Fv': 0.0}))
    assert 0.0 <= fit.W[2] < 1e-3


def test_robust_loss_follows_the_many_not_the_few():
    """Two windows of twenty whose effort was recorded wrongly."""
    windows = _recorded(PENDULUM, W, 4, 1e-4, seconds=4.0)
    effort = windows.effort.copy()
    effort[::10] += 1.0
    broken = replace(windows, effort=effort)
    error = [
        np.abs(fit_rollouts(broken, PENDULUM, W, RolloutFitOptions(loss=loss)).W / W - 1.0).max()
        for loss in ('linear', 'soft_l1')
    ]
    assert error[1] < 0.5 * error[0]


def test_a_start_from_which_some_roll_outs_diverge_is_recovered_from():
    """Friction that pushes: cut errors still point the way back."""
    windows = _recorded(PENDULUM, W, 5, 0.0, seconds=6.0)
    fit = fit_rollouts(windows, PENDULUM, W * [1.0, 1.0, -20.0, 1.0, 1.0])
    np.testing.assert_allclose(fit.W, W, rtol=1e-3, atol=1e-4)


def test_a_start_from_which_all_roll_outs_diverge_is_refused():
    """There is nothing to descend on."""
    windows = _recorded(PENDULUM, W, 0, 0.0, seconds=2.0)
    with pytest.raises(NumericalError, match='diverge'):
        fit_rollouts(windows, PENDULUM, np.array([0.0, 3.0, 0.0, 0.0, 0.0]))


def test_windows_that_do_not_determine_the_coefficients_are_refused():
    """A pendulum that never moves shows no inertia."""
    rest = np.zeros((5, 31, 1))
    still = Windows(rest, rest, rest[:, 1:], STEP, np.arange(5))
    with pytest.raises(NumericalError, match='determine'):
        fit_rollouts(joined([still]), PENDULUM, W)


@pytest.mark.parametrize(
    ('options', 'found'),
    [
        (RolloutFitOptions(lower={'mass': 0.0}), 'mass'),
        (RolloutFitOptions(free_gains=('knee',)), 'knee'),
        (RolloutFitOptions(free_gains=('pendulum',)), 'not all'),
    ],
)
def test_options_of_what_the_robot_lacks_are_refused(options, found):
    """One line that names it."""
    with pytest.raises(ConfigError, match=found):
        fit_rollouts(_recorded(PENDULUM, W, 0, 0.0, seconds=1.0), PENDULUM, W, options)
