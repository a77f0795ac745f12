"""Plane rotations that keep square-root information triangular, compiled, in place.

Equations of unit noise enter a triangular system `R w = z`, or one with features beside W: the
rows `[R S | z]` say `R theta + S W = z` with R (m, m) upper triangular, S (m, p). Outputs with the
same features share R, their `S | z` stand side by side. The plain NumPy versions compute the same
by one QR; the tests hold the two together.

Source: Golub and Van Loan, section 5.1; Bierman 1977, chapter IV.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit
from scipy import linalg

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


@_compiled
def _rotate(A: np.ndarray, i: int, first: int, x: np.ndarray, c: float, s: float) -> None:
    for j in range(first, np.uint64(len(x))):
        above = A[i, j]
        A[i, j] = c * above + s * x[j]
        x[j] = c * x[j] - s * above


@_compiled
def absorb_equation(R: np.ndarray, S: np.ndarray, phi: np.ndarray, rest: np.ndarray) -> None:
    """Add the equation `phi theta + rest[:-1] W = rest[-1]` of unit noise.

    Rotations zero phi (m,) against R; what they leave in `rest` is an equation on W alone, and no
    information is in both. O(m (m / 2 + k p)).

    Args:
        R: (M, M), changed in its leading m x m part.
        S: (M, k (p + 1)), regressors and right sides, changed in its first m rows.
        phi: (m,) of the features in use, used up.
        rest: (k (p + 1),) regressor and value of each output, then what remains of them.
    """
    for i in range(len(phi)):
        if phi[i] == 0.0:
            continue
        radius = np.hypot(R[i, i], phi[i])
        c, s = R[i, i] / radius, phi[i] / radius
        # Unsigned indices: a signed one might count from the end, and the loop would stay scalar.
        _rotate(R, np.uint64(i), np.uint64(i), phi, c, s)
        _rotate(S, np.uint64(i), np.uint64(0), rest, c, s)


@_compiled
def solve_transposed(R: np.ndarray, x: np.ndarray) -> None:
    """Replace x (m,) by R^-T x for the leading m x m part of R, by rows of R. O(m^2 / 2)."""
    for i in range(len(x)):
        x[i] /= R[i, i]
        for j in range(i + 1, len(x)):
            x[j] -= R[i, j] * x[i]


def absorbed_equations_numpy(
    R: np.ndarray, S: np.ndarray, phi: np.ndarray, rest: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return R (m, m), S (m, c) and what is left on W, by one QR, up to rotations of rows.

    Args:
        R: (r, m) before, of any rank.
        S: (r, c) before.
        phi: (q, m) of q equations; `r + q >= m`.
        rest: (q, c) of these.

    Returns:
        R and S after, and equations on W alone, (r + q - m, c) or (c, c).
    """
    m = R.shape[1]
    upper = np.asarray(np.linalg.qr(np.block([[R, S], [phi, rest]]), mode='r'))
    return upper[:m, :m], upper[:m, m:], upper[m:, m:]


def solved_transposed_numpy(R: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return R^-T x, (m,), by the solver of the library."""
    return np.asarray(linalg.solve_triangular(R, x, trans='T'))
