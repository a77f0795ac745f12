"""Laws of the triangular system of W; the rotations themselves are in `test_online`."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sgp_ros.gp.rotations import (
    absorb_each,
    absorbed_rows_numpy,
    has_safe_diagonal,
    predict_rows,
    predicted_rows_numpy,
    solve_rows,
    solve_upper,
)


@given(st.integers(0, 10_000), st.integers(1, 8))
def test_compiled_solves_equal_the_library(seed, p):
    """R x = z and X R = rows, by plain substitution."""
    rng = np.random.default_rng(seed)
    R = np.triu(rng.normal(size=(p, p))) + 4.0 * np.eye(p)
    z, rows = rng.normal(size=p), rng.normal(size=(3, p))
    x, X = z.copy(), rows.copy()
    solve_upper(R, x)
    solve_rows(R, X)
    np.testing.assert_allclose(x, np.linalg.solve(R, z), atol=1e-10)
    np.testing.assert_allclose(X, rows @ np.linalg.inv(R), atol=1e-10)


@given(st.integers(0, 10_000), st.integers(1, 4), st.integers(1, 8))
def test_compiled_prediction_equals_the_library(seed, k, p):
    """Mean and covariance of rows of W."""
    rng = np.random.default_rng(seed)
    R = np.triu(rng.normal(size=(p, p))) + 4.0 * np.eye(p)
    w, rows, mean = rng.normal(size=p), rng.normal(size=(k, p)), rng.normal(size=k)
    expected = predicted_rows_numpy(R, w, rows, mean)
    covariance = np.full((k, k), np.nan)
    predict_rows(R, w, rows, mean, covariance)
    np.testing.assert_allclose(mean, expected[0], atol=1e-10)
    np.testing.assert_allclose(covariance, expected[1], atol=1e-10)


@given(st.integers(0, 10_000), st.integers(0, 4), st.integers(0, 5))
def test_each_row_enters_its_own_system(seed, k, p):
    """Systems side by side are what each would be alone."""
    rng = np.random.default_rng(seed)
    R, z, rows = rng.normal(size=(k, p, p)), rng.normal(size=(k, p)), rng.normal(size=(k, p + 1))
    R = np.triu(R)
    expected = [
        absorbed_rows_numpy(R[i], z[i], rows[i : i + 1, :p], rows[i, p:]) for i in range(k)
    ]
    absorb_each(R, z, rows)
    for found, value, (wanted, target) in zip(R, z, expected, strict=True):
        np.testing.assert_allclose(found.T @ found, wanted.T @ wanted, atol=1e-9)
        np.testing.assert_allclose(found.T @ value, wanted.T @ target, atol=1e-9)


@pytest.mark.parametrize(
    ('column', 'is_safe'),
    [
        ([1.0, 2.0, 3.0], True),
        ([1.0, 2.0, 0.0], False),  # nothing of its own
        ([1e13, 0.0, 1.0], False),  # too little of its own
        ([0.0, 0.0, 1e-20], False),  # a zero column beside the others
        ([0.0, 0.0, 1e-9], True),  # small, but in its own unit
    ],
)
def test_a_system_is_safe_where_every_column_brings_something(column, is_safe):
    """The last column decides; zero is 1e-12 of the largest norm, dependent 1e-11 of its own."""
    R = np.array([[1.0, 0.5, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 0.0]])
    R[:, 2] = column
    assert has_safe_diagonal(R, 1e-12, 1e-11) is is_safe
