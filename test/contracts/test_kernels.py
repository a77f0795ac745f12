"""Contract of every registered kernel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sgp_ros.gp.inducing_regression import InducingPointRegression
from sgp_ros.gp.kernels import KERNELS
from sgp_ros.gp.learning import initial_model, learn
from sgp_ros.gp.model import CoefficientPrior, Model, Observations
from sgp_ros.gp.online import OnlineRegression
from sgp_ros.gp.posterior import Posterior
from sgp_ros.gp.regression import Memory

NAMES = sorted(KERNELS)


def _kernel(name, seed, inputs=(0, 2)):
    rng = np.random.default_rng(seed)
    kind = KERNELS[name]
    size = len(kind.scales(1.0, np.ones(len(inputs))))
    return kind.of_values(rng.uniform(0.3, 3.0, size=size), inputs)


def _stream(kernel, n, seed=5):
    """Return a model with this kernel, and n samples of `Y = W + Z + V` drawn from it."""
    rng = np.random.default_rng(seed)
    U = rng.uniform(-2.0, 2.0, size=(n, 3))
    values, vectors = np.linalg.eigh(kernel.matrix(U))
    z = vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.standard_normal(n))
    y = 0.5 + z + np.sqrt(0.05) * rng.standard_normal(n)
    return Model((kernel,), (0.05,)), Observations(U, np.ones((n, 1, 1)), y[:, None])


@pytest.mark.parametrize('name', NAMES)
@given(seed=st.integers(0, 10_000))
def test_matrix_is_symmetric_and_positive_semidefinite(name, seed):
    """Eigenvalues are not below rounding, n eps times the largest."""
    U = np.random.default_rng(seed).normal(size=(9, 3))
    K = _kernel(name, seed).matrix(U)
    np.testing.assert_allclose(K, K.T, atol=1e-15)
    values = np.linalg.eigvalsh(K)
    assert values[0] > -9 * np.finfo(float).eps * values[-1]


@pytest.mark.parametrize('name', NAMES)
def test_vector_matrix_and_diagonal_agree(name):
    """Three ways to the same covariances."""
    kernel = _kernel(name, 1)
    U = np.random.default_rng(1).normal(size=(6, 3))
    K = kernel.matrix(U)
    np.testing.assert_allclose(np.diag(K), kernel.diagonal(U))
    np.testing.assert_allclose(kernel.matrix(U, U[2:4]), K[:, 2:4], atol=1e-14)
    S = kernel.scale(U)
    np.testing.assert_allclose(kernel.vector(S, S[3]), K[:, 3], atol=1e-14)


@pytest.mark.parametrize('name', NAMES)
def test_kernel_sees_only_its_inputs(name):
    """Other columns of U do not matter."""
    kernel = _kernel(name, 2)
    U = np.random.default_rng(2).normal(size=(5, 3))
    other = U.copy()
    other[:, 1] += 7.0
    np.testing.assert_array_equal(kernel.matrix(U), kernel.matrix(other))


@pytest.mark.parametrize('name', NAMES)
def test_gradient_contracts_the_derivative_of_the_matrix(name):
    """Against central differences of sum(H * K)."""
    kernel = _kernel(name, 3)
    rng = np.random.default_rng(3)
    U, H = rng.normal(size=(7, 3)), rng.normal(size=(7, 7))
    H = H + H.T
    theta = kernel.log_parameters
    gradient = kernel.gradient(U, H)
    for i in range(len(theta)):
        step = 1e-6 * np.eye(len(theta))[i]
        high = (H * kernel.with_log_parameters(theta + step).matrix(U)).sum()
        low = (H * kernel.with_log_parameters(theta - step).matrix(U)).sum()
        assert gradient[i] == pytest.approx((high - low) / 2e-6, abs=1e-6)


@pytest.mark.parametrize('name', NAMES)
def test_parameters_round_trip(name):
    """Logarithms lead back to the same kernel, up to rounding of exp and log."""
    kernel = _kernel(name, 4)
    again = kernel.with_log_parameters(kernel.log_parameters)
    np.testing.assert_allclose(again.log_parameters, kernel.log_parameters, rtol=1e-14)


@pytest.mark.parametrize('name', NAMES)
def test_what_is_no_kernel_is_refused(name):
    """Lengths that do not match the inputs, or are not positive, are a caller's mistake."""
    kernel = _kernel(name, 5)
    for changes in (
        {'inputs': (0,)},
        {'lengthscales': (1.0,)},
        {'lengthscales': (), 'inputs': ()},
    ):
        with pytest.raises(ValueError, match='length scales'):
            replace(kernel, **changes)
    for parameter in kernel.parameters:
        nothing = (0.0, 1.0) if parameter.is_per_input else 0.0
        with pytest.raises(ValueError, match='must be positive'):
            replace(kernel, **{parameter.name: nothing})


@pytest.mark.parametrize('name', NAMES)
def test_values_lead_back_to_the_same_kernel(name):
    """Bit for bit, as a saved model needs; each says what it is and how it is searched for."""
    kernel = _kernel(name, 4)
    assert type(kernel).of_values(kernel.values, kernel.inputs) == kernel
    assert kernel.name == name
    assert kernel.variance > 0.0
    assert len(kernel.values) == len(kernel.is_variance)
    for parameter in kernel.parameters:
        assert parameter.description
        assert min(parameter.below, parameter.above) > 1.0


