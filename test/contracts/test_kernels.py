"""What every registered kernel promises."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sgp_ros.gp.kernels import KERNELS

NAMES = sorted(KERNELS)


def _kernel(name, seed):
    rng = np.random.default_rng(seed)
    lengths = tuple(float(x) for x in rng.uniform(0.3, 3.0, size=2))
    heights = tuple(float(x) for x in rng.uniform(0.2, 5.0, size=2))
    return _build(name, heights, lengths, (0, 2))


def _build(name, heights, lengths, inputs):
    if name == 'linear':
        return KERNELS[name](lengths, inputs)
    if name == 'squared_exponential':
        return KERNELS[name](heights[0], lengths, inputs)
    return KERNELS[name](heights, lengths, inputs)


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
    for lengths, inputs in (((1.0,), (0, 1)), ((0.0,), (0,)), ((), ())):
        with pytest.raises(ValueError, match='length scales'):
            _build(name, (1.0,), lengths, inputs)


@pytest.mark.parametrize('name', NAMES)
def test_inputs_can_be_left_out_and_length_scales_changed(name):
    """Without an input, the kernel is that of the others."""
    kernel = _kernel(name, 6)
    shorter = kernel.without(0)
    assert shorter.inputs == kernel.inputs[1:]
    assert shorter.lengthscales == kernel.lengthscales[1:]
    assert kernel.with_lengthscales((1.0, 2.0)).lengthscales == (1.0, 2.0)


@pytest.mark.parametrize('name', [name for name in NAMES if name != 'linear'])
def test_stationary_kernels_have_one_variance_and_refuse_zero(name):
    """The same everywhere; without variance there is no process."""
    kernel = _kernel(name, 7)
    U = np.random.default_rng(7).normal(size=(4, 3))
    np.testing.assert_allclose(kernel.diagonal(U), kernel.variance)
    with pytest.raises(ValueError, match='length scales'):
        _build(name, (0.0,), (1.0,), (0,))


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
