"""Laws of decompositions that data can break, and of compiled passes over matrices."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import linalg

from sgp_ros.errors import NumericalError
from sgp_ros.gp.linear_algebra import (
    column_space,
    exponents_numpy,
    least_norm,
    null_space,
    singular_values,
    subtract_symmetric,
    subtracted_numpy,
    svd,
    symmetric_eigen,
    turn_into_exponents,
)
from sgp_ros.gp.model import CoefficientPrior, Observations
from sgp_ros.gp.posterior import Posterior
from test.gp.worlds import random_problem


@pytest.mark.parametrize('shape', [(1, 1), (5, 3), (33, 70)])
def test_exponents_are_those_of_numpy(shape):
    """The same operations on each element: the same bits."""
    rng = np.random.default_rng(0)
    products, a, b = rng.normal(size=shape), rng.random(shape[0]), rng.random(shape[1])
    expected = exponents_numpy(products, a, b)
    turn_into_exponents(products, a, b)
    np.testing.assert_array_equal(products, expected)


@pytest.mark.parametrize('n', [1, 31, 32, 33, 70])
def test_a_symmetric_matrix_is_subtracted_on_both_sides(n):
    """The part below the diagonal of the second matrix is not read."""
    H, upper = np.random.default_rng(n).normal(size=(2, n, n))
    expected = subtracted_numpy(H, upper)
    subtract_symmetric(H, upper)
    np.testing.assert_array_equal(H, expected)


def _fails(*args, **kwargs):
    raise np.linalg.LinAlgError('SVD did not converge')


def _fail_fast(monkeypatch):
    """Let every fast algorithm fail, as gesdd does on some finite matrices."""
    for name in ('svd', 'lstsq', 'eigh'):
        monkeypatch.setattr(np.linalg, name, _fails)
    for name in ('svdvals', 'null_space', 'orth'):
        monkeypatch.setattr(linalg, name, _fails)


DECOMPOSITIONS = {
    'svd': lambda A: np.abs(svd(A)[1]),
    'full svd': lambda A: np.abs(svd(A, is_full=True)[1]),
    'singular values': singular_values,
    'null space': lambda A: null_space(A) @ null_space(A).T,
    'column space': lambda A: column_space(A) @ column_space(A).T,
    'least norm': lambda A: least_norm(A, A[:, 0] + 1.0, 1e-12),
    'eigenvalues': lambda A: symmetric_eigen(A[:5] + A[:5].T)[0],
}


@pytest.mark.parametrize('name', sorted(DECOMPOSITIONS))
def test_a_decomposition_that_does_not_converge_is_done_by_the_slow_algorithm(monkeypatch, name):
    """Of a matrix of rank three with five columns."""
    rng = np.random.default_rng(3)
    A = rng.normal(size=(7, 3)) @ rng.normal(size=(3, 5))
    wanted = DECOMPOSITIONS[name](A)
    _fail_fast(monkeypatch)
    np.testing.assert_allclose(DECOMPOSITIONS[name](A), wanted, atol=1e-12)


@pytest.mark.parametrize('name', sorted(DECOMPOSITIONS))
def test_where_both_algorithms_fail_the_error_says_what_to_do(monkeypatch, name):
    """One error of this package, never LAPACK's."""
    _fail_fast(monkeypatch)
    for slow in ('svd', 'eigh'):
        monkeypatch.setattr(linalg, slow, _fails)
    with pytest.raises(NumericalError, match=r'did not converge.*check the units'):
        DECOMPOSITIONS[name](np.eye(3))


@pytest.mark.parametrize('value', [np.nan, np.inf])
@pytest.mark.parametrize('name', sorted(DECOMPOSITIONS))
def test_numbers_that_are_not_finite_are_refused(name, value):
    """LAPACK would answer NaN, or that it did not converge."""
    A = np.eye(3)
    A[1, 2] = value
    with pytest.raises(NumericalError, match=r'not finite.*check the recording'):
        DECOMPOSITIONS[name](A)


def test_a_fit_survives_a_decomposition_that_does_not_converge(monkeypatch):
    """The posterior and its evidence are those of the fast algorithm."""
    model, data = random_problem(4)
    prior = CoefficientPrior.flat(3)
    wanted = Posterior(model, data, prior)
    _fail_fast(monkeypatch)
    found = Posterior(model, data, prior)
    np.testing.assert_allclose(found.coefficients, wanted.coefficients, rtol=1e-9)
    assert found.log_evidence == pytest.approx(wanted.log_evidence, rel=1e-12)


@pytest.mark.parametrize('value', [np.nan, np.inf, 1e200])
def test_regressors_that_no_square_can_hold_are_refused(value):
    """In words, without a warning of NumPy or a traceback of LAPACK."""
    model, data = random_problem(5)
    F = data.F.copy()
    F[0, 0, 0] = value
    with pytest.raises(NumericalError, match='not finite'):
        Posterior(model, Observations(data.U, F, data.y), CoefficientPrior.flat(3))
