"""Laws of implausible equations: one is refused, a robot that changed is learned."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.engine.engine import Engine
from sgp_ros.engine.gate import PATIENCE, without_isolated
from sgp_ros.engine.intake import Intake
from sgp_ros.engine.limits import PERSISTENT
from sgp_ros.engine.results import Counts
from sgp_ros.engine.samples import JointSample, frozen_array
from sgp_ros.engine.snapshots import restored, take_snapshot
from test.engine.worlds import PENDULUM, START_NS, TRUTH, config, pendulum_events

RATE_HZ, BUDGET = 100.0, 60


def _fed(events, engine=None, **settings):
    engine = engine or Engine(PENDULUM, config(refit__enabled=False, **settings))
    found = []
    for event in events:
        found += engine.push(event).estimates
    return engine, found


def _spoiled(events, first, count, size):
    """Return events with the positions of `count` states off by up to `size` [rad]."""
    rng, events = np.random.default_rng(5), list(events)
    states = [i for i, event in enumerate(events) if isinstance(event, JointSample)]
    for i in states[first : first + count]:
        off = size * (rng.normal() if count > 1 else 1.0)
        events[i] = replace(events[i], position=frozen_array(events[i].position + off))
    return events


def _error(estimates):
    return np.nanmean([(e.acceleration.mean - e.acceleration.measured) ** 2 for e in estimates])


@pytest.mark.parametrize('first', [30, 700])
@pytest.mark.parametrize('size', [0.5, 10.0, 1e6])
def test_one_wrong_position_is_refused_and_forgotten(first, size):
    """Before the first model as well as later, whatever its size."""
    events = pendulum_events(1600)
    engine, found = _fed(_spoiled(events, first, 1, size))
    _, expected = _fed(events)
    assert 1 <= engine.counts.implausible <= 3  # the windows that hold it
    assert _error(found[-150:]) < 1.1 * _error(expected[-150:])


def test_a_clean_stream_loses_nothing():
    engine, _ = _fed(pendulum_events(1600))
    assert engine.counts.implausible == 0
    assert engine.estimator.before is None


def test_garbage_for_seconds_is_learned_and_then_forgotten():
    """No gate tells it from a robot that changed; the model of before does, once it fits again."""
    events = pendulum_events(2000)
    engine, found = _fed(_spoiled(events, 800, 300, 1.0))
    _, expected = _fed(events)
    assert engine.counts.implausible >= PATIENCE // 2
    assert engine.counts.reverted == 1
    assert _error(found[-100:]) < 1.1 * _error(expected[-100:])


def test_a_load_that_is_picked_up_is_learned():
    """Gravity grows by half at once: after a while predictions are as good as before."""
    before = pendulum_events(1000, noise=1e-6)
    gravity = TRUTH['gravity']
    try:
        TRUTH['gravity'] = 1.5 * gravity
        loaded = pendulum_events(2000, noise=1e-6)
    finally:
        TRUTH['gravity'] = gravity
    shift = before[-1].stamp_ns + 10**7 - loaded[0].stamp_ns
    after = [replace(event, stamp_ns=event.stamp_ns + shift) for event in loaded]
    engine, found = _fed([*before, *after])
    assert engine.counts.reverted == 0
    at = [e.stamp_ns > before[-1].stamp_ns for e in found].index(True)
    assert _error(found[at : at + 20]) > 30.0 * _error(found[at - 100 : at])
    assert _error(found[-100:]) < 0.03 * _error(found[at : at + 20])
    assert all(e.is_learned for e in found[-100:])


@pytest.mark.parametrize('stop', [900, 1080, 1130])
def test_a_snapshot_keeps_what_was_learned_before(stop):
    """While garbage is learned, and while the two models are compared."""
    events = _spoiled(pendulum_events(2000), 800, 300, 1.0)
    whole, expected = _fed(events)
    engine, _ = _fed(events[: 2 * stop])
    assert (engine.estimator.before is not None) == (stop > 900)
    file = io.BytesIO()
    np.savez(file, **take_snapshot(engine))
    file.seek(0)
    with np.load(file, allow_pickle=False) as snapshot:
        again = restored(PENDULUM, snapshot)
    again, found = _fed(events[2 * stop :], again)
    assert again.counts == whole.counts
    np.testing.assert_array_equal(
        [e.acceleration.mean for e in found],
        [e.acceleration.mean for e in expected][-len(found) :],
    )


def test_states_far_beyond_the_limits_are_refused_until_they_persist():
    """Three times a limit of speed or effort; after many in a row the limits are wrong."""
    joint = replace(
        PENDULUM.joints[0], lower=-3.0, upper=3.0, velocity_limit=2.0, effort_limit=5.0
    )
    intake = Intake(replace(PENDULUM, joints=(joint,)), config(), Counts())

    def take(i, position, velocity=0.0, effort=0.0):
        values = (frozen_array([x]) for x in (position, velocity, effort))
        return intake.take_state(JointSample(START_NS + i * 10**7, ('hinge',), *values))

    assert take(0, 8.9, 5.9, 14.9)
    for i, values in enumerate([(9.1,), (-9.1,), (0.0, -6.1), (0.0, 0.0, 15.1)], start=1):
        assert take(i, *values) is None
    assert intake._counts.refused['implausible'] == 4
    found = [take(10 + i, 20.0) for i in range(120)]
    assert found.index(next(filter(None, found))) == PERSISTENT - 3
    assert take(130, 0.0)
    assert take(131, 20.0)  # wrong for good


@pytest.mark.parametrize(('every', 'is_learned'), [(5, True), (20, False)])
def test_limits_that_a_motion_passes_now_and_then_are_wrong(every, is_learned):
    """A motion does so again and again; a sensor that errs seldom stays refused."""
    joint = replace(PENDULUM.joints[0], velocity_limit=1.0)
    intake = Intake(replace(PENDULUM, joints=(joint,)), config(), Counts())
    for i in range(2000):
        speed = 8.0 if i % every == 0 else 0.5
        values = (frozen_array([x]) for x in (0.0, speed, 0.0))
        taken = intake.take_state(JointSample(START_NS + i * 10**7, ('hinge',), *values))
    assert i % every != 0
    assert taken
    refused = intake._counts.refused['implausible']
    assert (refused < 2000 // every) == is_learned


def test_only_what_returns_is_isolated():
    """A motion that begins near the end of the first samples is no outlier."""
    values = np.random.default_rng(0).normal(size=(50, 2))
    values[20:22] += 1e3
    values[44:] += 1e3
    kept = without_isolated(list(range(50)), list(values))
    assert kept == [i for i in range(50) if i not in (20, 21)]
