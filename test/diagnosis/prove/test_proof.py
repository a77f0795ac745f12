"""Intervals of means over time."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import signal

from sgp_ros.diagnosis.prove.proof import (
    correlation_time,
    mean_interval,
    not_carried_over,
    ratio_interval,
    reasons_to_doubt,
)
from sgp_ros.diagnosis.result import Proof

SEEDS = 200


def _coloured(seed, n, phi):
    """An autoregression of variance one."""
    noise = np.random.default_rng(seed).standard_normal(n + 500) * math.sqrt(1.0 - phi**2)
    return signal.lfilter([1.0], [1.0, -phi], noise)[500:]


def _coverage(intervals, truth):
    assert None not in intervals
    return np.mean([low <= truth <= high for low, high in intervals])


@pytest.mark.parametrize('phi', [0.0, 0.9])
def test_the_interval_of_a_mean_holds_it_as_often_as_it_says(phi):
    """95 % of the time, within three standard errors of that share; neighbours may be alike."""
    found = [mean_interval(_coloured(seed, 3000, phi)) for seed in range(SEEDS)]
    assert _coverage(found, 0.0) == pytest.approx(0.95, abs=3 * math.sqrt(0.95 * 0.05 / SEEDS))


@pytest.mark.parametrize('phi', [0.0, 0.9])
def test_the_interval_of_a_ratio_holds_it_as_often_as_it_says(phi):
    """Of the variances of two processes; squares are skewed, so two per cent are given away."""
    found = [
        ratio_interval(
            0.04 * _coloured(seed, 3000, phi) ** 2, _coloured(seed + SEEDS, 3000, phi) ** 2
        )
        for seed in range(SEEDS)
    ]
    assert 0.90 <= _coverage(found, 0.04) <= 1.0


def test_neighbours_that_are_alike_widen_the_interval():
    """As many samples tell less than independent ones."""
    wide, narrow = (mean_interval(_coloured(1, 3000, phi)) for phi in (0.95, 0.0))
    assert wide[1] - wide[0] > 3.0 * (narrow[1] - narrow[0])


@pytest.mark.parametrize('phi', [0.0, 0.5, 0.9])
def test_the_correlation_time_is_that_of_the_process(phi):
    """`(1 + phi) / (1 - phi)` of an autoregression."""
    assert correlation_time(_coloured(2, 200_000, phi)) == pytest.approx(
        (1.0 + phi) / (1.0 - phi), rel=0.1
    )


def test_a_ratio_has_no_unit_and_is_never_negative():
    """Scaling both changes nothing, scaling one scales the interval; the ratio lies inside."""
    x, y = _coloured(3, 400, 0.5) ** 4, _coloured(4, 400, 0.5) ** 2
    low, high = ratio_interval(x, y)
    assert 0.0 < low < x.mean() / y.mean() < high
    assert ratio_interval(7.0 * x, 7.0 * y) == pytest.approx((low, high))
    assert ratio_interval(7.0 * x, y) == pytest.approx((7.0 * low, 7.0 * high))


def test_what_is_proportional_has_a_sure_ratio():
    """However both scatter."""
    y = _coloured(5, 400, 0.5) ** 2
    assert ratio_interval(0.3 * y, y) == pytest.approx((0.3, 0.3))


@pytest.mark.parametrize(
    'x', [np.zeros(0), np.ones(3), np.linspace(0.0, 1.0, 100)], ids=['none', 'three', 'a drift']
)
def test_too_little_gives_no_interval(x):
    """A drift as long as the recording is one event, not a hundred."""
    assert mean_interval(x) is None
    assert ratio_interval(x, np.ones(len(x))) is None


def test_nothing_over_nothing_has_no_interval():
    """A joint that does not move has no error relative to its motion."""
    assert ratio_interval(np.zeros(100), np.ones(100)) is None
    assert ratio_interval(np.ones(100), np.zeros(100)) is None


def _proof(before, after, interval):
    return Proof(
        {'elbow': before}, {'elbow': after}, {}, {}, 0.0, 0.0, {}, {},
        {'nmse_after': {'elbow': interval}}, (None, None), 0, 0, 0.0, {'nmse': {'elbow': 2.0}},
    )  # fmt: skip


@pytest.mark.parametrize(
    ('before', 'after', 'interval', 'still', 'is_reported'),
    [
        (0.4, 0.15, (0.08, 0.3), (), True),  # a fifth and more is left where it was 1 %
        (0.4, 0.03, (0.02, 0.05), (), False),  # friction that is a sixth larger
        (0.4, 0.15, (0.03, 0.5), (), False),  # too short to know
        (0.4, 0.15, (0.08, 0.3), ('elbow',), False),
        (0.003, 0.003, (0.002, 0.004), (), False),  # nothing there counts as physics
    ],
)
def test_what_does_not_carry_over_is_reported(before, after, interval, still, is_reported):
    proofs = {'train': _proof(0.4, 0.004, (0.003, 0.005)), 'test': _proof(before, after, interval)}
    found = not_carried_over(proofs, still)
    assert set(found) == ({'elbow'} if is_reported else set())
    assert reasons_to_doubt(proofs, still) == {joint: (why,) for joint, why in found.items()}


@pytest.mark.parametrize(
    ('after', 'low', 'is_reported'),
    [(0.012, 8e-4, True), (0.003, 8e-4, False), (0.012, 2e-5, False)],
)
def test_what_does_harm_elsewhere_does_not_carry_over(after, low, is_reported):
    """A force that has gone there, though its few places leave a wide interval."""
    far = _proof(1e-5, after, (low, 0.2))
    far.intervals['nmse_before'] = {'elbow': (3e-6, 3e-5)}
    found = not_carried_over({'train': _proof(0.13, 8e-6, (7e-6, 9e-6)), 'far': far}, ())
    assert bool(found) is is_reported


def test_noise_that_was_there_before_is_no_failure():
    """The rest is as large where the model was fitted."""
    noisy = _proof(0.4, 0.1, (0.08, 0.12))
    assert not not_carried_over({'train': noisy, 'test': noisy}, ())
