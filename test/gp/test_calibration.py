"""Laws of intervals that errors calibrate."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sgp_ros.gp.calibration import RATE, RISK, IntervalScale
from sgp_ros.gp.scores import INTERVAL_95


def _followed(errors):
    """Return the half width before each error, and the scale after all of them."""
    scale, widths = IntervalScale(), []
    for error in errors:
        widths.append(INTERVAL_95 * np.sqrt(scale.variance(1.0)))
        scale.add(float(error), 1.0)
    return np.array(widths), scale


@given(st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=200))
def test_the_share_of_misses_is_bounded_for_any_errors(errors):
    """Each miss moves the integrator by a fixed amount, each hit back: no distribution enters."""
    widths, scale = _followed(errors)
    misses = np.abs(errors) > widths
    bound = abs(scale.log_width) / (RATE * len(errors))
    assert abs(misses.mean() - RISK) <= bound + 1e-9


@pytest.mark.parametrize('size', [1e-3, 1.0, 1e3])
def test_intervals_hold_their_rate_under_coloured_noise_that_changes(size):
    """Half-overlapping errors whose deviation swings by a factor of ten; 0.01 is 3 deviations."""
    rng = np.random.default_rng(0)
    white = rng.standard_normal(4001)
    swing = np.exp(1.15 * np.sin(2.0 * np.pi * np.arange(4000) / 200.0))
    errors = size * swing * (white[1:] + white[:-1])
    widths, _ = _followed(errors)
    after = slice(100, None)
    assert np.mean(np.abs(errors) <= widths) == pytest.approx(0.95, abs=0.01)
    narrowest = np.quantile(np.abs(errors[after]), 0.95)
    assert widths[after].mean() < 1.3 * narrowest


def test_white_errors_of_the_predicted_variance_need_few_corrections():
    """A model that is right loses less than a fifth of its width to the calibration."""
    widths, _ = _followed(np.random.default_rng(1).standard_normal(5000))
    assert widths.mean() == pytest.approx(INTERVAL_95, rel=0.2)


def test_an_outlier_widens_no_interval_for_long():
    """One absurd error leaves the width below twice its former one after three memories."""
    errors = np.random.default_rng(2).standard_normal(300)
    errors[200] = 1e9
    widths, _ = _followed(errors)
    assert widths[230] < 2.0 * widths[190:200].mean()


def test_errors_of_zero_leave_a_variance():
    """A channel that is constant for an hour can still be scored after it."""
    _, scale = _followed(np.zeros(10_000))
    assert scale.variance(1.0) > 0.0
    assert np.isfinite(1.0 / scale.variance(1.0))


def test_a_scale_continues_from_its_saved_values():
    """Three numbers and the count are the whole state."""
    errors = np.random.default_rng(3).standard_normal(50)
    _, first = _followed(errors[:25])
    again = IntervalScale(**asdict(first))
    _, whole = _followed(errors)
    for error in errors[25:]:
        again.add(float(error), 1.0)
    assert again == whole
