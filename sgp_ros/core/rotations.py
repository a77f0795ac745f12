"""Compiled loops of the growing factor: plane rotations and triangular solves, in place.

Each touches every stored number once and allocates nothing. The plain NumPy versions at the end
of this module compute the same from scratch; the tests hold the two together.

Sources: Gill, Golub, Murray, Saunders 1974 (methods C1, C2); Golub and Van Loan, section 5.1.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit
from scipy import linalg

if TYPE_CHECKING:
    from collections.abc import Callable

_compiled: Callable[[Any], Any] = njit(cache=True, error_model='numpy')


@_compiled
def solve_lower(L: np.ndarray, n: int, x: np.ndarray) -> None:
    """Replace x (n,) by L^-1 x for the leading n x n part of L. O(n^2 / 2)."""
    for i in range(n):
        total = x[i]
        for j in range(i):
            total -= L[i, j] * x[j]
        x[i] = total / L[i, i]


@_compiled
def drop_row(L: np.ndarray, A: np.ndarray, b: np.ndarray, n: int, m: int) -> None:
    """Remove sample m from the factor of n samples, with the same rotations on A and b.

    Afterwards the leading n - 1 rows hold the factor of the others, and row n - 1 of A and b
    holds the whitened row of the removed sample given the others: `p(y_m | y_others, W)`.
    O((n - m)^2 + (n - m) p) operations.

    Args:
        L: (N, N) lower factor in its leading n x n part.
        A: (N, p) whitened regressor.
        b: (N,) whitened observations.
        n: samples held.
        m: sample to remove.
    """
    p = A.shape[1]
    size = n - 1 - m
    cosines = np.empty(size)
    sines = np.empty(size)
    extra = A[m].copy()
    extra_b = b[m]
    for i in range(size):
        source = m + 1 + i
        row = m + i
        carried = L[source, m]
        for j in range(m):
            L[row, j] = L[source, j]
        for j in range(i):
            value = L[source, m + 1 + j]
            L[row, m + j] = cosines[j] * value + sines[j] * carried
            carried = cosines[j] * carried - sines[j] * value
        value = L[source, source]
        radius = np.hypot(value, carried)
        cosine = value / radius
        sine = carried / radius
        cosines[i] = cosine
        sines[i] = sine
        L[row, row] = radius
        for c in range(p):
            value = A[source, c]
            A[row, c] = cosine * value + sine * extra[c]
            extra[c] = cosine * extra[c] - sine * value
        value = b[source]
        b[row] = cosine * value + sine * extra_b
        extra_b = cosine * extra_b - sine * value
    for c in range(p):
        A[n - 1, c] = extra[c]
    b[n - 1] = extra_b


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


def dropped_row_numpy(
    L: np.ndarray, A: np.ndarray, b: np.ndarray, m: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what `drop_row` leaves in L (n-1, n-1), A (n, p), b (n,), from refactorisation."""
    n = len(L)
    order = [*range(m), *range(m + 1, n), m]
    K, F, y = L @ L.T, L @ A, L @ b
    factor = linalg.cholesky(K[np.ix_(order, order)], lower=True)
    white = linalg.solve_triangular(factor, np.column_stack([F, y])[order], lower=True)
    return factor[: n - 1, : n - 1], white[:, :-1], white[:, -1]


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
