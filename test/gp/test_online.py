"""Laws of learning one sample at a time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sgp_ros.errors import NumericalError
from sgp_ros.gp.buffer import SampleBuffer
from sgp_ros.gp.inducing_information import InducingInformation
from sgp_ros.gp.information import Information
from sgp_ros.gp.kernels import SquaredExponential
from sgp_ros.gp.model import CoefficientPrior, Model, Observations
from sgp_ros.gp.online import OnlineRegression
from sgp_ros.gp.posterior import Posterior
from sgp_ros.gp.regression import Memory
from sgp_ros.gp.rotations import absorb_rows, absorbed_rows_numpy
from test.gp.worlds import random_problem, returning

PRIORS = [CoefficientPrior.flat(3), CoefficientPrior.from_std(np.ones(3), np.full(3, 2.0))]


def _stream(model, data, prior, budget=1000, **options):
    online = OnlineRegression(model, prior, Memory(budget, **options))
    for u, f, y in zip(data.U, data.F, data.y, strict=True):
        online.learn(online.predict(u, f), y)
    return online


@pytest.mark.parametrize('prior', PRIORS)
@pytest.mark.parametrize('noise_like', [None, 'parametric'])
def test_one_by_one_equals_batch(prior, noise_like):
    """Learning sample by sample ends in the batch posterior; cond(K) is below 1e3."""
    model, data = random_problem(0, n=25, noise_like=noise_like)
    online, batch = _stream(model, data, prior), Posterior(model, data, prior)
    rng = np.random.default_rng(1)
    u, f = rng.normal(size=3), rng.normal(size=(2, 3))
    one, all_at_once = online.predict(u, f), batch.predict(u[None], f[None])
    np.testing.assert_allclose(one.mean, all_at_once.mean[0], atol=1e-10)
    np.testing.assert_allclose(one.covariance, all_at_once.covariance[0], atol=1e-10)
    np.testing.assert_allclose(online.information.coefficients, batch.coefficients, atol=1e-10)
    np.testing.assert_allclose(online.information.covariance, batch.covariance, atol=1e-10)


def test_chain_rule_of_predictions_is_the_evidence():
    """The sum of one-step log predictive densities is log N(y; E[Y], sigma_dd)."""
    model, data = random_problem(2, n=15)
    prior = PRIORS[1]
    online = OnlineRegression(model, prior, Memory(100))
    total = 0.0
    for u, f, y in zip(data.U, data.F, data.y, strict=True):
        prediction = online.predict(u, f)
        covariance = prediction.covariance + np.diag(model.noise)
        error = y - prediction.mean
        _, log_det = np.linalg.slogdet(2 * np.pi * covariance)
        total -= 0.5 * (log_det + error @ np.linalg.solve(covariance, error))
        online.learn(prediction, y)
    assert total == pytest.approx(Posterior(model, data, prior).log_evidence, abs=1e-9)


@given(st.integers(0, 10_000), st.integers(0, 6))
def test_rows_one_by_one_equal_one_factorisation(seed, rows):
    """Information grown by rotations is that of a single QR."""
    rng = np.random.default_rng(seed)
    A, b = rng.normal(size=(rows, 3)), rng.normal(size=rows)
    R, z = np.zeros((3, 3)), np.zeros(3)
    for row in np.column_stack([A, b]):
        absorb_rows(R, z, row[None].copy())
    S, t = absorbed_rows_numpy(np.zeros((3, 3)), np.zeros(3), A, b)
    np.testing.assert_allclose(R.T @ R, S.T @ S, atol=1e-10)
    np.testing.assert_allclose(R.T @ z, S.T @ t, atol=1e-10)
    np.testing.assert_allclose(R.T @ R, A.T @ A, atol=1e-10)


@pytest.mark.parametrize('prior', PRIORS)
def test_dropped_samples_count_once(prior):
    """Where each sample has a feature, W is that of the whole stream, however small the buffer."""
    kernels = tuple(SquaredExponential(x, (0.8,), (0,)) for x in (1.0, 2.0))
    model, data = Model(kernels, (0.05, 0.1)), random_problem(4, n=25, d=1)[1]
    U = np.random.default_rng(0).permutation(np.arange(25.0))[:, None]
    data = Observations(U, data.F, data.y)
    online, batch = _stream(model, data, prior, 5), Posterior(model, data, prior)
    np.testing.assert_allclose(online.information.coefficients, batch.coefficients, atol=1e-9)
    np.testing.assert_allclose(online.information.covariance, batch.covariance, atol=1e-9)
    assert online.size == 5
    assert online.unresolved == 0


@pytest.mark.parametrize('prior', PRIORS)
def test_the_buffer_and_what_it_leaves_out_add_up(prior):
    """The base of a fit is what dropped samples tell beside the buffer: nothing counts twice."""
    model, data = random_problem(14, n=30)
    online = _stream(model, data, prior, 6)
    base, buffer = online.base, online.buffer
    rows = CoefficientPrior(base.R, base.z, 0.0)
    joint = Posterior(model, buffer, rows)
    np.testing.assert_allclose(joint.coefficients, online.information.coefficients, rtol=1e-8)
    np.testing.assert_allclose(joint.covariance, online.information.covariance, rtol=1e-8)


def test_dropped_samples_follow_a_change_of_noise():
    """Where Z is zero, new noise gives the least squares of everything under that noise."""
    model, data = random_problem(15, n=30, noise_like='parametric')
    other = Model(model.kernels, tuple(9.0 * x for x in model.noise))
    online = _stream(model, data, PRIORS[1], 5)
    online.change(model=other)
    batch = Posterior(other, data, PRIORS[1])
    np.testing.assert_allclose(online.information.coefficients, batch.coefficients, rtol=1e-9)
    np.testing.assert_allclose(online.information.covariance, batch.covariance, rtol=1e-8)


def test_memory_without_process_equals_least_squares_on_everything():
    """Where Z is zero nothing is lost by dropping: PR keeps all of the stream."""
    model, data = random_problem(5, n=40, noise_like='parametric')
    online = _stream(model, data, CoefficientPrior.flat(3), 4)
    batch = Posterior(model, data, CoefficientPrior.flat(3))
    np.testing.assert_allclose(online.information.coefficients, batch.coefficients, rtol=1e-10)


def test_without_memory_only_the_buffer_counts():
    """Forgetting is exact: the posterior is that of the last samples alone."""
    model, data = random_problem(6, n=20)
    online = _stream(model, data, PRIORS[1], 8, remember=False)
    tail = Observations(data.U[-8:], data.F[-8:], data.y[-8:])
    batch = Posterior(model, tail, PRIORS[1])
    np.testing.assert_allclose(online.information.coefficients, batch.coefficients, atol=1e-9)
    np.testing.assert_allclose(online.information.covariance, batch.covariance, atol=1e-9)


def test_sharing_a_factor_changes_no_prediction():
    """Outputs whose covariances differ by a scale are predicted as with a factor of their own.

    The other model parts them by 1e-10 of a noise variance, which is all that may come out.
    """
    model, data = random_problem(16, n=30, k=3)
    first = model.kernels[0]
    double = SquaredExponential(4.0 * first.variance, first.lengthscales, first.inputs)
    kernels = (first, model.kernels[1], double)
    shared = _stream(Model(kernels, (0.2, 0.3, 0.8)), data, PRIORS[1], 8)
    parted = _stream(Model(kernels, (0.2, 0.3, 0.8 * (1.0 + 1e-10))), data, PRIORS[1], 8)
    for part in ('factor', 'basis_set'):
        held = [
            sum(name.startswith(part) and name.endswith('_L') for name in x.state())
            for x in (shared, parted)
        ]
        assert held == [2, 3]
    found, wanted = (x.predict(data.U[0], data.F[1]) for x in (shared, parted))
    np.testing.assert_allclose(found.mean, wanted.mean, rtol=1e-8)
    np.testing.assert_allclose(found.covariance, wanted.covariance, rtol=1e-8)
    for x in (shared, parted):
        x.change(model=x.model)
    np.testing.assert_allclose(shared.predict(data.U[0], data.F[1]).mean, wanted.mean, rtol=1e-8)


def test_memory_is_calibrated_on_long_streams():
    """Whitened errors of W over 200 streams with the true model have mean square 1.

    The mean of 200 draws of chi2_3 / 3 has standard deviation sqrt(2 / 3 / 200) = 0.058;
    four of these bound it.
    """
    kernel = SquaredExponential(1.0, (0.5,), (0,))
    model = Model((kernel,), (0.1,))
    squares = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        U = rng.uniform(-2, 2, size=(80, 1))
        F = rng.normal(size=(80, 1, 3))
        w = rng.normal(size=3)
        cov = kernel.matrix(U) + 0.1 * np.eye(80)
        y = F[:, 0] @ w + np.linalg.cholesky(cov) @ rng.normal(size=80)
        online = _stream(model, Observations(U, F, y[:, None]), CoefficientPrior.flat(3), 20)
        error = online.information.R @ (online.information.coefficients - w)
        squares.append(error @ error / 3)
    assert abs(np.mean(squares) - 1.0) < 4 * 0.058


@pytest.mark.long
def test_w_is_calibrated_on_long_streams_that_return():
    """Whitened errors of W have root mean square 1, though the buffer forgets every place.

    2000 samples, each place seen forty times, a buffer of 20 that holds a tenth of one return.
    The mean of 40 draws of chi2_3 / 3 has standard deviation sqrt(2 / 3 / 40) = 0.129; four of
    these bound it. Of 120 intervals of 95 % at least 105 hold W: fewer are one chance in 2000.
    Counting what Z does at a place as news at each return gives a mean square above ten.
    """
    squares, inside = [], 0
    for seed in range(40):
        model, prior, w, data = returning(seed, 2000)
        information = _stream(model, data, prior, 20).information
        error = information.coefficients - w
        squares.append(np.sum((information.R @ error) ** 2) / 3)
        inside += np.sum(np.abs(error) <= 1.96 * np.sqrt(np.diag(information.covariance)))
    assert abs(np.mean(squares) - 1.0) < 4 * 0.129
    assert inside >= 105


def test_predicting_changes_nothing():
    """A prediction may be made any number of times."""
    model, data = random_problem(7)
    online = _stream(model, data, PRIORS[0])
    before = online.state()
    online.predict(data.U[0], data.F[0])
    for name, array in online.state().items():
        np.testing.assert_array_equal(array, before[name])


def test_stop_save_restore_continue_equals_never_stopped():
    """A restored state continues to the same bits, through a change of hyper-parameters too."""
    model, data = random_problem(8, n=30)
    changed = model.with_log_parameters(model.log_parameters + 0.2)
    for stop in (4, 12):
        one, other = (OnlineRegression(model, PRIORS[0], Memory(6)) for _ in range(2))
        for i in range(30):
            if i == stop:
                other.restore(one.state())
            for online in (one, other) if i >= stop else (one,):
                online.learn(online.predict(data.U[i], data.F[i]), data.y[i])
                if i == 20:
                    online.change(model=changed)
        assert one.state().keys() == other.state().keys()
        for name, array in other.state().items():
            np.testing.assert_array_equal(array, one.state()[name])


def test_changed_hyperparameters_equal_a_fresh_start():
    """After a change, the buffer is explained by the new model alone."""
    model, data = random_problem(9, n=15)
    other = model.with_log_parameters(model.log_parameters + 0.4)
    online = _stream(model, data, PRIORS[1])
    online.change(model=other)
    batch = Posterior(other, data, PRIORS[1])
    np.testing.assert_allclose(online.information.coefficients, batch.coefficients, atol=1e-10)


@pytest.mark.parametrize('changed', [(0,), (1,), (0, 1)])
def test_outputs_may_take_their_hyperparameters_one_after_the_other(changed):
    """Factors of the others are taken over; the end is that of one change, before and after the
    buffer is full, and what a basis learned is not counted anew."""
    model, data = random_problem(3, n=60, k=2, d=2)
    other = Model(
        tuple(replace(k, signal_variance=1.3 * k.variance) for k in model.kernels), (0.3, 0.2)
    )
    prior = CoefficientPrior.from_std(np.zeros(3), np.ones(3))
    for budget in (100, 40):
        at_once, by_parts = (_stream(model, data, prior, budget) for _ in range(2))
        at_once.change(other)
        mixed = Model(
            tuple((other if j in changed else model).kernels[j] for j in range(2)),
            tuple((other if j in changed else model).noise[j] for j in range(2)),
        )
        by_parts.change(mixed)
        by_parts.change(other)
        u, f = data.U[0] + 0.1, data.F[0]
        one, two = at_once.predict(u, f), by_parts.predict(u, f)
        np.testing.assert_allclose(two.mean, one.mean, rtol=1e-9)
        np.testing.assert_allclose(two.covariance, one.covariance, rtol=1e-9)


def test_the_basis_is_filled_while_the_buffer_fills():
    """The first sample that leaves finds it complete, whatever changed before."""
    model, prior, _, data = returning(0, n=61)
    online = _stream(model, Observations(data.U[:50], data.F[:50], data.y[:50]), prior, 60)
    assert online._ahead.count == 50
    online.change(Model(model.kernels, (0.2,)))
    counts = []
    for u, f, y in zip(data.U[50:], data.F[50:], data.y[50:], strict=True):
        counts.append(online._ahead.count)
        online.learn(online.predict(u, f), y)
    assert np.diff([0, *counts]).max() <= 7
    assert counts[-1] == 60
    assert online._ahead is None
    rows = np.concatenate([data.F, data.y[..., None]], axis=2)
    samples = SampleBuffer(data.U, rows, np.ones(61), 61)
    fresh = InducingInformation.of_samples(online.model, Information.of_prior(prior), 100, samples)
    np.testing.assert_array_equal(online.information.R, fresh.total.R)


def test_stale_predictions_are_refused():
    """Learning reuses the solve of the prediction, so it must belong to the present model."""
    model, data = random_problem(10)
    online = OnlineRegression(model, PRIORS[0], Memory(10))
    prediction = online.predict(data.U[0], data.F[0])
    online.learn(prediction, data.y[0])
    with pytest.raises(ValueError, match='before the last change'):
        online.learn(prediction, data.y[0])


def test_first_samples_leave_directions_undetermined():
    """Under a flat prior, fewer equations than coefficients give an infinite variance."""
    model, data = random_problem(11, k=1, p=3)
    online = OnlineRegression(model, PRIORS[0], Memory(10))
    assert np.isinf(online.predict(data.U[0], data.F[0]).covariance[0, 0])
    assert not online.information.is_identifiable.any()
    for i in range(4):
        online.learn(online.predict(data.U[i], data.F[i]), data.y[i])
    assert np.isfinite(online.predict(data.U[5], data.F[5]).covariance[0, 0])
    assert online.information.is_identifiable.all()


def test_process_without_physics_has_no_coefficients():
    """GP is the case p = 0."""
    model, data = random_problem(12, p=0)
    online = _stream(model, data, CoefficientPrior.flat(0), 6)
    assert online.information.coefficients.shape == (0,)
    assert np.isfinite(online.predict(data.U[0], data.F[0]).covariance).all()


def test_a_lost_factor_raises_and_changes_nothing():
    """Repeated inputs without noise are refused by append and by a change of model."""
    model = Model((SquaredExponential(1.0, (1.0,), (0,)),), (1e-300,))
    online = OnlineRegression(model, CoefficientPrior.flat(0), Memory(5))
    u, f = np.zeros(1), np.zeros((1, 0))
    online.learn(online.predict(u, f), np.zeros(1))
    with pytest.raises(NumericalError, match='repeats'):
        online.learn(online.predict(u, f), np.zeros(1))
    good = Model((SquaredExponential(1.0, (1.0,), (0,)),), (0.1,))
    other = OnlineRegression(good, CoefficientPrior.flat(0), Memory(5))
    for _ in range(3):
        other.learn(other.predict(u, f), np.zeros(1))
    with pytest.raises(NumericalError, match='not positive definite'):
        other.change(model=model)
    assert other.model == good


def test_refreshing_measures_the_drift_and_ends_it():
    """A disturbed factor is as far off as it was disturbed; afterwards it is that of the buffer.

    Rounding of 30 rotations at a condition number below 1e3 stays below 1e-12.
    """
    model, data = random_problem(17, n=30)
    online = _stream(model, data, PRIORS[0], 8)
    assert online.rotated == 22
    wanted = online.predict(data.U[0], data.F[0])
    assert online.refresh() < 1e-12
    assert online.rotated == 0
    online._held.factors[0]._U *= 1.001
    assert online.refresh() == pytest.approx(1e-3, rel=1e-6)
    np.testing.assert_allclose(online.predict(data.U[0], data.F[0]).mean, wanted.mean, rtol=1e-10)
    online._held.factors[0]._U *= np.nan
    assert not online.is_sound(online.predict(data.U[0], data.F[0]))
    assert online.refresh() == np.inf
    assert online.is_sound(online.predict(data.U[0], data.F[0]))


def test_a_smaller_budget_drops_the_oldest():
    """A live change of the budget takes effect at once."""
    model, data = random_problem(13, n=12)
    online = _stream(model, data, PRIORS[0])
    online.change(memory=replace(online.memory, budget=5))
    np.testing.assert_array_equal(online.buffer.U, data.U[-5:])


def test_information_starts_from_the_prior():
    """A prior alone gives its own mean and covariance."""
    prior = CoefficientPrior.from_std(np.array([1.0, 2.0]), np.array([0.5, 3.0]))
    information = Information.of_prior(prior)
    np.testing.assert_allclose(information.coefficients, [1.0, 2.0])
    np.testing.assert_allclose(information.covariance, np.diag([0.25, 9.0]), atol=1e-12)


@pytest.mark.parametrize('budget', [100, 20])
@pytest.mark.parametrize('forgetting', [0.0, 50.0])
def test_all_at_once_equals_one_by_one(budget, forgetting):
    """Before and after samples leave, with and without forgetting."""
    model, prior, _, data = returning(1, n=40)
    one_by_one = _stream(model, data, prior, budget, forgetting=forgetting)
    at_once = OnlineRegression(model, prior, Memory(budget, forgetting=forgetting))
    at_once.learn_all(data)
    assert at_once.size == one_by_one.size
    u, f = data.U[3] + 0.1, data.F[0]
    found, expected = at_once.predict(u, f), one_by_one.predict(u, f)
    np.testing.assert_allclose(found.mean, expected.mean, rtol=1e-8)
    np.testing.assert_allclose(found.covariance, expected.covariance, rtol=1e-8)
