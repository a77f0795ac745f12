"""Laws of the two sides of the equation of motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.engine.engine import Engine
from sgp_ros.engine.prediction import update_complement
from sgp_ros.engine.replay import replay
from sgp_ros.engine.samples import JointSample, frozen_array
from test.engine.worlds import INVERSE_PENDULUM, TRUTH, config, motion


def _spd(rng, k):
    A = rng.standard_normal((k, k))
    return A @ A.T + np.eye(k)


def test_the_posterior_is_that_of_a_dense_solution():
    """Information form: `(P^-1 + B^T S^-1 B)^-1`, computed apart."""
    rng = np.random.default_rng(0)
    P, S, B = _spd(rng, 3), _spd(rng, 4), rng.standard_normal((4, 3))
    start, offset, target = rng.standard_normal(3), rng.standard_normal(4), rng.standard_normal(4)
    mean, covariance = update_complement(
        (start, P), target, B, lambda c: (offset + B @ c, S), 1
    )  # fmt: skip
    dense = np.linalg.inv(np.linalg.inv(P) + B.T @ np.linalg.inv(S) @ B)
    information = np.linalg.inv(P) @ start + B.T @ np.linalg.inv(S) @ (target - offset)
    np.testing.assert_allclose(covariance, dense, rtol=1e-9)
    np.testing.assert_allclose(mean, dense @ information, rtol=1e-9)


def test_a_target_that_tells_nothing_leaves_the_prior():
    """An inertia of zero once gave accelerations of infinity."""
    prior = np.array([0.3, -2.0]), np.diag([0.1, 4.0])
    mean, covariance = update_complement(
        prior, np.array([5.0]), np.zeros((1, 2)), lambda _: (np.zeros(1), np.eye(1)), 1
    )
    np.testing.assert_array_equal(mean, prior[0])
    np.testing.assert_array_equal(covariance, prior[1])


def _inverse_events(n=900, slip=0.0):
    """Return states of the pendulum with efforts, with a slip of the effort as unknown physics."""
    t, positions, velocities, command = motion(n, 100.0, 0, 1e-5)
    effort = command + slip * np.sign(velocities)
    return [
        JointSample(1 + round(1e9 * s), ('hinge',), frozen_array([q]), None, frozen_array([e]))
        for s, q, e in zip(t, positions, effort, strict=True)
    ]


def _estimates(engine, events):
    found = []
    replay(engine, events, lambda step: found.extend(step.estimates))
    return found


def test_an_effort_has_no_part_in_its_own_prediction():
    """Another one in the last window changes what is measured, no bit of what is predicted.

    Z sees everything that may be seen.
    """
    settings = config(INVERSE_PENDULUM, model__residual_inputs=('all',), refit__enabled=False)
    events = _inverse_events(500)
    one = _estimates(Engine(INVERSE_PENDULUM, settings), events)[-1]
    second_half = next(i for i, event in enumerate(events) if event.stamp_ns > one.stamp_ns)
    events[second_half] = replace(events[second_half], effort=frozen_array([40.0]))
    two = _estimates(Engine(INVERSE_PENDULUM, settings), events)[-1]
    assert one.effort.measured[0] != two.effort.measured[0]
    np.testing.assert_array_equal(one.effort.mean, two.effort.mean)
    np.testing.assert_array_equal(one.effort.variance, two.effort.variance)


def test_accelerations_of_an_inverse_model_are_predicted():
    """nMSE far below one, intervals that hold their rate."""
    engine = Engine(INVERSE_PENDULUM, config(INVERSE_PENDULUM))
    _estimates(engine, _inverse_events(1500, slip=0.5))
    score = engine.scores()['hinge']['acceleration']
    assert TRUTH['gain'] > 0.0
    assert score.nmse < 0.05
    assert 0.9 < score.coverage95 < 0.99


@pytest.mark.parametrize('mode', ['always', 'off'])
def test_z_that_harms_loses_its_weight(mode):
    """Hyper-parameters of absurd noise-free wiggles: worse than physics unless it is weighed."""
    settings = {
        'hyper__hinge__signal_variance': 100.0, 'hyper__hinge__lengthscales': [0.01],
        'hyper__hinge__noise_variance': 1e-6, 'refit__enabled': False,
        'process__weighting': mode, 'buffer__budget': 300,
    }  # fmt: skip
    engine = Engine(INVERSE_PENDULUM, config(INVERSE_PENDULUM, **settings))
    _estimates(engine, _inverse_events(1500))
    alone = engine.baseline_scores()['hinge']['effort'].nmse
    found = engine.scores()['hinge']['effort'].nmse
    if mode == 'always':
        assert found < 1.1 * alone
        assert engine.process_weights()['hinge'].mean < 0.5
    else:
        assert found > 2.0 * alone
        assert engine.process_weights() == {}
