"""Laws of information on W that is taken from other information."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sgp_ros.gp.echelon import Echelon, products_numpy
from sgp_ros.gp.inducing_regression import InducingPointRegression
from sgp_ros.gp.information import Information
from sgp_ros.gp.kernels import SquaredExponential
from sgp_ros.gp.model import CoefficientPrior, Model, Observations
from sgp_ros.gp.online import OnlineRegression
from sgp_ros.gp.posterior import Posterior
from sgp_ros.gp.regression import Memory
from test.gp.worlds import random_problem


@given(st.integers(0, 10_000), st.integers(0, 6), st.integers(1, 6))
def test_what_is_added_comes_out_again(seed, before, added):
    """The difference of two states is what came between, of any rank and in any units."""
    rng = np.random.default_rng(seed)
    units = 10.0 ** rng.uniform(-3.0, 3.0, size=4)
    A, b = rng.normal(size=(before + added, 4)) * units, rng.normal(size=before + added)
    part = Information.nothing(4).with_rows(A[:before], b[:before])
    found = part.with_rows(A[before:], b[before:]).less(part)
    expected = A[before:].T @ A[before:] / np.outer(units, units)
    np.testing.assert_allclose(found.R.T @ found.R / np.outer(units, units), expected, atol=1e-7)
    np.testing.assert_allclose(
        found.R.T @ found.z / units, A[before:].T @ b[before:] / units, atol=1e-6
    )


def test_a_difference_never_takes_anything_away():
    """Where the other state knows more of a direction, rounding or not, nothing is returned."""
    whole = Information(np.diag([2.0, 1.0]), np.array([1.0, 1.0]))
    other = Information(np.diag([1.0, 1.5]), np.array([0.0, 3.0]))
    found = whole.less(other)
    np.testing.assert_allclose(found.R.T @ found.R, np.diag([3.0, 0.0]), atol=1e-12)
    np.testing.assert_allclose(found.R.T @ found.z, [2.0, 0.0], atol=1e-12)


def test_without_coefficients_there_is_no_difference():
    """GP is the case p = 0."""
    assert Information.nothing(0).less(Information.nothing(0)).R.shape == (0, 0)


@pytest.mark.parametrize('seed', range(5))
def test_without_full_rank_the_shortest_solution_counts(seed):
    """As the pseudo-inverse of the scaled columns, which nothing but its cost speaks against."""
    rng = np.random.default_rng(seed)
    p, rank = 9, 4 + seed % 3
    rows = rng.normal(size=(40, rank)) @ rng.normal(size=(rank, p)) * 10.0 ** rng.uniform(-3, 3, p)
    rows[:, 2] = 0.0
    y = rng.normal(size=40)
    found = Information.nothing(p).with_rows(rows, y)
    scale = np.linalg.norm(rows, axis=0)
    scale[2] = 1.0
    inverse = np.linalg.pinv(rows / scale, rcond=1e-9)
    np.testing.assert_allclose(found.coefficients * scale, inverse @ y, rtol=1e-8, atol=1e-10)
    expected = inverse @ inverse.T
    np.testing.assert_allclose(
        found.covariance * np.outer(scale, scale), expected, atol=1e-9 * expected.max()
    )
    within, outside = rows[:2], np.eye(p)[:2] * scale
    assert found.is_determined(within).all()
    assert not found.is_determined(outside).any()
    assert not found.is_identifiable[2]


FLAT = CoefficientPrior.flat(3)


def _exact(model, prior, **options):
    return OnlineRegression(model, prior, Memory(5, **options))


def _basis(model, prior, **options):
    return InducingPointRegression(model, prior, Memory(10, 30, **options))


WAYS = [_exact, _basis]


def _learn(online, data):
    for u, f, y in zip(data.U, data.F, data.y, strict=True):
        online.learn(online.predict(u, f), y)
    return online


@pytest.mark.parametrize('way', WAYS)
def test_without_process_it_is_weighted_least_squares(way):
    """Recursive least squares with a forgetting factor: sample i counts `exp(-age / N)`."""
    model, data = random_problem(5, n=40, noise_like='parametric')
    online = _learn(way(model, FLAT, forgetting=7.0), data)
    root = np.exp(-0.5 * np.arange(39, -1, -1) / 7.0)
    weighted = Observations(data.U, root[:, None, None] * data.F, root[:, None] * data.y)
    batch = Posterior(model, weighted, FLAT)
    np.testing.assert_allclose(online.information.coefficients, batch.coefficients, rtol=1e-9)
    np.testing.assert_allclose(online.information.covariance, batch.covariance, rtol=1e-8)


def test_without_memory_only_the_buffer_counts_faded():
    """Weights go with their samples, also after the buffer has slid through its memory."""
    model, data = random_problem(5, n=150, noise_like='parametric')
    prior = CoefficientPrior.from_std(np.ones(3), np.full(3, 2.0))
    online = OnlineRegression(model, prior, Memory(5, remember=False, forgetting=7.0))
    _learn(online, data)
    root = np.exp(-0.5 * np.arange(4, -1, -1) / 7.0)
    tail = Observations(
        data.U[-5:], root[:, None, None] * data.F[-5:], root[:, None] * data.y[-5:]
    )
    batch = Posterior(model, tail, prior)
    np.testing.assert_allclose(online.information.coefficients, batch.coefficients, rtol=1e-9)
    np.testing.assert_allclose(online.information.covariance, batch.covariance, rtol=1e-8)


@pytest.mark.parametrize('way', WAYS)
def test_a_change_of_noise_keeps_the_weights(way):
    """Information rebuilt under other hyper-parameters is as faded as it was."""
    model, data = random_problem(6, n=40, noise_like='parametric')
    online = _learn(way(model, FLAT, forgetting=7.0), data)
    before = online.information
    online.change(model=Model(model.kernels, tuple(4.0 * x for x in model.noise)))
    np.testing.assert_allclose(online.information.coefficients, before.coefficients, rtol=1e-9)
    np.testing.assert_allclose(online.information.covariance, 4.0 * before.covariance, rtol=1e-8)


@pytest.mark.parametrize('way', WAYS)
def test_the_prior_is_not_forgotten(way):
    """A direction without excitation keeps its prior, to the share that fades in p samples."""
    model, _ = random_problem(7, n=2)
    prior = CoefficientPrior.from_std(np.array([1.0, 2.0, 3.0]), np.array([0.5, 1.0, 2.0]))
    online = way(model, prior, forgetting=20.0)
    rng = np.random.default_rng(0)
    for _ in range(400):
        f = np.zeros((2, 3))
        f[:, 0] = rng.normal(size=2)
        online.learn(online.predict(rng.normal(size=3), f), rng.normal(size=2))
    std = np.sqrt(np.diag(online.information.covariance))
    np.testing.assert_allclose(std[1:], [1.0, 2.0], rtol=0.1)
    np.testing.assert_allclose(online.information.coefficients[1:], [2.0, 3.0], rtol=0.1)


@pytest.mark.parametrize('way', WAYS)
def test_a_changed_robot_is_followed(way):
    """After a jump of W and five time constants the old value is out of the estimate."""
    kernel = SquaredExponential(0.1, (1.0,), (0,))
    model = Model((kernel,), (0.01,))
    rng = np.random.default_rng(3)
    n = 400
    U, F = rng.uniform(-2.0, 2.0, size=(n, 1)), rng.normal(size=(n, 1, 3))
    w = np.where(np.arange(n)[:, None] < n // 2, [1.0, 2.0, 3.0], [1.5, 1.0, 3.5])
    y = np.einsum('nkp,np->nk', F, w) + 0.1 * rng.normal(size=(n, 1))
    data = Observations(U, F, y)
    errors = [
        np.linalg.norm(
            _learn(way(model, FLAT, forgetting=forgetting), data).information.coefficients - w[-1]
        )
        for forgetting in (40.0, 0.0)
    ]
    assert errors[0] < 0.1 < errors[1]


@pytest.mark.parametrize('way', WAYS)
def test_stop_save_restore_continue_equals_never_stopped(way):
    """Weights and the turn of the prior are part of the state, to the bit."""
    model, data = random_problem(8, n=40)
    prior = CoefficientPrior.from_std(np.zeros(3), np.ones(3))
    one, other = (way(model, prior, forgetting=9.0) for _ in range(2))
    for i in range(40):
        if i == 19:
            other.restore(one.state())
        for online in (one, other) if i >= 19 else (one,):
            online.learn(online.predict(data.U[i], data.F[i]), data.y[i])
    for name, array in other.state().items():
        np.testing.assert_array_equal(array, one.state()[name])


@given(st.integers(0, 10_000), st.integers(3, 9), st.integers(1, 2))
def test_echelon_form_tells_what_the_decomposition_does(seed, p, missing):
    """Products with W and their covariance, in any units, where some of W is never determined."""
    rng = np.random.default_rng(seed)
    span = rng.normal(size=(p - missing, p)) * 10.0 ** rng.uniform(-3.0, 3.0, size=p)
    learned = rng.normal(size=(3 * p, p - missing)) @ span
    held = Information.nothing(p).with_rows(learned, rng.normal(size=3 * p))
    rows = rng.normal(size=(2, p - missing)) @ span
    A, z = held.R / np.linalg.norm(held.R, axis=0), held.z
    echelon = Echelon(A, z, np.linalg.norm(held.R, axis=0))
    if not echelon.is_clear:  # an element of a random world may be anything
        return
    values, spread = echelon.products(rows)
    expected, covariance = products_numpy(A, z, np.linalg.norm(held.R, axis=0), rows)
    size = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(values, expected, atol=1e-6 * size.max())
    np.testing.assert_allclose(
        spread @ spread.T / np.outer(size, size), covariance / np.outer(size, size), atol=1e-6
    )
    mean, whole = held.predict(rows, np.zeros(2), np.zeros(2))
    np.testing.assert_allclose(mean, values, rtol=1e-12)
    np.testing.assert_allclose(whole, spread @ spread.T, rtol=1e-12)
    np.testing.assert_array_equal(held.products(rows), values)


def test_what_is_not_determined_beyond_doubt_is_left_to_the_decomposition():
    """A row that leaves the span, and a direction between rounding and information."""
    rng = np.random.default_rng(0)
    learned = rng.normal(size=(9, 3)) @ rng.normal(size=(3, 5))
    held = Information.nothing(5).with_rows(learned, rng.normal(size=9))
    outside = rng.normal(size=(2, 5))
    _, covariance = held.predict(outside, np.zeros(2), np.zeros(2))
    assert np.isinf(np.diag(covariance)).all()
    np.testing.assert_array_equal(held.products(outside), outside @ held.coefficients)
    faint = held.with_rows(1e-9 * np.linalg.norm(held.R) * outside[:1], np.zeros(1))
    scale = np.linalg.norm(faint.R, axis=0)
    assert not Echelon(faint.R / scale, faint.z, scale).is_clear
