"""The monitor of errors that stay outside their interval."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.engine.monitoring import ExcursionMonitor
from sgp_ros.gp.calibration import IntervalScale

STEP_NS = 50_000_000
HOUR = 3600 * 10**9 // STEP_NS


def _alarms(errors, per_hour, scale=None):
    """Return how often and for how many errors a monitor alarms; raw variances are 1."""
    monitor, lasting = ExcursionMonitor(0.1, per_hour), 0
    for i, error in enumerate(errors):
        variance = 1.0 if scale is None else scale.variance(1.0)
        monitor.add(i * STEP_NS, error, variance, 1.0)
        if scale is not None:
            scale.add(error, 1.0)
        lasting += monitor.is_alarmed
    return monitor.alarms, lasting


@pytest.mark.parametrize('correlation', [0.0, 0.6])
def test_false_alarms_are_as_rare_as_they_were_asked_to_be(correlation):
    """Sixty an hour are asked for, so that an hour tells; correlated errors are no exception."""
    noise = np.random.default_rng(0).standard_normal(HOUR)
    errors = np.empty(HOUR)
    last = 0.0
    for i, fresh in enumerate(noise):
        errors[i] = last = correlation * last + np.sqrt(1.0 - correlation**2) * fresh
    alarms, _ = _alarms(errors, 60.0, IntervalScale())
    assert alarms < 1.5 * 60


def test_an_error_that_stays_alarms_and_its_end_is_told():
    """Though the calibration would soon have widened the interval beyond it."""
    rng = np.random.default_rng(1)
    errors = rng.standard_normal(2000)
    errors[1000:1100] += 12.0
    alarms, lasting = _alarms(errors, 1.0, IntervalScale())
    assert alarms == 1
    assert 80 < lasting <= 100


def test_an_excursion_ends_with_its_segment():
    monitor = ExcursionMonitor(0.1, 1000.0)
    for i in range(50):
        monitor.add(i * STEP_NS, 9.0, 1.0, 1.0)
    assert monitor.is_alarmed
    monitor.add(10**15, 0.0, 1.0, 1.0)
    assert not monitor.is_alarmed
