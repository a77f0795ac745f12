"""Laws of hyper-parameter learning and of the four methods."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.errors import NumericalError
from sgp_ros.gp.kernels import SquaredExponential
from sgp_ros.gp.learning import initial_model, learn
from sgp_ros.gp.methods import METHODS, FitOptions
from sgp_ros.gp.model import CoefficientPrior, Model, Observations
from sgp_ros.gp.posterior import Posterior
from sgp_ros.gp.scores import RunningScore, coverage95, nlpd, nmse, pit
from test.gp.worlds import random_problem


def _pendulum(seed, n=80):
    """Toy pendulum of section I.A: w sin(theta) with a bump, dense right, sparse left."""
    rng = np.random.default_rng(seed)
    theta = np.concatenate([rng.uniform(0, np.pi, size=n), rng.uniform(-2, 0, size=5)])
    truth = 9.81 * np.sin(theta) - 6.0 * ((theta > 2.0) & (theta < 2.5))
    y = truth + 0.3 * rng.normal(size=len(theta))
    return Observations(theta[:, None], np.sin(theta)[:, None, None], y[:, None])


@pytest.mark.parametrize('name', sorted(METHODS))
@pytest.mark.parametrize('rule', ['paper', 'standardised'])
def test_every_method_fits_and_predicts(name, rule):
    """One interface: mean (q, k), covariance (q, k, k), finite and positive."""
    data = _pendulum(0)
    fitted = METHODS[name](data, CoefficientPrior.flat(1), ((0,),), FitOptions(rule))
    U = np.linspace(-2, 3, 9)[:, None]
    prediction = fitted.predict_observed(U, np.sin(U)[:, :, None])
    assert prediction.mean.shape == (9, 1)
    assert prediction.covariance.shape == (9, 1, 1)
    assert np.all(prediction.variance > 0.0)
    assert np.isfinite(fitted.log_evidence)
    assert len(fitted.coefficients) == (0 if name == 'GP' else 1)


def test_methods_order_as_in_the_paper():
    """Section IV.A, medians of eight seeds: SGP beats PR where data are dense, GP where sparse.

    The two-step baseline is no better than SGP anywhere. Margins: the dense gap is a factor of
    ten (0.41 against 0.03), a half is asked; the others are orderings.
    """
    dense, sparse = np.linspace(0.05, 3.1, 50)[:, None], np.linspace(-1.9, -0.2, 50)[:, None]
    errors = {}
    for seed in range(8):
        data = _pendulum(seed)
        for name, method in METHODS.items():
            fitted = method(data, CoefficientPrior.flat(1), ((0,),), FitOptions())
            for region, U in (('dense', dense), ('sparse', sparse)):
                truth = 9.81 * np.sin(U) - 6.0 * ((U > 2.0) & (U < 2.5))
                mean = fitted.predict(U, np.sin(U)[:, :, None]).mean
                errors.setdefault((name, region), []).append(nmse(truth, mean)[0])
    error = {key: np.median(values) for key, values in errors.items()}
    assert error['SGP', 'dense'] < 0.5 * error['PR', 'dense']
    assert error['SGP', 'sparse'] < error['GP', 'sparse']
    assert error['SGP', 'sparse'] < error['PRGP', 'sparse']
    assert error['SGP', 'dense'] < 1.15 * error['PRGP', 'dense']


def test_two_steps_are_physics_then_process():
    """PRGP's coefficients are those of PR, its mean the sum of both stages."""
    data = _pendulum(2)
    prior = CoefficientPrior.flat(1)
    pr = METHODS['PR'](data, prior, ((0,),), FitOptions())
    prgp = METHODS['PRGP'](data, prior, ((0,),), FitOptions())
    np.testing.assert_array_equal(prgp.coefficients, pr.coefficients)
    U = np.linspace(0, 3, 5)[:, None]
    F = np.sin(U)[:, :, None]
    assert prgp.process is not None
    expected = pr.predict(U, F).mean + prgp.process.predict(U, F[:, :, :0]).mean
    np.testing.assert_allclose(prgp.predict(U, F).mean, expected)


