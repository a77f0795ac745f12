"""Laws of learning a stream of any length in a basis of bounded size."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sgp_ros.gp.inducing_regression import InducingPointRegression
from sgp_ros.gp.kernels import SquaredExponential
from sgp_ros.gp.model import CoefficientPrior, Model, Observations
from sgp_ros.gp.posterior import Posterior
from sgp_ros.gp.regression import Memory
from sgp_ros.gp.rotations import (
    absorb_equation,
    absorbed_equations_numpy,
    solve_transposed,
    solved_transposed_numpy,
)
from test.gp.worlds import random_problem, returning

PRIORS = [CoefficientPrior.flat(3), CoefficientPrior.from_std(np.ones(3), np.full(3, 2.0))]


def _learn(online, data):
    for u, f, y in zip(data.U, data.F, data.y, strict=True):
        online.learn(online.predict(u, f), y)
    return online


def _spread_out(data):
    """Return a model and the data, inputs so far apart that each needs a feature of its own."""
    kernels = tuple(SquaredExponential(x, (0.8,), (0,)) for x in (1.0, 2.0))
    U = np.random.default_rng(0).permutation(np.arange(float(len(data.U))))[:, None]
    return Model(kernels, (0.05, 0.1)), Observations(U, data.F, data.y)


def _same_prediction(online, batch, u, f, tolerance=1e-9):
    one, all_at_once = online.predict(u, f), batch.predict(u[None], f[None])
    np.testing.assert_allclose(one.mean, all_at_once.mean[0], atol=tolerance)
    np.testing.assert_allclose(one.covariance, all_at_once.covariance[0], atol=tolerance)


@given(st.integers(0, 10_000), st.integers(0, 5), st.integers(1, 4))
def test_equations_one_by_one_equal_one_factorisation(seed, m, count):
    """Rotations give the triangle of a single QR, and leave on W the same information."""
    rng = np.random.default_rng(seed)
    R, S = np.triu(rng.normal(size=(m, m))) + 3.0 * np.eye(m), rng.normal(size=(m, 3))
    R[m // 2 :, m // 2 :], S[m // 2 :] = 0.0, 0.0  # no data yet of the later ones
    phi, rest = rng.normal(size=(count, m)), rng.normal(size=(count, 3))
    expected_R, expected_S, expected_rest = absorbed_equations_numpy(R, S, phi, rest)
    for row, right in zip(phi.copy(), rest, strict=True):
        absorb_equation(R, S, row, right)
    np.testing.assert_allclose(R.T @ R, expected_R.T @ expected_R, atol=1e-9)
    np.testing.assert_allclose(R.T @ S, expected_R.T @ expected_S, atol=1e-9)
    np.testing.assert_allclose(rest.T @ rest, expected_rest.T @ expected_rest, atol=1e-9)


def test_compiled_solve_equals_that_of_the_library():
    """The substitution by rows is the transposed solve."""
    rng = np.random.default_rng(0)
    R, x = np.triu(rng.normal(size=(6, 6))) + 4.0 * np.eye(6), rng.normal(size=6)
    expected = solved_transposed_numpy(R, x)
    solve_transposed(R, x)
    np.testing.assert_allclose(x, expected, rtol=1e-12)


@pytest.mark.parametrize('prior', PRIORS)
def test_a_feature_for_every_sample_equals_batch(prior):
    """With room for all of them nothing is approximated: mean, covariance and W are exact."""
    model, data = _spread_out(random_problem(0, n=25)[1])
    online = _learn(InducingPointRegression(model, prior, Memory(100, 25)), data)
    batch = Posterior(model, data, prior)
    assert online.features == (25, 25)
    rng = np.random.default_rng(1)
    for u in (np.array([3.3]), np.array([12.0])):
        _same_prediction(online, batch, u, rng.normal(size=(2, 3)))
    np.testing.assert_allclose(online.information.coefficients, batch.coefficients, atol=1e-9)
    np.testing.assert_allclose(online.information.covariance, batch.covariance, atol=1e-9)


def test_more_features_come_closer_to_the_exact_posterior():
    """The error in mean and deviation falls with the size of the basis, to a small share."""
    kernel = SquaredExponential(1.0, (0.4,), (0,))
    model = Model((kernel,), (0.01,))
    rng = np.random.default_rng(3)
    U, F = rng.uniform(-1.0, 1.0, size=(150, 1)), rng.normal(size=(150, 1, 3))
    y = np.sin(5.0 * U) + 0.1 * rng.normal(size=(150, 1))
    data = Observations(U, F, y)
    batch = Posterior(model, data, PRIORS[1])
    queries = np.linspace(-1.0, 1.0, 21)
    zero = np.zeros((1, 3))
    exact = [batch.predict(np.array([[x]]), zero[None]) for x in queries]
    errors = []
    for features in (2, 4, 6, 8, 30):
        online = _learn(InducingPointRegression(model, PRIORS[1], Memory(300, features)), data)
        found = [online.predict(np.array([x]), zero) for x in queries]
        errors.append(
            max(
                abs(a.mean[0] - b.mean[0, 0])
                + abs(np.sqrt(a.covariance[0, 0]) - np.sqrt(b.covariance[0, 0, 0]))
                for a, b in zip(found, exact, strict=True)
            )
        )
    assert errors[-1] < 0.02 < errors[0]
    assert np.all(np.diff(errors[1:]) <= 0.0)


def test_without_process_it_is_least_squares_on_everything():
    """Where Z is zero nothing is approximated, and new noise is that of all samples."""
    model, data = random_problem(15, n=50, noise_like='parametric')
    other = Model(model.kernels, tuple(9.0 * x for x in model.noise))
    online = _learn(InducingPointRegression(model, PRIORS[1], Memory(8, 5)), data)
    for taken in (model, other):
        online.change(model=taken)
        batch = Posterior(taken, data, PRIORS[1])
        np.testing.assert_allclose(online.information.coefficients, batch.coefficients, rtol=1e-9)
        np.testing.assert_allclose(online.information.covariance, batch.covariance, rtol=1e-8)


def test_memory_of_a_stream_does_not_grow():
    """After the basis is complete, ten times as many samples hold as many numbers."""
    model, _ = random_problem(1)
    rng = np.random.default_rng(2)
    online = InducingPointRegression(model, PRIORS[1], Memory(20, 30))
    sizes = []
    for _ in range(2):
        for _ in range(400):
            u = rng.uniform(-9.0, 9.0, size=3)
            online.learn(online.predict(u, rng.normal(size=(2, 3))), rng.normal(size=2))
        assert online.size <= 20
        sizes.append({name: a.size for name, a in online.state().items() if len(name) > 1})
    assert sizes[0] == sizes[1]
    assert online.features == (30, 30)
    assert online.unresolved > 0


def _mean_square(online, w):
    """Return the mean square of the whitened errors of W."""
    error = online.information.R @ (online.information.coefficients - w)
    return error @ error / len(w)


def test_w_is_calibrated_on_streams_that_return():
    """Whitened errors of W have mean square 1 though each place is seen dozens of times.

    The mean of 60 draws of chi2_3 / 3 has standard deviation sqrt(2 / 3 / 60) = 0.105; four of
    these bound it. Counting each return as news would give a mean square of ten.
    """
    squares = []
    for seed in range(60):
        model, prior, w, data = returning(seed)
        online = _learn(InducingPointRegression(model, prior, Memory(20, 40)), data)
        squares.append(_mean_square(online, w))
        assert online.unresolved == 0
    assert abs(np.mean(squares) - 1.0) < 4 * 0.105


def test_far_from_all_features_the_prior_of_z_remains():
    """A basis without room does not pretend to know what it cannot express."""
    model, data = random_problem(4, n=30, k=1)
    online = _learn(InducingPointRegression(model, PRIORS[1], Memory(20, 3)), data)
    variance = online.predict(np.full(3, 50.0), np.zeros((1, 3))).covariance[0, 0]
    assert variance == pytest.approx(model.kernels[0].variance)


def test_changed_hyperparameters_equal_a_fresh_start_while_the_stream_is_whole():
    """While the kept samples are the whole stream, new features see all of it."""
    model, data = random_problem(9, n=15)
    other = model.with_log_parameters(model.log_parameters + 0.4)
    online = _learn(InducingPointRegression(model, PRIORS[1], Memory(100, 15)), data)
    online.change(model=other)
    fresh = _learn(InducingPointRegression(other, PRIORS[1], Memory(100, 15)), data)
    u, f = data.U[0] + 0.1, data.F[1]
    one, two = online.predict(u, f), fresh.predict(u, f)
    np.testing.assert_allclose(one.mean, two.mean, atol=1e-12)
    np.testing.assert_allclose(one.covariance, two.covariance, atol=1e-12)


def test_the_kept_samples_and_what_is_gone_add_up():
    """The base of a fit is what the samples that are gone tell beside the kept ones."""
    data = _spread_out(random_problem(11, n=25)[1])
    model, data = data
    online = _learn(InducingPointRegression(model, PRIORS[1], Memory(10, 25)), data)
    base = online.base
    joint = Posterior(model, online.buffer, CoefficientPrior(base.R, base.z, 0.0))
    np.testing.assert_allclose(joint.coefficients, online.information.coefficients, atol=1e-9)
    np.testing.assert_allclose(joint.covariance, online.information.covariance, atol=1e-9)
    np.testing.assert_array_equal(online.buffer.U, data.U[-10:])


def test_without_memory_only_the_kept_samples_count_under_new_hyperparameters():
    """Dropped samples are then left to the past, and a fit begins from the prior."""
    model, data = random_problem(11, n=60, k=1)
    other = model.with_log_parameters(model.log_parameters + 0.1)
    online = _learn(
        InducingPointRegression(model, PRIORS[1], Memory(20, 40, remember=False)), data
    )
    np.testing.assert_allclose(online.base.R.T @ online.base.R, np.diag(np.full(3, 0.25)))
    online.change(model=other)
    tail = Observations(data.U[-20:], data.F[-20:], data.y[-20:])
    fresh = _learn(InducingPointRegression(other, PRIORS[1], Memory(20, 40)), tail)
    np.testing.assert_allclose(
        online.information.coefficients, fresh.information.coefficients, rtol=1e-10
    )


def test_stop_save_restore_continue_equals_never_stopped():
    """A restored state continues to the same bits, through a change of hyper-parameters too."""
    model, data = random_problem(8, n=40)
    one, other = (InducingPointRegression(model, PRIORS[0], Memory(12, 9)) for _ in range(2))
    changed = model.with_log_parameters(model.log_parameters + 0.2)
    for i in range(40):
        if i == 19:
            other.restore(one.state())
        for online in (one, other) if i >= 19 else (one,):
            online.learn(online.predict(data.U[i], data.F[i]), data.y[i])
            if i == 30:
                online.change(model=changed)
    for name, array in other.state().items():
        np.testing.assert_array_equal(array, one.state()[name])


def test_predicting_changes_nothing():
    """A prediction may be made any number of times."""
    model, data = random_problem(7)
    online = _learn(InducingPointRegression(model, PRIORS[0], Memory(10, 6)), data)
    before = online.state()
    prediction = online.predict(data.U[0], data.F[0])
    again = online.with_regressor(prediction, data.F[0])
    np.testing.assert_array_equal(again.mean, prediction.mean)
    for name, array in online.state().items():
        np.testing.assert_array_equal(array, before[name])


def test_stale_predictions_are_refused():
    """Learning reuses the features of the prediction, so they must be the present ones."""
    model, data = random_problem(10)
    online = InducingPointRegression(model, PRIORS[0], Memory(10, 10))
    prediction = online.predict(data.U[0], data.F[0])
    online.learn(prediction, data.y[0])
    with pytest.raises(ValueError, match='before the last change'):
        online.learn(prediction, data.y[0])


def test_process_without_physics_has_no_coefficients():
    """GP is the case p = 0."""
    model, data = random_problem(12, p=0)
    online = _learn(InducingPointRegression(model, CoefficientPrior.flat(0), Memory(6, 8)), data)
    assert online.information.coefficients.shape == (0,)
    assert np.isfinite(online.predict(data.U[0], data.F[0]).covariance).all()
