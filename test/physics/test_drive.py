"""Efforts that held commands give behind a delay, a characteristic and a lag, in one window."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.physics.drive import Drive, WindowDrive


@pytest.mark.parametrize('form', ['positions', 'velocities'])
@pytest.mark.parametrize(('delay', 'time_constant'), [(0.0, 0.0), (0.03, 0.0), (0.02, 0.015)])
def test_the_average_over_a_window_is_that_of_the_effort_at_every_time(form, delay, time_constant):
    """By the rule of the midpoint on a fine grid; the kernel may jump at the samples."""
    rng = np.random.default_rng(0)
    times = np.sort(rng.uniform(-0.3, 0.2, size=25))
    values = rng.normal(size=(25, 2))
    samples = np.cumsum(rng.uniform(0.004, 0.012, size=14))
    samples -= samples[0]
    left = rng.uniform(size=13)
    right = left if form == 'velocities' else np.append(left[1:], 0.0)

    def characteristic(u):
        return np.clip(u, -0.5, 0.5)

    asked = {'delay': delay, 'time_constant': time_constant, 'characteristic': characteristic}
    found = WindowDrive(times, values, samples, left, right).effort(1, **asked)
    edges = np.linspace(0.0, samples[-1], 400_001)
    t = 0.5 * (edges[1:] + edges[:-1])
    at = np.searchsorted(samples, t, side='right') - 1
    share = (t - samples[at]) / np.diff(samples)[at]
    kernel = left[at] + share * (right - left)[at]
    effort = Drive(times, values, (), 1.0).at(1, t, **asked)
    assert found == pytest.approx([kernel @ effort * (edges[1] - edges[0])], abs=1e-6)


def test_before_the_first_command_that_one_holds_and_a_lag_is_settled():
    samples = np.array([0.0, 0.1, 0.2])
    kernel = np.full(2, 5.0)
    drive = WindowDrive(np.array([0.15]), np.array([[2.0]]), samples, kernel, kernel)
    for time_constant in (0.0, 0.05):
        assert drive.effort(0, delay=0.3, time_constant=time_constant) == pytest.approx([2.0])