def test_methods_take_an_observation_matrix():
    """With Y = g X, the two-step residual is taken in the space of Y."""
    _, data = random_problem(3, n=30, k=2, p=2, gain=2)
    for name, method in METHODS.items():
        fitted = method(data, CoefficientPrior.flat(2), ((0,), (1,)), FitOptions())
        assert fitted.predict_observed(data.U, data.F, data.G).mean.shape == (30, 2), name


def test_parametric_regression_is_equation_25():
    """With mu = 0, sigma_w = I and unit noise, W is the ridge solution of the paper."""
    _, data = random_problem(4, n=20, k=1)
    model = Model((None,), (1.0,))
    prior = CoefficientPrior.from_covariance(np.zeros(3), np.eye(3))
    F, y = data.F[:, 0], data.y[:, 0]
    expected = np.linalg.solve(F.T @ F + np.eye(3), F.T @ y)
    np.testing.assert_allclose(Posterior(model, data, prior).coefficients, expected)


def test_learning_recovers_planted_hyperparameters():
    """Evidence at the optimum is at least that of the truth; the noise is found.

    400 samples: the standard deviation of the noise variance is sqrt(2 / 400) = 7 %.
    """
    rng = np.random.default_rng(5)
    truth = Model((SquaredExponential(2.0, (0.7,), (0,)),), (0.1,))
    U = rng.uniform(-4, 4, size=(400, 1))
    C = truth.kernels[0].matrix(U) + 0.1 * np.eye(400)
    y = np.linalg.cholesky(C) @ rng.normal(size=400)
    data = Observations(U, np.ones((400, 1, 1)), y[:, None])
    prior = CoefficientPrior.flat(1)
    for rule in ('paper', 'standardised'):
        learned = learn(data, prior, initial_model(data, ((0,),), rule))
        assert learned.log_evidence >= Posterior(truth, data, prior).log_evidence
        assert learned.model.noise[0] == pytest.approx(0.1, rel=4 * 0.07)


def test_a_fit_that_starts_from_another_one_ends_sooner(monkeypatch):
    """Of like data: no other starts are looked at, and the evidence is as high to a tolerance."""
    _, data = random_problem(seed=4, n=60)
    inputs, prior = ((0, 1),) * data.F.shape[1], CoefficientPrior.flat(data.F.shape[2])
    first = METHODS['SGP'](data, prior, inputs, FitOptions())
    counted = []
    monkeypatch.setattr(
        'sgp_ros.gp.methods.learn',
        lambda *a, **k: counted.append(found := learn(*a, **k)) or found,
    )
    monkeypatch.setattr('sgp_ros.gp.methods.screened', None)
    METHODS['SGP'](data, prior, inputs, FitOptions(start=first.model, tolerance=1e-6))
    assert counted[0].evaluations < 10
    assert counted[0].log_evidence > first.log_evidence - 1e-3


def test_learning_starts_from_the_values_of_the_paper():
    """sigma_z = var y, sigma_v = var y / 100, l = var u; or the unit-free standard deviation."""
    _, data = random_problem(6, n=30)
    model = initial_model(data, ((0, 1), None), 'paper')
    variance = data.U.var(axis=0)
    assert model.kernels[0].lengthscales == pytest.approx(tuple(variance[:2]))
    assert model.kernels[0].variance == pytest.approx(data.y[:, 0].var())
    assert model.noise == pytest.approx(tuple(data.y.var(axis=0) / 100))
    assert model.kernels[1] is None
    other = initial_model(data, ((0, 1), None))
    assert other.kernels[0].lengthscales == pytest.approx(tuple(np.sqrt(variance[:2])))
    with pytest.raises(ValueError, match='rule'):
        initial_model(data, ((0,),), 'guess')


def test_restarts_never_lower_the_evidence():
    """The first start is always among them; restarts need a generator."""
    data = _pendulum(7, n=30)
    prior = CoefficientPrior.flat(1)
    start = initial_model(data, ((0,),))
    one = learn(data, prior, start)
    more = learn(data, prior, start, 3, np.random.default_rng(0))
    assert more.log_evidence >= one.log_evidence
    assert more.evaluations > one.evaluations
    with pytest.raises(ValueError, match='generator'):
        learn(data, prior, start, 1)


