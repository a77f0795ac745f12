"""The mixed model equals dense and textbook solutions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from sgp_ros.campaign.mixed import Spread, fit_given, fit_mixed


def _world(rng, n=60, groups=12):
    codes = np.arange(n) % groups
    X = np.column_stack([np.ones(n), rng.standard_normal(n)])
    std = rng.uniform(0.1, 0.4, n)
    y = X @ [2.0, 0.5] + 0.5 * rng.standard_normal(groups)[codes] + std * rng.standard_normal(n)
    return y, std, X, codes


def test_the_covariance_is_that_of_its_dense_form():
    rng = np.random.default_rng(0)
    d, groups = rng.uniform(1.0, 2.0, 9), [np.arange(9) % 3, 3 + np.arange(9) // 5]
    theta = np.array([0.5, 0.0, 2.0, 1.0, 0.3])
    spread = Spread.of(d, groups, theta)
    Z = sum(np.eye(5)[codes] for codes in groups)
    V, A = np.diag(d) + Z @ np.diag(theta) @ Z.T, rng.standard_normal((9, 2))
    assert spread.solve(A) == pytest.approx(np.linalg.solve(V, A))
    assert spread.log_determinant == pytest.approx(np.linalg.slogdet(V)[1])


def test_equal_intervals_without_groups_are_least_squares():
    """The interval is that of the textbook whatever the stated intervals are."""
    rng = np.random.default_rng(1)
    y, _, X, _ = _world(rng)
    fit = fit_mixed(y, np.full(len(y), 0.3), X, [], len(y))
    beta, squares = np.linalg.lstsq(X, y, rcond=None)[:2]
    assert fit.beta == pytest.approx(beta)
    assert fit.covariance == pytest.approx(squares / (len(y) - 2) * np.linalg.inv(X.T @ X))
    assert fit.dof == len(y) - 2


def test_balanced_groups_have_the_variances_of_the_analysis_of_variance():
    """REML equals the classical estimator where that is positive (Searle 1992, section 3.8)."""
    rng = np.random.default_rng(2)
    groups, each = 30, 5
    codes = np.repeat(np.arange(groups), each)
    y = 3.0 + rng.standard_normal(groups)[codes] + 0.5 * rng.standard_normal(groups * each)
    means = y.reshape(groups, each).mean(axis=1)
    within = y.reshape(groups, each).var(axis=1, ddof=1).mean()
    fit = fit_mixed(y, np.full(len(y), 0.1), np.ones((len(y), 1)), [codes], groups)
    assert fit.theta[0] + 0.1**2 == pytest.approx(within, rel=1e-3)
    assert fit.theta[1] == pytest.approx(means.var(ddof=1) - within / each, rel=1e-3)
    assert fit.beta[0] == pytest.approx(means.mean())
    assert fit.covariance[0, 0] == pytest.approx(means.var(ddof=1) / groups, rel=1e-2)
    assert fit.dof == groups - 1


def test_an_estimate_with_a_wide_interval_counts_less():
    y, std = np.array([1.0, 1.0, 1.0, 1.0, 5.0]), np.array([0.1, 0.1, 0.1, 0.1, 100.0])
    assert fit_mixed(y, std, np.ones((5, 1)), [], 5).beta[0] == pytest.approx(1.0, abs=0.01)


def test_a_column_gains_what_the_fit_with_it_explains_more():
    """Under the same variances; a column that is there already gains nothing."""
    rng = np.random.default_rng(3)
    y, std, X, codes = _world(rng)
    fit = fit_mixed(y, std, X, [codes], 12)
    S = np.column_stack([rng.standard_normal((len(y), 3)), X[:, 0]])
    gains = fit.gains(S)
    left = fit.residual @ fit.spread.solve(fit.residual[:, None])[:, 0]
    for i in range(3):
        with_it = fit_given(y, np.column_stack([X, S[:, i]]), fit.spread, fit.theta, 12)
        assert with_it.dof == 12 - 3
        more = left - with_it.residual @ fit.spread.solve(with_it.residual[:, None])[:, 0]
        assert gains[i] == pytest.approx(more)
        assert with_it.t[2] ** 2 == pytest.approx(more / (left - more) * (len(y) - 3))
    assert gains[3] == 0.0


def test_intervals_hold_the_truth_as_often_as_they_say():
    """Of groups with intercepts and uneven intervals, within three standard deviations of 95 %."""
    rng = np.random.default_rng(4)
    inside = []
    for _ in range(40):
        _, std, _, codes = _world(rng, n=48, groups=8)
        X = np.column_stack([np.ones(48), rng.standard_normal(8)[codes]])  # one value a group
        y = X @ [2.0, 0.7] + 0.5 * rng.standard_normal(8)[codes] + std * rng.standard_normal(48)
        fit = fit_mixed(y, std, X, [codes], codes.max() + 1)
        t = (fit.beta[1] - 0.7) / np.sqrt(fit.covariance[1, 1])
        inside.append(abs(t) < stats.t.ppf(0.975, fit.dof))
    assert np.mean(inside) > 0.95 - 3.0 * np.sqrt(0.95 * 0.05 / len(inside))
