"""Laws of the time of refits: a robot that rests tells nothing new of the hyper-parameters."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.engine.engine import Engine
from sgp_ros.engine.progress import SHARE, Progress
from sgp_ros.engine.replay import replay
from sgp_ros.engine.samples import CommandSample, JointSample, frozen_array
from sgp_ros.engine.snapshots import restored, take_snapshot
from test.engine.worlds import PENDULUM, START_NS, config, motion, pendulum_events

RATE_HZ, MOVING, RESTING, PERIOD = 100.0, 800, 3000, 40
TICK = 2.0 * np.pi / 2**14
"""Resolution of the encoder [rad]."""


def _events(creep):
    """A motion, a rest in which the joint may creep by some ticks a second, a motion again."""
    _, moving, _, command = motion(MOVING, RATE_HZ, seed=0)
    rest = moving[-1] + creep * TICK * np.arange(RESTING) / RATE_HZ
    position = np.concatenate([moving, rest, moving - moving[0] + rest[-1]])
    position = TICK * np.round(position / TICK)
    efforts = np.concatenate([command, np.zeros(RESTING), command])
    events = []
    for i, (q, m) in enumerate(zip(position, efforts, strict=True)):
        stamp = START_NS + round(i * 1e9 / RATE_HZ)
        events.append(CommandSample(stamp, frozen_array([m])))
        events.append(JointSample(stamp, ('hinge',), frozen_array([q])))
    return events


def _rests(stamp_ns):
    return MOVING < (stamp_ns - START_NS) * 1e-9 * RATE_HZ < MOVING + RESTING


@pytest.mark.parametrize('creep', [0.0, 0.3])
def test_a_rest_asks_for_no_fit_and_the_motion_after_it_soon_does(creep):
    engine = Engine(PENDULUM, config(refit__period=PERIOD))
    fits, learned = [], {}
    for event in _events(creep):
        engine.push(event)
        learned[event.stamp_ns] = engine.counts.learned
        if engine.take_fit_request() is not None:
            fits.append(event.stamp_ns)
    of_rest = [stamp for stamp in fits if _rests(stamp)]
    assert len(of_rest) <= 1  # of the motion before it
    end_ns = START_NS + round((MOVING + RESTING) * 1e9 / RATE_HZ)
    first = next(stamp for stamp in fits if stamp >= end_ns)
    assert learned[first] - learned[end_ns] <= 1.5 * SHARE * PERIOD
    assert len(fits) > len(of_rest) + 3


def test_what_a_motion_told_of_the_hyperparameters_outlasts_a_rest():
    """A buffer full of rest would replace them by some that fit one place alone."""
    engine = Engine(PENDULUM, config(refit__period=PERIOD))
    events = _events(0.3)
    margin = 2 * round(engine.config.buffer_budget * engine.config.filter_hop * RATE_HZ)
    before = 2 * MOVING + margin
    replay(engine, events[:before], lambda step: None)
    known = engine.hyper_settings()
    replay(engine, events[before : 2 * (MOVING + RESTING)], lambda step: None)
    assert np.ptp(engine.estimator.regression.buffer.y) < 0.5
    assert engine.hyper_settings() == known


class _Window:
    """The part of an equation that `Progress` reads."""

    def __init__(self, position, noise):
        k = len(position)
        self.motion = type('Motion', (), {'position': np.array([position])})
        self.roughness = np.zeros((2, 2 * k))
        self.roughness[0, :k] = noise


@pytest.mark.parametrize(('step', 'share'), [(0.0, 0.0), (0.3, 0.1), (1.0, 0.3), (3.0, 0.9)])
def test_a_motion_slower_than_noise_counts_in_part(step, share):
    """One joint that moves is enough; noise about one place is not."""
    rng = np.random.default_rng(0)
    progress = Progress()
    progress.begin()
    n = 1000
    for i in range(n):
        smooth = 0.3 * rng.normal(size=2) + [0.0, step * i]
        progress.take(_Window(smooth, [2.0, 1.0]))
    assert progress.count >= share * n
    assert progress.count <= max(share * n * 3.0, 2.0)


def test_the_first_fit_waits_for_no_motion():
    progress = Progress()
    assert progress.is_enough(1000)
    progress.begin()
    assert not progress.is_enough(1000)


def test_progress_goes_on_where_it_was_saved():
    engine = Engine(PENDULUM, config())
    replay(engine, pendulum_events(400), lambda step: None)
    other = restored(PENDULUM, take_snapshot(engine))
    assert other.progress.state() == engine.progress.state()
    assert engine.progress.count > 0
