"""Compiled passes over matrices equal plain NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.gp.linear_algebra import (
    exponents_numpy,
    subtract_symmetric,
    subtracted_numpy,
    turn_into_exponents,
)


@pytest.mark.parametrize('shape', [(1, 1), (5, 3), (33, 70)])
def test_exponents_are_those_of_numpy(shape):
    """The same operations on each element: the same bits."""
    rng = np.random.default_rng(0)
    products, a, b = rng.normal(size=shape), rng.random(shape[0]), rng.random(shape[1])
    expected = exponents_numpy(products, a, b)
    turn_into_exponents(products, a, b)
    np.testing.assert_array_equal(products, expected)


@pytest.mark.parametrize('n', [1, 31, 32, 33, 70])
def test_a_symmetric_matrix_is_subtracted_on_both_sides(n):
    """What lies below the diagonal of the second matrix is not read."""
    H, upper = np.random.default_rng(n).normal(size=(2, n, n))
    expected = subtracted_numpy(H, upper)
    subtract_symmetric(H, upper)
    np.testing.assert_array_equal(H, expected)
