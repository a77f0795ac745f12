"""Laws of the correlation of a residual in time."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import linalg, signal

from sgp_ros.batch.least_squares import (
    autoregression,
    coloured_products,
    correlation_factor,
    inflation,
)

WEIGHTS = np.array([0.6, 0.2])


def _correlations(weights, n):
    """Correlations and innovation of an autoregression, by Yule and Walker's equations."""
    a, b = weights
    rho = [1.0, a / (1.0 - b)]
    for _ in range(n - 2):
        rho.append(a * rho[-1] + b * rho[-2])
    return np.array(rho), 1.0 - a * rho[1] - b * rho[2]


def test_products_equal_those_with_the_dense_correlations():
    """Two blocks that know nothing of each other, each with a Toeplitz matrix."""
    rng = np.random.default_rng(0)
    H = rng.normal(size=(90, 3))
    block = np.repeat([0, 1], [30, 60])
    rho, innovation = _correlations(WEIGHTS, 60)
    dense = linalg.block_diag(linalg.toeplitz(rho[:30]), linalg.toeplitz(rho))
    found = coloured_products(H, block, WEIGHTS, innovation)
    assert found == pytest.approx(H.T @ dense @ H, rel=1e-4, abs=1e-4)


def test_a_planted_autoregression_is_found():
    """Weights within three of their standard errors at this length."""
    noise = np.random.default_rng(1).normal(size=20_000)
    residual = signal.lfilter([1.0], [1.0, *-WEIGHTS], noise)
    weights, innovation = autoregression(residual, np.zeros(20_000, dtype=int))
    _, expected = _correlations(WEIGHTS, 3)
    assert weights[:2] == pytest.approx(WEIGHTS, abs=0.03)
    assert innovation == pytest.approx(expected, rel=0.05)
    assert inflation(weights, innovation) == pytest.approx(
        expected / (1.0 - WEIGHTS.sum()) ** 2, rel=0.2
    )


def test_white_noise_is_left_as_it_is():
    """BIC takes no order for it in nearly every case: products are the plain ones."""
    orders = []
    for seed in range(50):
        residual = np.random.default_rng(seed).normal(size=400)
        weights, _ = autoregression(residual, np.zeros(400, dtype=int))
        orders.append(len(weights))
    assert np.mean(np.array(orders) == 0) > 0.9
    H = np.random.default_rng(0).normal(size=(40, 2))
    plain = coloured_products(H, np.zeros(40, dtype=int), np.zeros(0), 1.0)
    assert plain == pytest.approx(H.T @ H)
    assert inflation(np.zeros(0), 1.0) == 1.0


@pytest.mark.parametrize('residual', [np.zeros(50), np.ones(50), np.tile([1.0, -1.0], 25)])
def test_degenerate_residuals_give_a_stationary_process(residual):
    """Nothing, a constant and an alternation have finite inflation."""
    weights, innovation = autoregression(residual, np.zeros(50, dtype=int))
    assert innovation > 0.0
    assert np.isfinite(inflation(weights, innovation))


@pytest.mark.parametrize('phi', [0.3, 0.6, 0.8])
def test_the_factor_of_an_autoregression_is_that_of_the_variance_of_its_mean(phi):
    """It is `(1 + phi) / (1 - phi)`; lags below a correlation of 0.05 are left out."""
    noise = np.random.default_rng(1).standard_normal(40000)
    r = signal.lfilter([1.0], [1.0, -phi], noise)
    assert correlation_factor(r) == pytest.approx((1.0 + phi) / (1.0 - phi), rel=0.15)


def test_white_and_alternating_residuals_count_row_by_row():
    """The factor is never below 1, and 1 for a residual of zeros."""
    noise = np.random.default_rng(2).standard_normal(5000)
    for r in (noise, np.resize([1.0, -1.0], 100), np.zeros(50)):
        assert correlation_factor(r) == 1.0


@pytest.mark.parametrize(('turns', 'factor'), [(0, 9.0), (2000, 1.0)])
def test_a_fast_regressor_averages_a_slow_residual(turns, factor):
    """The variance of `sum x r` by that of independent rows, over drawn residuals."""
    x = np.cos(2.0 * np.pi * turns * np.arange(8000) / 8000.0)
    noise = np.random.default_rng(3).standard_normal((400, 8000))
    r = signal.lfilter([1.0], [1.0, -0.8], noise, axis=1)
    drawn = (r @ x).var() / ((x @ x) * (r**2).mean())
    found = np.mean([correlation_factor(row, x) for row in r[:50]])
    assert found == pytest.approx(factor, rel=0.2)
    assert max(drawn, 1.0) == pytest.approx(factor, rel=0.2)
