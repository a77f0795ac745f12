"""Laws of the posterior of W and Z from all rows, beside the dense one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sgp_ros.batch import posterior as posterior_module
from sgp_ros.batch.posterior import BatchPosterior
from sgp_ros.gp.kernels import SquaredExponential
from sgp_ros.gp.model import CoefficientPrior, Model, Observations
from sgp_ros.gp.posterior import Posterior

MODEL = Model((SquaredExponential(1.5, (0.8, 1.2), (0, 1)), None), (0.05, 0.2))


def _world(seed, n=80):
    rng = np.random.default_rng(seed)
    U = rng.normal(size=(n, 2))
    F = rng.normal(size=(n, 2, 3))
    z = np.column_stack([np.sin(2 * U[:, 0]) * U[:, 1], np.zeros(n)])
    y = F @ np.array([1.0, -2.0, 0.5]) + z + rng.normal(size=(n, 2)) * np.sqrt(MODEL.noise)
    return Observations(U, F, y)


def _both(seed, prior, n=80):
    data = _world(seed, n)
    block = np.zeros(n, dtype=int)
    return Posterior(MODEL, data, prior), BatchPosterior(MODEL, data, prior, block, n)


PRIORS = [
    CoefficientPrior.flat(3),
    CoefficientPrior.from_std(np.array([1.0, 0.0, 0.0]), np.array([0.1, np.inf, 1.0])),
]


@pytest.mark.parametrize('prior', PRIORS, ids=['flat', 'informed'])
@settings(max_examples=15)
@given(seed=st.integers(0, 10_000))
def test_all_rows_in_a_basis_equal_the_dense_posterior(prior, seed):
    """The basis leaves out a thousandth of the noise: a tenth of a deviation at most."""
    dense, batch = _both(seed, prior)
    spread = np.sqrt(np.diag(dense.covariance))
    assert np.abs(batch.coefficients - dense.coefficients).max() < 0.02 * spread.max()
    assert batch.white_covariance == pytest.approx(dense.covariance, rel=0.01, abs=1e-6)
    query = _world(seed + 1)
    observed = dense.predict(query.U, query.F).observed(np.array(MODEL.noise))
    mean, variance = batch.predict(query.U, query.F)
    excess = batch.covariance - batch.white_covariance
    assert np.all(np.abs(mean - observed.mean) < 0.1 * np.sqrt(observed.variance))
    if np.abs(excess).max() < 1e-12:
        assert variance == pytest.approx(observed.variance, rel=0.02)


def test_chunks_of_rows_do_not_show(monkeypatch):
    """The factorization is updated, not approximated."""
    prior = PRIORS[0]
    data = _world(0)
    block = np.zeros(80, dtype=int)
    whole = BatchPosterior(MODEL, data, prior, block, 80)
    monkeypatch.setattr(posterior_module, '_CHUNK', 7)
    pieces = BatchPosterior(MODEL, data, prior, block, 80)
    assert pieces.coefficients == pytest.approx(whole.coefficients, rel=1e-10)
    assert pieces.covariance == pytest.approx(whole.covariance, rel=1e-8, abs=1e-14)


def test_a_column_that_nothing_determines_is_said_to_be():
    """Its predictions have infinite variance where it enters, finite variance elsewhere."""
    data = _world(0)
    data.F[:, :, 2] = 0.0
    batch = BatchPosterior(MODEL, data, PRIORS[0], np.zeros(80, dtype=int), 80)
    assert batch.is_identifiable.tolist() == [True, True, False]
    F = np.zeros((2, 2, 3))
    F[0, :, 2] = 1.0
    _, variance = batch.predict(np.zeros((2, 2)), F)
    assert np.isinf(variance[0]).all()
    assert np.isfinite(variance[1]).all()


def test_fewer_rows_than_coefficients_leave_the_rest_undetermined():
    """Two rows of two joints cannot determine six coefficients."""
    rng = np.random.default_rng(0)
    data = Observations(
        rng.normal(size=(2, 2)), rng.normal(size=(2, 2, 6)), rng.normal(size=(2, 2))
    )
    model = Model((None, None), (0.1, 0.1))
    batch = BatchPosterior(model, data, CoefficientPrior.flat(6), np.zeros(2, dtype=int), 2)
    assert not batch.is_identifiable.any()


def test_repeating_neighbours_do_not_add_certainty():
    """Each row four times in a row: the white covariance falls to a quarter, the other stays."""
    rng = np.random.default_rng(5)
    n = 300
    F = rng.normal(size=(n, 1, 1))
    y = F[:, :, 0] + rng.normal(size=(n, 1))
    model = Model((None,), (1.0,))
    prior = CoefficientPrior.flat(1)

    def posterior(repeats):
        data = Observations(
            np.zeros((n * repeats, 1)),
            np.repeat(F, repeats, axis=0),
            np.repeat(y, repeats, axis=0),
        )
        return BatchPosterior(model, data, prior, np.zeros(n * repeats, dtype=int), 1)

    once, often = posterior(1), posterior(4)
    assert often.white_covariance == pytest.approx(once.white_covariance / 4)
    assert often.covariance[0, 0] == pytest.approx(once.covariance[0, 0], rel=0.35)
