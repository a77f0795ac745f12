"""The monitor of errors that stay outside their interval."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_proof.streams.alarm_nulls import NULLS
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


@pytest.mark.parametrize('null', NULLS)
def test_false_alarms_are_as_rare_as_they_were_asked_to_be(null):
    """Sixty an hour are asked for, so that an hour tells: up to three deviations more."""
    errors = NULLS[null](HOUR, np.random.default_rng(0))
    alarms, _ = _alarms(errors, 60.0, IntervalScale())
    assert alarms < 60 + 3.0 * np.sqrt(60)


def test_a_monitor_does_not_get_used_to_collisions():
    """Though there are a hundred times as many as alarms are accepted by chance."""
    rng = np.random.default_rng(2)
    errors = NULLS['correlation 0.6'](HOUR, rng)
    starts = np.arange(1200, HOUR, HOUR // 100)
    for start in starts:
        errors[start : start + 40] += 12.0
    alarms, _ = _alarms(errors, 1.0, IntervalScale())
    assert 0.95 * len(starts) <= alarms <= len(starts) + 5


def test_an_error_that_stays_alarms_and_its_end_is_reported():
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
    assert monitor.add(10**15, 9.0, 1.0, 1.0)
    assert not monitor.is_alarmed