@pytest.mark.parametrize('name', NAMES)
@pytest.mark.parametrize('factor', [1e-3, 1e3])
def test_typical_values_follow_the_units(name, factor):
    """Z in other units is the same process: the covariances of the start scale with its square."""
    kind, spread = KERNELS[name], np.array([0.3, 4.0])
    U = np.random.default_rng(4).normal(size=(5, 2)) * spread
    small = kind.of_values(kind.scales(2.0, spread), (0, 1)).matrix(U)
    large = kind.of_values(kind.scales(2.0 * factor**2, spread), (0, 1)).matrix(U)
    np.testing.assert_allclose(large, factor**2 * small, rtol=1e-12)


@pytest.mark.parametrize('name', NAMES)
def test_learning_raises_the_evidence(name):
    """From typical values, over those, and close to the parameters that drew the data."""
    kernel = _kernel(name, 9)
    truth, data = _stream(kernel, 60)
    prior = CoefficientPrior.from_std(np.zeros(1), np.ones(1))
    start = initial_model(data, (kernel.inputs,), kernel=type(kernel))
    learned = learn(data, prior, start, 4, np.random.default_rng(1))
    assert type(learned.model.kernels[0]) is type(kernel)
    assert learned.log_evidence > Posterior(start, data, prior).log_evidence
    assert learned.log_evidence > Posterior(truth, data, prior).log_evidence - 1e-6


@pytest.mark.parametrize('name', NAMES)
def test_inducing_points_hold_every_kernel(name):
    """With as many inducing points as inputs, W and Z are those of the batch."""
    model, data = _stream(_kernel(name, 10), 30)
    prior = CoefficientPrior.from_std(np.zeros(1), np.ones(1))
    online = InducingPointRegression(model, prior, Memory(10, 60))
    online.learn_all(data)
    batch = Posterior(model, data, prior)
    u, f = np.array([0.1, -0.4, 0.7]), np.ones((1, 1))
    wanted, found = batch.predict(u[None], f[None]), online.predict(u, f)
    np.testing.assert_allclose(found.mean, wanted.mean[0], rtol=0.01, atol=0.01)
    np.testing.assert_allclose(found.covariance, wanted.covariance[0], rtol=0.05)
    np.testing.assert_allclose(online.information.coefficients, batch.coefficients, atol=0.02)


@pytest.mark.parametrize('name', NAMES)
def test_a_buffer_changes_hyperparameters_of_every_kernel(name):
    """Under others it is as if it had been filled under these."""
    model, data = _stream(_kernel(name, 11), 25)
    other = Model((_kernel(name, 12),), (0.2,))
    prior = CoefficientPrior.from_std(np.zeros(1), np.ones(1))
    changed, fresh = (
        OnlineRegression(model, prior, Memory(40)),
        OnlineRegression(other, prior, Memory(40)),
    )
    for online in (changed, fresh):
        online.learn_all(data)
    changed.change(other)
    u, f = np.array([0.1, -0.4, 0.7]), np.ones((1, 1))
    np.testing.assert_allclose(changed.predict(u, f).mean, fresh.predict(u, f).mean, rtol=1e-9)


@pytest.mark.parametrize('name', NAMES)
def test_inputs_can_be_left_out_and_length_scales_changed(name):
    """Without an input, the kernel is that of the others."""
    kernel = _kernel(name, 6)
    shorter = kernel.without(0)
    assert shorter.inputs == kernel.inputs[1:]
    assert shorter.lengthscales == kernel.lengthscales[1:]
    assert kernel.with_lengthscales((1.0, 2.0)).lengthscales == (1.0, 2.0)


@pytest.mark.parametrize('name', [name for name in NAMES if name != 'linear'])
def test_stationary_kernels_have_one_variance(name):
    """The same everywhere."""
    kernel = _kernel(name, 7)
    U = np.random.default_rng(7).normal(size=(4, 3))
    np.testing.assert_allclose(kernel.diagonal(U), kernel.variance)


def test_linear_kernel_is_that_of_random_slopes():
    """`Z = a u_0 / l_0 + b u_2 / l_2` with standard normal a, b: one unit a length scale away."""
    kernel = _kernel('linear', 8)
    rng = np.random.default_rng(8)
    U = rng.normal(size=(5, 3))
    slopes = rng.standard_normal((20_000, 2)) / np.array(kernel.lengthscales)
    Z = slopes @ U[:, [0, 2]].T
    spread = np.sqrt(np.outer(kernel.diagonal(U), kernel.diagonal(U)))
    np.testing.assert_allclose((Z.T @ Z / 20_000 - kernel.matrix(U)) / spread, 0.0, atol=0.04)
    assert kernel.variance == kernel.diagonal(np.array([[kernel.lengthscales[0], 9.0, 0.0]]))[0]


@pytest.mark.parametrize('name', [name for name in NAMES if name != 'linear'])
def test_stationary_kernels_end_far_away(name):
    """At any distance, also one whose square overflows, the covariance is a number: zero."""
    kernel = _kernel(name, 13)
    with np.errstate(over='ignore'):
        for distance in (1e3, 1e9, 1e200):
            s = np.array([[0.0, 0.0], [distance, distance]])
            np.testing.assert_allclose(kernel.vector(s, s[0])[1], 0.0, atol=1e-300)