@pytest.mark.parametrize('seed', range(3))
def test_a_trial_without_factor_does_not_end_the_search(seed):
    """Far from the origin distances are rounded, so a corner of the box has no factor there.

    The evidence does not depend on the origin, so both searches must find the same.
    """
    rng = np.random.default_rng(seed)
    u = np.round(rng.uniform(-3.0, 3.0, (100, 1)), 1)
    y = np.sin(u) + 0.05 * rng.standard_normal((100, 1))
    start = Model((SquaredExponential(1.0, (1.0,), (0,)),), (1.0,))
    near, far = (
        learn(Observations(u + origin, np.zeros((100, 1, 0)), y), CoefficientPrior.flat(0), start)
        for origin in (0.0, 1e5)
    )
    assert far.refused > 0
    assert far.log_evidence == pytest.approx(near.log_evidence, abs=0.1)


def test_a_fit_without_any_factor_raises(monkeypatch):
    """Where no start has a positive definite covariance, the error says what to look at."""
    data = Observations(np.zeros((6, 1)), np.zeros((6, 1, 0)), np.zeros((6, 1)))
    start = Model((SquaredExponential(1.0, (1.0,), (0,)),), (1e-300,))
    monkeypatch.setattr('sgp_ros.gp.learning._NOISE_FLOOR', 1e-300)
    with pytest.raises(NumericalError, match='no positive definite'):
        learn(data, CoefficientPrior.flat(0), start)


def test_running_scores_equal_batch_scores():
    """One sample at a time gives the scores of all at once."""
    rng = np.random.default_rng(8)
    y, mean = rng.normal(size=(50, 1)), rng.normal(size=(50, 1))
    variance = rng.uniform(0.5, 2.0, size=(50, 1))
    running = RunningScore()
    assert np.isnan(running.nmse)
    assert np.isnan(running.nlpd)
    assert np.isnan(running.coverage95)
    for a, b, c in zip(y[:, 0], mean[:, 0], variance[:, 0], strict=True):
        running.add(a, b, c, 4.0 * c)
    assert running.nmse == pytest.approx(nmse(y, mean)[0])
    assert running.nlpd == pytest.approx(nlpd(y, mean, variance)[0])
    assert running.coverage95 == coverage95(y, mean, variance)[0]
    assert running.raw_coverage95 == coverage95(y, mean, 4.0 * variance)[0]


def test_scores_of_the_true_density_are_calibrated():
    """Coverage is 95 % and the PIT uniform within four standard errors of 4000 draws."""
    rng = np.random.default_rng(9)
    variance = rng.uniform(0.5, 2.0, size=(4000, 1))
    y = np.sqrt(variance) * rng.normal(size=(4000, 1))
    zero = np.zeros_like(y)
    assert abs(coverage95(y, zero, variance)[0] - 0.95) < 4 * np.sqrt(0.95 * 0.05 / 4000)
    assert abs(pit(y, zero, variance).mean() - 0.5) < 4 / np.sqrt(12 * 4000)


def test_a_process_alone_learns_each_component_by_itself():
    """Put together, the parts are the model of all: its evidence is the sum of theirs.

    A component ten times as large has a hundred times the noise and n log 10 nats less.
    """
    one, other = _pendulum(4), _pendulum(5)
    y = np.hstack([one.y, 10.0 * other.y])
    data = Observations(one.U, np.zeros((len(y), 2, 0)), y)
    none = CoefficientPrior.flat(0)
    fitted = METHODS['GP'](data, none, ((0,), (0,)), FitOptions())
    whole = Posterior(fitted.model, data, none)
    assert fitted.log_evidence == pytest.approx(whole.log_evidence, rel=1e-12)
    same = METHODS['GP'](replace(data, y=y / [1.0, 10.0]), none, ((0,), (0,)), FitOptions())
    assert fitted.model.noise[1] == pytest.approx(100.0 * same.model.noise[1], rel=1e-3)
    loss = same.log_evidence - fitted.log_evidence
    assert loss == pytest.approx(len(y) * np.log(10.0), rel=1e-6)
