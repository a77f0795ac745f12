"""Laws of the choice of inputs by evidence."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.errors import NumericalError
from sgp_ros.gp.kernels import Linear, SquaredExponential
from sgp_ros.gp.learning import learn
from sgp_ros.gp.model import CoefficientPrior, Model, Observations
from sgp_ros.gp.selection import _fit, select_inputs


def _data(seed, residual, n=150):
    rng = np.random.default_rng(seed)
    U = rng.normal(size=(n, 3))
    y = 2.0 * U[:, 0] + residual(U) + 0.1 * rng.normal(size=n)
    return Observations(U, U[:, None, :1], y[:, None])


@pytest.mark.parametrize(
    ('residual', 'expected'),
    [
        (lambda U: np.sin(2.0 * U[:, 1]), (1,)),
        (lambda U: U[:, 1] * U[:, 2], (1, 2)),
        (lambda U: 0.5 * np.abs(U[:, 2]), (2,)),
    ],
)
def test_inputs_of_a_planted_residual_are_chosen(residual, expected):
    """Also where two inputs matter only together, which adding one by one would miss."""
    selection = select_inputs(_data(0, residual), CoefficientPrior.flat(1), 0, (0, 1, 2))
    assert selection.inputs == expected
    assert set(selection.path) | set(expected) == {0, 1, 2}


@pytest.mark.parametrize('seed', range(5))
def test_a_linear_residual_is_taken_for_linear(seed):
    """And so extrapolated without the constant that a smooth process would leave free."""
    data = _data(seed, lambda U: 0.7 * U[:, 2])
    selection = select_inputs(data, CoefficientPrior.flat(1), 0, (0, 1, 2))
    assert isinstance(selection.kernel, Linear)
    assert selection.inputs == (2,)


@pytest.mark.parametrize('seed', range(5))
def test_a_curved_residual_is_not(seed):
    """A constant or a bend is nothing that a line through the origin can follow."""
    data = _data(seed, lambda U: 0.5 * np.tanh(2.0 * U[:, 2]))
    selection = select_inputs(data, CoefficientPrior.flat(1), 0, (0, 1, 2))
    assert isinstance(selection.kernel, SquaredExponential)


def test_complete_physics_needs_no_process():
    """Ten worlds without residual: at most one false choice.

    An input is kept for three nats, which noise alone reaches in less than 2 % of the cases.
    """
    chosen = [
        select_inputs(_data(seed, lambda U: 0.0), CoefficientPrior.flat(1), 0, (0, 1, 2)).inputs
        for seed in range(10)
    ]
    assert sum(inputs is not None for inputs in chosen) <= 1


def test_choice_costs_little_evidence():
    """Each dropped input was worth less than the margin."""
    data = _data(1, lambda U: np.sin(2.0 * U[:, 1]))
    selection = select_inputs(data, CoefficientPrior.flat(1), 0, (0, 1, 2))
    assert selection.evidence > selection.evidence_of_all - 3.0 * len(selection.path)


def test_a_start_whose_covariance_has_no_factor_begins_with_more_noise():
    """Rounding of a short length scale counts more there than the noise beside other inputs."""
    rng = np.random.default_rng(3)
    U = np.repeat(rng.normal(30.0, 3.0, (40, 1)), 5, axis=0)
    U = U + 1e-8 * rng.normal(size=U.shape)
    y = 10.0 * np.sin(2.0 * U) + rng.normal(size=U.shape)
    data, prior = Observations(U, U[:, None, :0], y), CoefficientPrior.flat(0)
    start = Model((SquaredExponential(150.0, (3e-4,), (0,)),), (1e-6,))
    with pytest.raises(NumericalError, match='no positive definite'):
        learn(data, prior, start)
    model, evidence = _fit(data, prior, start)
    assert np.isfinite(evidence)
    assert model.noise[0] > 0.1


def test_an_observation_matrix_is_refused():
    """A component seen only in sums has no evidence of its own."""
    data = _data(2, lambda U: 0.0)
    mixed = Observations(data.U, data.F, data.y, np.ones((150, 1, 1)))
    with pytest.raises(ValueError, match='directly'):
        select_inputs(mixed, CoefficientPrior.flat(1), 0, (0,))
