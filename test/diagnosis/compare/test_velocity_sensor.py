"""A velocity field that lags is found, one that does not is left alone."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from sgp_ros.diagnosis.compare.velocity_sensor import lagged, sensor_lags
from test.diagnosis.worlds import PERIOD


def test_no_lag_changes_nothing_and_a_ramp_comes_late_by_the_time_constant():
    """Exact for straight lines between the samples."""
    t = PERIOD * np.arange(400)
    np.testing.assert_array_equal(lagged(t, 0.0, PERIOD), t)
    late = lagged(t, 0.05, PERIOD)
    np.testing.assert_allclose(late, t - 0.05 * (1.0 - np.exp(-t / 0.05)), atol=1e-12)
    np.testing.assert_allclose(lagged(np.full(9, 3.0), 0.1, PERIOD), 3.0)


@pytest.mark.parametrize('planted', [0.01, 0.04])
def test_a_planted_lag_is_found_on_its_joint_alone(equations_for, perfect, planted):
    """T dv_T/dt + v_T = v, integrated here on the true velocity."""
    world = perfect[2]
    t = world.time
    velocity = world.velocity.copy()
    true = CubicSpline(t, velocity[:, 1])
    slow = solve_ivp(
        lambda s, v: (true(s) - v) / planted, (0.0, t[-1]), velocity[:1, 1], t_eval=t, rtol=1e-6
    )
    velocity[:, 1] = slow.y[0]
    raw, equations = equations_for(world, velocity=velocity)
    right, slow = sensor_lags(raw, equations)
    assert not right.is_physics
    assert slow.is_physics
    assert slow.joint == 1
    assert slow.time_constant == pytest.approx(planted, rel=0.02)
    assert 0.0 < slow.std < 0.1 * planted
    assert 0.0 < slow.share < 1.0


def test_without_measured_velocities_there_is_nothing_to_compare(equations_for, perfect):
    """No lag, no error."""
    assert sensor_lags(*equations_for(perfect[2])) == []


def test_noise_of_the_sensor_is_no_lag(equations_for, perfect):
    """Significant or not, a lag must explain the difference."""
    world = perfect[1]
    noise = np.random.default_rng(0).normal(0.0, 0.5, world.velocity.shape)
    lags = sensor_lags(*equations_for(world, velocity=world.velocity + noise))
    assert not any(lag.is_physics for lag in lags)
