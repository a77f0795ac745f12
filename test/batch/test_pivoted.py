"""Laws of the pivoted basis of a kernel."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sgp_ros.batch.posterior import pivoted_basis
from sgp_ros.gp.kernels import AdditiveSquaredExponential, SquaredExponential

KERNELS = [
    SquaredExponential(2.0, (0.5, 1.5), (0, 1)),
    AdditiveSquaredExponential((2.0, 0.5), (0.5, 1.5), (0, 1)),
]


@pytest.mark.parametrize('kernel', KERNELS, ids=lambda k: type(k).__name__)
@settings(max_examples=20)
@given(seed=st.integers(0, 10_000))
def test_what_the_basis_leaves_out_is_below_the_tolerance(kernel, seed):
    """At the samples and for every pair of them: the remainder is positive semidefinite."""
    U = np.random.default_rng(seed).normal(size=(60, 2))
    basis = pivoted_basis(kernel, U, 1e-4, 60)
    phi = basis.rows(U)
    difference = kernel.matrix(U) - phi @ phi.T
    assert np.abs(difference).max() < 1.1e-4
    assert basis.remainder(U, phi) == pytest.approx(np.diag(difference), abs=1e-8)
    assert np.linalg.eigvalsh(difference).min() > -1e-8


def test_a_smooth_process_needs_few_functions():
    """Thousands of samples along one input stand on a dozen pivots."""
    U = np.linspace(-1, 1, 3000)[:, None]
    basis = pivoted_basis(SquaredExponential(1.0, (0.5,), (0,)), U, 1e-4, 600)
    assert len(basis.pivots) < 15


def test_the_limit_holds_and_the_remainder_says_what_is_missing():
    """A short length scale is not pretended to be covered."""
    U = np.linspace(-1, 1, 500)[:, None]
    basis = pivoted_basis(SquaredExponential(1.0, (0.01,), (0,)), U, 1e-4, 10)
    assert len(basis.pivots) == 10
    assert basis.remainder(U, basis.rows(U)).max() > 0.9


def test_repeated_samples_take_no_second_pivot():
    """The kernel among the pivots stays positive definite."""
    U = np.zeros((20, 1))
    basis = pivoted_basis(SquaredExponential(1.0, (0.5,), (0,)), U, 1e-12, 20)
    assert len(basis.pivots) == 1
