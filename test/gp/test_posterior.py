"""Laws of the joint inference of W and Z."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

from sgp_ros.errors import NumericalError
from sgp_ros.gp.information import Information
from sgp_ros.gp.kernels import SquaredExponential
from sgp_ros.gp.model import CoefficientPrior, Model, Observations
from sgp_ros.gp.posterior import Posterior
from test.gp.textbook import dense
from test.gp.worlds import random_problem

SHAPES = [
    {'k': 1, 'p': 2},
    {'k': 2, 'p': 3},
    {'k': 3, 'p': 7},
    {'k': 2, 'p': 3, 'gain': 2},
    {'k': 3, 'p': 4, 'gain': 1},
    {'k': 1, 'p': 2, 'gain': 3},
    {'k': 2, 'p': 3, 'noise_like': 'parametric'},
]


@pytest.mark.parametrize('shape', SHAPES)
def test_posterior_equals_equations_8_to_20(shape):
    """Mean, covariance and evidence agree with the dense form; cond(sigma_dd) is below 1e4."""
    model, data = random_problem(3, **shape)
    rng = np.random.default_rng(4)
    p, k = data.F.shape[2], data.F.shape[1]
    root = rng.normal(size=(p, p))
    mu, sigma_w = rng.normal(size=p), root @ root.T + 0.1 * np.eye(p)
    U, F = rng.normal(size=(5, data.U.shape[1])), rng.normal(size=(5, k, p))
    mean, covariance, evidence = dense(model, data, mu, sigma_w, U, F)
    posterior = Posterior(model, data, CoefficientPrior.from_covariance(mu, sigma_w))
    prediction = posterior.predict(U, F)
    np.testing.assert_allclose(prediction.mean, mean, atol=1e-9)
    np.testing.assert_allclose(prediction.covariance, covariance, atol=1e-9)
    assert posterior.log_evidence == pytest.approx(evidence, abs=1e-9)
    alone = posterior.predict(U, np.zeros_like(F)).mean
    np.testing.assert_allclose(posterior.process_mean(U), alone, atol=1e-9)


@pytest.mark.parametrize('shape', SHAPES)
@pytest.mark.parametrize('flat', [False, True])
def test_gradient_equals_central_differences(shape, flat):
    """The analytic gradient is the slope of the evidence, for proper and flat priors."""
    model, data = random_problem(5, **shape)
    p = data.F.shape[2]
    prior = CoefficientPrior.from_std(np.ones(p), np.full(p, np.inf if flat else 2.0))
    theta = model.log_parameters
    gradient = Posterior(model, data, prior).evidence_gradient()
    step = 1e-5
    for i in range(len(theta)):
        shift = step * np.eye(len(theta))[i]
        high = Posterior(model.with_log_parameters(theta + shift), data, prior).log_evidence
        low = Posterior(model.with_log_parameters(theta - shift), data, prior).log_evidence
        assert gradient[i] == pytest.approx((high - low) / (2 * step), abs=1e-5)


def test_gradient_holds_with_undetermined_directions():
    """Where nothing determines a direction of W, evidence and gradient live on the rest."""
    model, data = random_problem(6, p=3)
    F = np.concatenate([data.F, data.F[:, :, :1]], axis=2)  # a repeated column
    data = Observations(data.U, F, data.y)
    prior = CoefficientPrior.flat(4)
    theta = model.log_parameters
    gradient = Posterior(model, data, prior).evidence_gradient()
    for i in range(len(theta)):
        shift = 1e-5 * np.eye(len(theta))[i]
        high = Posterior(model.with_log_parameters(theta + shift), data, prior).log_evidence
        low = Posterior(model.with_log_parameters(theta - shift), data, prior).log_evidence
        assert gradient[i] == pytest.approx((high - low) / 2e-5, abs=1e-5)


def test_posterior_agrees_with_scikit_learn_for_a_plain_process():
    """Without physics, SGP is an ordinary Gaussian process."""
    rng = np.random.default_rng(0)
    U, y = rng.normal(size=(30, 2)), rng.normal(size=(30, 1))
    model = Model((SquaredExponential(1.7, (0.6, 1.3), (0, 1)),), (0.2,))
    posterior = Posterior(
        model, Observations(U, np.zeros((30, 1, 0)), y), CoefficientPrior.flat(0)
    )
    kernel = ConstantKernel(1.7) * RBF([0.6, 1.3]) + WhiteKernel(0.2)
    reference = GaussianProcessRegressor(kernel, alpha=1e-300, optimizer=None).fit(U, y[:, 0])
    queries = rng.normal(size=(7, 2))
    mean, std = reference.predict(queries, return_std=True)
    prediction = posterior.predict(queries, np.zeros((7, 1, 0)))
    np.testing.assert_allclose(prediction.mean[:, 0], mean, atol=1e-9)
    np.testing.assert_allclose(prediction.variance[:, 0] + 0.2, std**2, atol=1e-9)
    value, slope = reference.log_marginal_likelihood(kernel.theta, eval_gradient=True)
    assert posterior.log_evidence == pytest.approx(value, abs=1e-9)
    np.testing.assert_allclose(posterior.evidence_gradient(), slope, atol=1e-8)


def _mpmath_evidence(model, data, sigma):
    """Log density of y with 60 digits."""
    mpmath.mp.dps = 60
    n = len(data.y)
    kernel = model.kernels[0]
    C = mpmath.matrix(n, n)
    for i in range(n):
        for j in range(n):
            distance = sum(
                ((mpmath.mpf(data.U[i, c]) - mpmath.mpf(data.U[j, c])) / mpmath.mpf(scale)) ** 2
                for c, scale in zip(kernel.inputs, kernel.lengthscales, strict=True)
            )
            C[i, j] = mpmath.mpf(kernel.variance) * mpmath.exp(-distance / 2)
            for f, g in zip(data.F[i, 0], data.F[j, 0], strict=True):
                C[i, j] += mpmath.mpf(f) * mpmath.mpf(g) * mpmath.mpf(sigma) ** 2
        C[i, i] += mpmath.mpf(model.noise[0])
    y = mpmath.matrix([mpmath.mpf(v) for v in data.y[:, 0]])
    L = mpmath.cholesky(C)
    log_det = 2 * sum(mpmath.log(L[i, i]) for i in range(n))
    z = mpmath.lu_solve(L, y)
    quadratic = sum(v**2 for v in z)
    return float(-(quadratic + log_det + n * mpmath.log(2 * mpmath.pi)) / 2)


@pytest.mark.parametrize('sigma', [1.0, 1e2, 1e4, 1e8, 1e12, 1e16])
def test_evidence_loses_no_digits_as_the_prior_widens(sigma):
    """Unscaled columns from 1e-2 to 1e3 with a near-collinear pair, against 60 digits.

    The bound of 1e-6 nat is far below any difference that a decision could rest on.
    """
    rng = np.random.default_rng(1)
    F = rng.normal(size=(25, 1, 4)) * np.array([1e-2, 1.0, 1e3, 1.0])
    F[:, 0, 3] = F[:, 0, 1] + 1e-5 * rng.normal(size=25)
    data = Observations(rng.normal(size=(25, 2)), F, rng.normal(size=(25, 1)))
    model = Model((SquaredExponential(1.0, (1.0, 7.0), (0, 1)),), (0.05,))
    prior = CoefficientPrior.from_std(np.zeros(4), np.full(4, sigma))
    value = Posterior(model, data, prior).log_evidence
    assert value == pytest.approx(_mpmath_evidence(model, data, sigma), abs=1e-6)


def test_flat_prior_is_the_limit_of_a_wide_one():
    """Predictions and coefficients under an infinite sigma_w continue those under a huge one."""
    model, data = random_problem(8, n=20)
    wide = Posterior(model, data, CoefficientPrior.from_std(np.zeros(3), np.full(3, 1e8)))
    flat = Posterior(model, data, CoefficientPrior.flat(3))
    np.testing.assert_allclose(flat.coefficients, wide.coefficients, atol=1e-9)
    np.testing.assert_allclose(flat.covariance, wide.covariance, rtol=1e-6, atol=1e-12)


def test_undetermined_directions_have_infinite_variance():
    """A query that needs a coefficient no sample informed gets an infinite interval."""
    model, data = random_problem(9, p=3)
    F = data.F.copy()
    F[:, :, 2] = 0.0
    posterior = Posterior(model, Observations(data.U, F, data.y), CoefficientPrior.flat(3))
    assert posterior.is_identifiable.tolist() == [True, True, False]
    query = np.zeros((2, 2, 3))
    query[:, :, 0] = 1.0
    query[1, 0, 2] = 1.0
    variance = posterior.predict(data.U[:2], query).variance
    assert np.isinf(variance).tolist() == [[False, False], [True, False]]


def test_collinear_columns_are_unidentifiable_but_predict():
    """Only the sum of two equal columns is determined: both are flagged, their sum predicts."""
    model, data = random_problem(10, p=2)
    F = np.concatenate([data.F, data.F[:, :, 1:]], axis=2)
    posterior = Posterior(model, Observations(data.U, F, data.y), CoefficientPrior.flat(3))
    assert posterior.is_identifiable.tolist() == [True, False, False]
    assert np.all(np.isfinite(posterior.predict(data.U, F).variance))


@pytest.mark.parametrize('share', [1e-15, 1e-13, 2e-12])
def test_rounding_in_columns_is_no_information(share):
    """Filters and eliminations leave more of it than one rounding per number."""
    rng = np.random.default_rng(7)
    n, p = 200, 12
    F = rng.normal(size=(n, 1, 6)) @ rng.normal(size=(6, p))  # rank 6
    data = Observations(np.zeros((n, 1)), F, rng.normal(size=(n, 1)))
    rounded = Observations(data.U, F + share * rng.normal(size=F.shape), data.y)
    model, prior = Model((None,), (1.0,)), CoefficientPrior.flat(p)
    clean, posterior = (Posterior(model, d, prior) for d in (data, rounded))
    assert not posterior.is_identifiable.any()
    assert np.linalg.matrix_rank(posterior.covariance, tol=1e-9) == 6
    expected = clean.predict(data.U, F).variance
    assert posterior.predict(data.U, F).variance == pytest.approx(expected, rel=1e-6)


def test_evidence_does_not_depend_on_units_of_columns_beyond_a_constant():
    """Differences of evidence between models survive a change of units of W."""
    model, data = random_problem(11, p=3)
    other = model.with_log_parameters(model.log_parameters + 0.3)
    scaled = Observations(data.U, data.F * np.array([1e3, 1.0, 1e-3]), data.y)
    prior = CoefficientPrior.flat(3)
    difference = [
        Posterior(model, d, prior).log_evidence - Posterior(other, d, prior).log_evidence
        for d in (data, scaled)
    ]
    assert difference[0] == pytest.approx(difference[1], abs=1e-9)


def test_singular_covariance_raises():
    """Repeated inputs without noise have no factor; the error says so."""
    U = np.zeros((5, 1))
    model = Model((SquaredExponential(1.0, (1.0,), (0,)),), (1e-300,))
    with pytest.raises(NumericalError, match='not positive definite'):
        Posterior(model, Observations(U, np.zeros((5, 1, 0)), U), CoefficientPrior.flat(0))


def test_shapes_that_do_not_fit_are_refused():
    """A wrong shape is the caller's mistake."""
    with pytest.raises(ValueError, match='F'):
        Observations(np.zeros((3, 1)), np.zeros((3, 2, 1)), np.zeros((3, 1)))


