"""Laws of what the errors of predictions do to later intervals."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.engine.engine import Engine
from sgp_ros.engine.replay import replay
from test.engine.worlds import PENDULUM, config, pendulum_events

TOO_SURE = {'model__method': 'PR', 'hyper__hinge__noise_variance': 1e-6, 'refit__enabled': False}
"""Physics that states a noise far below what the encoder leaves of accelerations."""


def _run(engine, events):
    found = []
    replay(engine, events, lambda step: found.extend(step.estimates))
    return found


def _frozen(mode):
    """Return an engine that learned, then only predicted, and the scales when it stopped."""
    events = pendulum_events(600)
    engine = Engine(PENDULUM, config(intervals__calibration=mode, **TOO_SURE))
    _run(engine, events[:600])
    before = engine.estimator.scoring.state()['scales']
    engine.change({'learning.enabled': False})
    engine.begin_stream()
    assert engine.estimator.scoring.state()['scales'] == before
    return engine, before, _run(engine, events[600:])


def test_a_model_that_is_too_sure_has_honest_intervals():
    """Its own intervals hold less than half of what they claim; calibrated ones hold it."""
    engine = Engine(PENDULUM, config(**TOO_SURE))
    _run(engine, pendulum_events(1500))
    score = engine.scores()['hinge']['acceleration']
    assert score.raw_coverage95 < 0.5
    assert 0.9 < score.coverage95 < 0.98


@pytest.mark.parametrize(('mode', 'adapts'), [('always', True), ('learning', False)])
def test_a_frozen_model_keeps_or_adapts_its_intervals_as_set(mode, adapts):
    """The scale learned so far is used either way; measurements move it only where asked."""
    engine, before, estimates = _frozen(mode)
    assert (engine.estimator.scoring.state()['scales'] != before) == adapts
    raw = np.array([e.acceleration.raw_variance[0] for e in estimates])
    scale = np.array([e.acceleration.variance[0] for e in estimates]) / np.sqrt(raw)
    assert np.all(scale > 2.0 * np.sqrt(raw))
    assert (np.ptp(scale) > 1e-9 * scale.mean()) == adapts


def test_intervals_off_are_those_of_the_model():
    """Bit for bit."""
    _, _, estimates = _frozen('off')
    for estimate in estimates:
        channel = estimate.acceleration
        np.testing.assert_array_equal(channel.variance, channel.raw_variance)
