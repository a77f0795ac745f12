"""Laws of the information of a whole stream on W, its inducing points at a limit or changed."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.gp.inducing_information import InducingInformation, interpolation_error
from sgp_ros.gp.inducing_points import JITTER
from sgp_ros.gp.inducing_regression import InducingPointRegression
from sgp_ros.gp.information import Forgetting, Information
from sgp_ros.gp.kernels import SquaredExponential
from sgp_ros.gp.model import CoefficientPrior, Model, Observations
from sgp_ros.gp.online import OnlineRegression
from sgp_ros.gp.posterior import Posterior
from sgp_ros.gp.regression import Memory
from test.gp.worlds import plane, random_problem, returning


def _learned(model, prior, data, features):
    basis = InducingInformation(model, Information.of_prior(prior), features)
    for u, f, y in zip(data.U, data.F, data.y, strict=True):
        basis.absorb(u, basis.features(u), np.column_stack([f, y]))
    return basis


def test_without_room_the_intervals_of_w_still_hold():
    """A tenth of the features that Z would need make W less certain, not too certain.

    The mean of 40 draws of chi2_3 / 3 has standard deviation 0.129; four of these bound it from
    above. Remainders that counted as news at each sample would give a mean square above ten.
    """
    squares = []
    for seed in range(40):
        model, prior, w, data = plane(seed, 400, 0.01)
        basis = _learned(model, prior, data, 20)
        assert basis.unresolved > 300
        error = basis.total.R @ (basis.total.coefficients - w)
        squares.append(error @ error / 3)
    assert np.mean(squares) < 1.0 + 4 * 0.129


@pytest.mark.parametrize('noise', [1e-2, 1e-4, 1e-6, 1e-8])
def test_little_noise_costs_no_digit_that_w_needs(noise):
    """Down to a hundred-millionth of the variance of Z, W is that of a batch fit.

    Errors of a hundredth of the noise are all that the basis may make; features so close that
    their covariance has no inverse in double precision would be lost far above that.
    """
    model, prior, _, data = returning(2)
    model = type(model)(model.kernels, (noise,))
    kernel = model.kernels[0]
    grid = np.linspace(-2.0, 2.0, 9)[:, None]
    z = kernel.matrix(data.U, grid) @ np.random.default_rng(0).normal(size=9)
    rough = np.sqrt(noise) * np.random.default_rng(1).normal(size=len(z))
    data.y[:, 0] = data.F[:, 0] @ [1.0, 2.0, 3.0] + z + rough
    found = _learned(model, prior, data, 100).total
    batch = Posterior(model, data, prior)
    deviations = np.sqrt(np.diag(batch.covariance))
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), deviations, rtol=0.02)
    assert np.all(np.abs(found.coefficients - batch.coefficients) < 0.2 * deviations)


def test_what_fades_no_longer_stands_for_the_same_remainder():
    """Samples without room are numbered by as much as they still count."""
    model, prior, _, data = plane(0, 300, 0.01)
    basis = _learned(model, prior, data, 5)
    points = basis.sets[0]
    before = points.tally.copy()
    forgetting = Forgetting(2.0, Information.of_prior(prior))
    basis.fade(forgetting)
    np.testing.assert_allclose(points.tally, np.exp(-0.5) * before)


PRIOR = CoefficientPrior.from_std(np.ones(3), np.full(3, 2.0))


def _learn(online, data):
    for u, f, y in zip(data.U, data.F, data.y, strict=True):
        online.learn(online.predict(u, f), y)
    return online


def _exact(model, prior):
    return OnlineRegression(model, prior, Memory(20, features=60))


def _basis(model, prior):
    return InducingPointRegression(model, prior, Memory(20, 60))


WAYS = [_exact, _basis]


def _spread_out(n=30):
    """Return data whose inputs are so far apart that each becomes an inducing input."""
    data = random_problem(3, n=n, d=1)[1]
    U = np.random.default_rng(0).permutation(np.arange(float(n)))[:, None]
    return Observations(U, data.F, data.y)


def _model(variances, lengthscales, noise):
    kernels = tuple(
        SquaredExponential(s, (x,), (0,)) for s, x in zip(variances, lengthscales, strict=True)
    )
    return Model(kernels, noise)


@pytest.mark.parametrize('way', WAYS)
@pytest.mark.parametrize(
    ('model', 'other'),
    [
        (_model((1.0, 2.0), (0.8, 0.7), (0.1, 0.1)), _model((0.5, 3.0), (0.5, 1.0), (0.2, 0.02))),
        (_model((1.0, 2.0), (0.8, 0.8), (0.1, 0.2)), _model((1.0, 2.0), (0.6, 0.9), (0.1, 0.3))),
        (_model((1.0, 2.0), (0.8, 0.7), (0.1, 0.3)), _model((2.0, 4.0), (0.6, 0.6), (0.1, 0.2))),
    ],
    ids=['apart', 'from a shared kernel', 'to a shared kernel'],
)
def test_where_each_sample_has_a_feature_nothing_is_lost(way, model, other):
    """Data then are values of Z itself, and hold for any kernel: W is that of a batch fit."""
    data = _spread_out()
    online = _learn(way(model, PRIOR), data)
    online.change(model=other)
    batch = Posterior(other, data, PRIOR)
    np.testing.assert_allclose(online.information.coefficients, batch.coefficients, atol=1e-9)
    np.testing.assert_allclose(online.information.covariance, batch.covariance, atol=1e-9)


def test_where_each_sample_has_a_feature_the_process_is_kept_too():
    """Samples that are gone still tell Z under the new kernel what a batch fit would know."""
    data, other = _spread_out(), _model((0.5, 3.0), (0.5, 1.0), (0.2, 0.02))
    online = _learn(_basis(_model((1.0, 2.0), (0.8, 0.7), (0.1, 0.1)), PRIOR), data)
    online.change(model=other)
    batch = Posterior(other, data, PRIOR)
    for u in (data.U[0] + 0.2, data.U[-1] + 0.3):
        f = np.ones((2, 3))
        found, wanted = online.predict(u, f), batch.predict(u[None], f[None])
        np.testing.assert_allclose(found.mean, wanted.mean[0], atol=1e-9)
        np.testing.assert_allclose(found.covariance, wanted.covariance[0], atol=1e-9)


@pytest.mark.parametrize('way', WAYS)
@pytest.mark.parametrize(
    ('length', 'variance', 'noise'),
    [(1.5, 1.0, 1.0), (1.0, 0.3, 2.0), *(
        pytest.param(*x, marks=pytest.mark.long)
        for x in [(0.75, 1.0, 1.0), (1.0, 3.0, 1.0), (1.2, 2.0, 0.5)]
    )],
)  # fmt: skip
def test_the_stream_is_as_good_as_learned_anew(way, length, variance, noise):
    """W is within a quarter of a deviation, its deviations within a tenth of a fresh start's.

    1500 samples of which the regression keeps 20. Means over ten streams.
    """
    errors, ratios = [], []
    for seed in range(10):
        model, prior, _, data = returning(seed, 1500)
        other = _model((variance,), (0.5 * length,), (0.1 * noise,))
        online, fresh = _learn(way(model, prior), data), _learn(_basis(other, prior), data)
        online.change(model=other)
        found, wanted = online.information, fresh.information
        errors.append(np.sum((wanted.R @ (found.coefficients - wanted.coefficients)) ** 2) / 3)
        ratios.append(np.sqrt(np.diag(found.covariance) / np.diag(wanted.covariance)))
    assert np.sqrt(np.mean(errors)) < 0.25
    assert np.all(np.abs(np.mean(ratios, axis=0) - 1.0) < 0.1)


def test_many_changes_lose_no_more_than_one():
    """Thirty changes to and fro while a stream is learned end as near to a fresh start.

    W within a third of a deviation, deviations within a tenth: what counts as noise under the
    shorter length scale is given back under the longer one. Means over ten streams.
    """
    errors, ratios = [], []
    for seed in range(10):
        model, prior, _, data = returning(seed, 900)
        models = (_model((1.0,), (0.7,), (0.08,)), model)
        online, fresh = _basis(model, prior), _learn(_basis(model, prior), data)
        for i in range(900):
            online.learn(online.predict(data.U[i], data.F[i]), data.y[i])
            if i % 30 == 29:
                online.change(model=models[i // 30 % 2])
        assert online.model == model
        found, wanted = online.information, fresh.information
        errors.append(np.sum((wanted.R @ (found.coefficients - wanted.coefficients)) ** 2) / 3)
        ratios.append(np.sqrt(np.diag(found.covariance) / np.diag(wanted.covariance)))
    assert np.sqrt(np.mean(errors)) < 0.34
    assert np.all(np.abs(np.mean(ratios, axis=0) - 1.0) < 0.1)


@pytest.mark.parametrize('way', WAYS)
def test_w_stays_calibrated_through_a_wrong_start(way):
    """A stream begun under wrong hyper-parameters and ended under the true ones is calibrated.

    Half of it each, 40 streams: 1 up to four standard deviations of sqrt(2 / 3 / 40) = 0.129.
    """
    squares = []
    wrong = _model((2.0,), (0.6,), (0.15,))
    for seed in range(100, 140):
        model, prior, w, data = returning(seed, 600)
        online = way(wrong, prior)
        for i in range(600):
            if i == 300:
                online.change(model=model)
            online.learn(online.predict(data.U[i], data.F[i]), data.y[i])
        information = online.information
        error = information.R @ (information.coefficients - w)
        squares.append(error @ error / 3)
    assert abs(np.mean(squares) - 1.0) < 4 * 0.129


@pytest.mark.parametrize('length', [0.5, 0.2, 1.0])
def test_the_interpolation_error_is_the_variance_of_a_difference(length):
    """Of Z less its interpolation, by the joint covariance of both under the other kernel."""
    model, prior, _, data = returning(0)
    points = _learn(_basis(model, prior), data)._basis.sets[0]
    own, other = points.group.kernel, SquaredExponential(1.3, (length,), (0,))
    B, squares = np.array(points.inputs), []
    for u in data.U:
        K = own.matrix(B) + JITTER * own.variance * np.eye(len(B))
        a = np.linalg.solve(K, own.matrix(B, u[None])[:, 0])
        difference = np.append(-a, 1.0)
        squares.append(difference @ other.matrix(np.vstack([B, u])) @ difference)
    expected = np.mean(squares)
    assert interpolation_error(points, other, data.U) == pytest.approx(expected, abs=1e-7)
    assert (expected > model.noise[0]) == (length == 0.2)


def test_far_shorter_length_scales_learn_z_from_the_kept_samples():
    """The old features say too little of such a Z; W keeps what it learned, none of it twice."""
    model, prior, _, data = returning(1)
    other = _model((1.0,), (0.1,), (0.1,))
    online = _learn(_basis(model, prior), data)
    before = online.information
    online.change(model=other)
    after = online.information
    gone = before.less(_learn(_basis(model, prior), _tail(data)).information)
    kept = _learn(_basis(other, prior), _tail(data)).information
    expected = kept.R.T @ kept.R + gone.R.T @ gone.R
    np.testing.assert_allclose(after.R.T @ after.R, expected, rtol=1e-6)
    u, f = data.U[-5], np.zeros((1, 3))
    fresh = _learn(_basis(other, prior), _tail(data)).predict(u, f)
    assert online.predict(u, f).covariance[0, 0] <= fresh.covariance[0, 0]


def _tail(data):
    return Observations(data.U[-20:], data.F[-20:], data.y[-20:])


@pytest.mark.parametrize('way', WAYS)
def test_outputs_that_come_to_share_a_kernel_are_restored_apart(way):
    """Each keeps inducing points of its own, also in a state that is restored."""
    model = _model((1.0, 2.0), (0.8, 0.7), (0.1, 0.3))
    shared = _model((1.0, 3.0), (0.6, 0.6), (0.1, 0.3))
    data = _spread_out()
    one, other = _learn(way(model, PRIOR), data), way(shared, PRIOR)
    one.change(model=shared)
    other.restore(one.state())
    for online in (one, other):
        _learn(online, data)
    assert len(one._basis.sets) == 2
    for name, array in other.state().items():
        np.testing.assert_array_equal(array, one.state()[name])