def test_prediction_of_observations_adds_gain_and_noise():
    """Y = g X + V: mean and covariance transform accordingly."""
    model, data = random_problem(12, gain=3)
    posterior = Posterior(model, data, CoefficientPrior.flat(3))
    assert data.G is not None
    latent = posterior.predict(data.U, data.F)
    seen = latent.observed(np.array(model.noise), data.G)
    np.testing.assert_allclose(seen.mean[4], data.G[4] @ latent.mean[4])
    expected = data.G[4] @ latent.covariance[4] @ data.G[4].T + np.diag(model.noise)
    np.testing.assert_allclose(seen.covariance[4], expected)
    direct = latent.observed(np.ones(2))
    np.testing.assert_allclose(direct.variance, latent.variance + 1.0)


def test_priors_that_mean_nothing_are_refused():
    """A standard deviation of zero or an indefinite covariance is a caller's mistake."""
    with pytest.raises(ValueError, match='positive'):
        CoefficientPrior.from_std(np.zeros(1), np.zeros(1))
    with pytest.raises(ValueError, match='positive definite'):
        CoefficientPrior.from_covariance(np.zeros(2), np.ones((2, 2)))


@pytest.mark.parametrize('kind', ['batch', 'information'])
def test_a_column_of_rounding_errors_determines_nothing(kind):
    """Columns that cancel in exact arithmetic leave 1e-16 of the others, not a coefficient."""
    rng = np.random.default_rng(0)
    F = rng.normal(size=(50, 3))
    F[:, 1] = 1e-16 * rng.normal(size=50)
    y = F @ [1.0, 0.0, 2.0] + 0.01 * rng.normal(size=50)
    data = Observations(np.zeros((50, 1)), F[:, None], y[:, None])
    found = (
        Information.nothing(3).with_rows(F, y)
        if kind == 'information'
        else Posterior(Model((None,), (1e-4,)), data, CoefficientPrior.flat(3))
    )
    np.testing.assert_array_equal(found.is_identifiable, [True, False, True])
    assert found.coefficients == pytest.approx([1.0, 0.0, 2.0], abs=0.01)
    if kind == 'batch':
        assert np.isfinite(found.predict(data.U, data.F).variance).all()
