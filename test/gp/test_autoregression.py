"""Laws of the prior that signals give of their own next values."""

from __future__ import annotations

import numpy as np

from sgp_ros.gp.autoregression import FIRST, Autoregression


def _oscillation(n, noise, seed=0):
    """Return a damped oscillator under white noise, (n, 1)."""
    rng = np.random.default_rng(seed)
    x = np.zeros(n + 2)
    e = noise * rng.standard_normal(n + 2)
    for t in range(2, n + 2):
        x[t] = 1.8 * x[t - 1] - 0.9 * x[t - 2] + e[t]
    return x[2:, None]


def test_the_prior_is_that_of_the_true_process():
    """Coefficients and error deviation within a few of their standard errors."""
    signals = Autoregression(1)
    for x in 7.0 + _oscillation(5000, 0.1):
        signals.add(x)
    np.testing.assert_allclose(signals.coefficients[0, :2], [1.8, -0.9], atol=0.03)
    np.testing.assert_allclose(np.sqrt(signals.error_covariance[0, 0]), 0.1, rtol=0.3)


def test_coefficients_are_those_of_least_squares():
    """Sums of products and direct solutions agree to the ridge."""
    data = np.random.default_rng(1).standard_normal((60, 2))
    signals = Autoregression(2)
    for x in data:
        signals.add(x)
    for j in range(2):
        rows = np.column_stack([data[1:-1, j], data[:-2, j], np.ones(58)])
        direct = np.linalg.lstsq(rows, data[2:, j], rcond=None)[0]
        np.testing.assert_allclose(signals.coefficients[j], direct, rtol=1e-6)


def test_there_is_no_prior_before_the_first_values():
    """A mean of a handful says too little."""
    signals = Autoregression(1)
    for x in np.arange(FIRST - 1.0):
        signals.add(np.array([x]))
    assert signals.predict() is None


def test_after_a_gap_the_prior_is_the_whole_stream():
    """Mean and covariance of all values until two follow each other again."""
    data = np.random.default_rng(2).standard_normal((200, 2))
    signals = Autoregression(2)
    for x in data:
        signals.add(x)
    signals.begin()
    mean, covariance = signals.predict()
    np.testing.assert_allclose(mean, data.mean(axis=0), atol=1e-12)
    np.testing.assert_allclose(covariance, np.cov(data.T, bias=True), atol=1e-12)


def test_saved_values_continue_to_the_same_bits():
    """The state is complete."""
    data = _oscillation(60, 1.0)
    one = Autoregression(1)
    for x in data[:30]:
        one.add(x)
    two = Autoregression(1)
    two.restore(one.state())
    for x in data[30:]:
        one.add(x)
        two.add(x)
    for first, second in zip(one.predict(), two.predict(), strict=True):
        np.testing.assert_array_equal(first, second)
