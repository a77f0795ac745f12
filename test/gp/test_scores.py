"""Laws of the test for drift."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.gp.scores import SAMPLES_PER_ALARM, SLACK, THRESHOLD, DriftTest, run_length


def _alarms(errors):
    """Return at which errors an alarm began."""
    test, found, before = DriftTest(), [], False
    for i, error in enumerate(errors):
        test.add(float(error))
        if test.is_drifting and not before:
            found.append(i)
        before = test.is_drifting
    return found


def test_the_threshold_is_that_of_the_stated_run_length():
    """The bisection inverts the formula."""
    assert run_length(THRESHOLD) == pytest.approx(SAMPLES_PER_ALARM, rel=1e-9)


def test_the_formula_of_the_run_length_is_that_of_a_simulation():
    """400 sums of normal scores: the mean of as many run lengths has a deviation of 5 %."""
    rng = np.random.default_rng(0)
    threshold = 8.0
    sums, lengths, alive = np.zeros(400), np.zeros(400), np.ones(400, dtype=bool)
    while alive.any():
        sums = np.maximum(sums + rng.standard_normal(400) - SLACK, 0.0)
        lengths += alive
        alive &= sums <= threshold
    assert lengths.mean() == pytest.approx(run_length(threshold), rel=0.2)


@pytest.mark.parametrize('scale', [0.01, 1.0, 30.0])
def test_errors_that_do_not_grow_give_no_alarm(scale):
    """At any size: 100 000 errors make a false alarm with a chance of a tenth; two, of 0.005."""
    rng = np.random.default_rng(1)
    assert len(_alarms(scale * rng.standard_normal(100_000))) <= 1


def test_correlated_errors_give_no_more_alarms():
    """Windows that overlap by half correlate neighbouring errors by a half."""
    white = np.random.default_rng(2).standard_normal(100_001)
    assert len(_alarms((white[1:] + white[:-1]) / np.sqrt(2.0))) <= 1


def test_normal_scores_are_standard_normal():
    """Mean and variance of 20 000 scores, each within four standard deviations of its own."""
    test, scores = DriftTest(), []
    for error in 5.0 * np.random.default_rng(3).standard_normal(20_000):
        test.add(float(error))
        scores.append(test.score)
    found = np.array(scores[30:])
    assert abs(found.mean()) < 4.0 / np.sqrt(len(found))
    assert abs(found.var() - 1.0) < 4.0 * np.sqrt(2.0 / len(found)) + 0.01


@pytest.mark.parametrize(('growth', 'delay'), [(1.5, 300), (3.0, 40)])
def test_errors_that_grow_are_reported(growth, delay):
    """An alarm comes after the change and soon, the sooner the more they grow."""
    for seed in range(20):
        errors = np.random.default_rng(seed).standard_normal(4000)
        errors[2000:] *= growth
        alarms = _alarms(errors)
        assert alarms
        assert 2000 <= alarms[0] < 2000 + delay


def test_one_outlier_is_no_drift():
    """A wild measurement counts as four deviations at most."""
    errors = np.random.default_rng(4).standard_normal(2000)
    errors[1000] = 1e6
    assert not _alarms(errors)


def test_errors_that_stay_at_zero_are_survived():
    """A robot at rest in a simulation has no error at all."""
    assert not _alarms(np.zeros(100))
