"""Laws of information on W that is taken from other information."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sgp_ros.gp.information import Information


@given(st.integers(0, 10_000), st.integers(0, 6), st.integers(1, 6))
def test_what_is_added_comes_out_again(seed, before, added):
    """The difference of two states is what came between, of any rank and in any units."""
    rng = np.random.default_rng(seed)
    units = 10.0 ** rng.uniform(-3.0, 3.0, size=4)
    A, b = rng.normal(size=(before + added, 4)) * units, rng.normal(size=before + added)
    part = Information.nothing(4).with_rows(A[:before], b[:before])
    found = part.with_rows(A[before:], b[before:]).less(part)
    expected = A[before:].T @ A[before:] / np.outer(units, units)
    np.testing.assert_allclose(found.R.T @ found.R / np.outer(units, units), expected, atol=1e-7)
    np.testing.assert_allclose(
        found.R.T @ found.z / units, A[before:].T @ b[before:] / units, atol=1e-6
    )


def test_a_difference_never_takes_anything_away():
    """Where the other state knows more of a direction, rounding or not, nothing is returned."""
    whole = Information(np.diag([2.0, 1.0]), np.array([1.0, 1.0]))
    other = Information(np.diag([1.0, 1.5]), np.array([0.0, 3.0]))
    found = whole.less(other)
    np.testing.assert_allclose(found.R.T @ found.R, np.diag([3.0, 0.0]), atol=1e-12)
    np.testing.assert_allclose(found.R.T @ found.z, [2.0, 0.0], atol=1e-12)


def test_without_coefficients_there_is_no_difference():
    """GP is the case p = 0."""
    assert Information.nothing(0).less(Information.nothing(0)).R.shape == (0, 0)


@pytest.mark.parametrize('seed', range(5))
def test_without_full_rank_the_shortest_solution_counts(seed):
    """As the pseudo-inverse of the scaled columns, which nothing but its cost speaks against."""
    rng = np.random.default_rng(seed)
    p, rank = 9, 4 + seed % 3
    rows = rng.normal(size=(40, rank)) @ rng.normal(size=(rank, p)) * 10.0 ** rng.uniform(-3, 3, p)
    rows[:, 2] = 0.0
    y = rng.normal(size=40)
    found = Information.nothing(p).with_rows(rows, y)
    scale = np.linalg.norm(rows, axis=0)
    scale[2] = 1.0
    inverse = np.linalg.pinv(rows / scale, rcond=1e-9)
    np.testing.assert_allclose(found.coefficients * scale, inverse @ y, rtol=1e-8, atol=1e-10)
    expected = inverse @ inverse.T
    np.testing.assert_allclose(
        found.covariance * np.outer(scale, scale), expected, atol=1e-9 * expected.max()
    )
    within, outside = rows[:2], np.eye(p)[:2] * scale
    assert found.is_determined(within).all()
    assert not found.is_determined(outside).any()
    assert not found.is_identifiable[2]
