"""Equations that enter a triangular system by plane rotations, compiled, in place.

The plain NumPy version at the end computes the same by one QR; the tests hold the two together.

Source: Golub and Van Loan, section 5.1.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit

_compiled: Callable[[Any], Any] = njit(cache=True, error_model='numpy')


@_compiled
def absorb_row(R: np.ndarray, z: np.ndarray, row: np.ndarray, value: float) -> None:
    """Add the equation `row w = value` of unit noise to the triangular system `R w = z`.

    R (p, p) upper triangular and z (p,) are updated in place by p rotations, `row` is used up.
    O(p^2).
    """
    p = len(z)
    for i in range(p):
        if row[i] == 0.0:
            continue
        radius = np.hypot(R[i, i], row[i])
        cosine = R[i, i] / radius
        sine = row[i] / radius
        for j in range(i, p):
            above = R[i, j]
            R[i, j] = cosine * above + sine * row[j]
            row[j] = cosine * row[j] - sine * above
        above = z[i]
        z[i] = cosine * above + sine * value
        value = cosine * value - sine * above


@_compiled
def absorb_rows(R: np.ndarray, z: np.ndarray, rows: np.ndarray) -> None:
    """Add equations with their values in the last column of `rows` (r, p + 1), used up. O(r p^2).

    As `absorb_row` for each.
    """
    p = len(z)
    for i in range(len(rows)):
        absorb_row(R, z, rows[i, :p], rows[i, p])


@_compiled
def absorb_each(R: np.ndarray, z: np.ndarray, rows: np.ndarray) -> None:
    """Add row i of `rows` (k, p + 1), used up, to system i of R (k, p, p) and z (k, p).

    As `absorb_row` for each. O(k p^2).
    """
    p = z.shape[1]
    for i in range(len(rows)):
        absorb_row(R[i], z[i], rows[i, :p], rows[i, p])


@_compiled
def has_safe_diagonal(R: np.ndarray, zero: float, rank: float) -> bool:
    """Whether a triangular R (p, p) may be solved with as it is. O(p^2 / 2).

    Args:
        R: upper triangular.
        zero: share of the largest column norm up to which a column counts as zero.
        rank: share of its column's norm that each diagonal element must exceed.
    """
    p = len(R)
    largest = 0.0
    for j in range(p):
        square = 0.0
        for i in range(j + 1):
            square += R[i, j] * R[i, j]
        if not abs(R[j, j]) > rank * np.sqrt(square):
            return False
        largest = max(largest, square)
    for j in range(p):
        square = 0.0
        for i in range(j + 1):
            square += R[i, j] * R[i, j]
        if square <= zero * zero * largest:
            return False
    return True


@_compiled
def solve_upper(R: np.ndarray, x: np.ndarray) -> None:
    """Replace x (p,) by R^-1 x for an upper triangular R (p, p). O(p^2 / 2)."""
    for i in range(len(x) - 1, -1, -1):
        for j in range(i + 1, len(x)):
            x[i] -= R[i, j] * x[j]
        x[i] /= R[i, i]


@_compiled
def solve_rows(R: np.ndarray, rows: np.ndarray) -> None:
    """Replace rows (k, p) by rows R^-1 for an upper triangular R (p, p). O(k p^2 / 2)."""
    for a in range(len(rows)):
        row = rows[a]
        for i in range(len(row)):
            row[i] /= R[i, i]
            for j in range(i + 1, len(row)):
                row[j] -= row[i] * R[i, j]


def absorbed_rows_numpy(
    R: np.ndarray, z: np.ndarray, rows: np.ndarray, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return R (p, p) and z (p,) after all `rows` (r, p) at once, by one QR, up to row signs."""
    p = len(z)
    stacked = np.column_stack([np.vstack([R, rows]), np.concatenate([z, values])])
    triangle = np.zeros((p, p + 1))
    if p:
        upper = np.linalg.qr(stacked, mode='r')[:p]
        triangle[: len(upper)] = upper
    return np.ascontiguousarray(triangle[:, :-1]), triangle[:, -1].copy()
