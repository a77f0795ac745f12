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
_LEAST, _MOST = 1e-280, 1e280


@_compiled
def _rotation(a: float, b: float) -> tuple[float, float]:
    """Return cosine and sine of the rotation that turns (a, b) into (radius, 0)."""
    square = a * a + b * b
    # Squares that leave the range of numbers are the exception, and the only slow case.
    radius = np.sqrt(square) if _LEAST < square < _MOST else np.hypot(a, b)
    return a / radius, b / radius


@_compiled
def _rotate(A: np.ndarray, i: int, first: int, x: np.ndarray, c: float, s: float) -> None:
    for j in range(first, np.uint64(len(x))):
        above = A[i, j]
        A[i, j] = c * above + s * x[j]
        x[j] = c * x[j] - s * above


@_compiled
def absorb_row(R: np.ndarray, z: np.ndarray, row: np.ndarray, value: float) -> None:
    """Add the equation `row w = value` of unit noise to the triangular system `R w = z`.

    R (p, p) upper triangular and z (p,) are updated in place by p rotations, `row` is used up.
    O(p^2).
    """
    for i in range(len(z)):
        if row[i] == 0.0:
            continue
        c, s = _rotation(R[i, i], row[i])
        # Unsigned indices: a signed one might count from the end, and the loop would stay scalar.
        _rotate(R, np.uint64(i), np.uint64(i), row, c, s)
        above = z[i]
        z[i] = c * above + s * value
        value = c * value - s * above


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


@_compiled
def predict_rows(
    R: np.ndarray, w: np.ndarray, rows: np.ndarray, mean: np.ndarray, covariance: np.ndarray
) -> None:
    """Add `rows w` to mean (k,) and set covariance (k, k) to `rows (R^T R)^-1 rows^T`. O(k p^2).

    Args:
        R: (p, p) upper triangular, invertible.
        w: (p,).
        rows: (k, p), used up.
        mean: of what is beside them.
        covariance: any.
    """
    for i in range(len(mean)):
        for j in range(len(w)):
            mean[i] += rows[i, j] * w[j]
    solve_rows(R, rows)
    for i in range(len(mean)):
        for j in range(i + 1):
            total = 0.0
            for c in range(len(w)):
                total += rows[i, c] * rows[j, c]
            covariance[i, j] = covariance[j, i] = total


def predicted_rows_numpy(
    R: np.ndarray, w: np.ndarray, rows: np.ndarray, mean: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and covariance of `predict_rows`, by the solver of the library."""
    spread = np.linalg.solve(R.T, rows.T)
    return mean + rows @ w, spread.T @ spread


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
        c, s = _rotation(R[i, i], phi[i])
        _rotate(R, np.uint64(i), np.uint64(i), phi, c, s)
        _rotate(S, np.uint64(i), np.uint64(0), rest, c, s)


@_compiled
def absorb_sample(
    R: np.ndarray, S: np.ndarray, data_R: np.ndarray, data_S: np.ndarray,
    residual_R: np.ndarray, residual_z: np.ndarray,
    v: np.ndarray, data: np.ndarray, scales: np.ndarray, weight: float,
    phi: np.ndarray, rest: np.ndarray, alone: np.ndarray,
) -> None:  # fmt: skip
    """Add a sample to the systems of `InducingPoints` with the prior and without. O(m^2 + m k p).

    Args:
        R: (M, M) of the system with the prior of the weights, as of `absorb_equation`.
        S: (M, k (p + 1)) of it.
        data_R: (M, M) of the system of the data alone.
        data_S: (M, k (p + 1)) of it.
        residual_R: (k, p, p) what that leaves on W, by output.
        residual_z: (k, p) of it.
        v: (m,) features.
        data: (k, p + 1) regressors and observations.
        scales: (k,) of the outputs.
        weight: of the equation, one over the deviation of its noise.
        phi: (m,) at least, for rotations.
        rest: (k, p + 1), becomes what the system with the prior leaves on W.
        alone: (k, p + 1), as phi.
    """
    m, width = len(v), data.shape[1]
    for j in range(len(scales)):
        for c in range(width):
            rest[j, c] = alone[j, c] = weight / scales[j] * data[j, c]
    for i in range(m):
        phi[i] = weight * v[i]
    absorb_equation(R, S, phi[:m], rest.reshape(-1))
    for i in range(m):
        phi[i] = weight * v[i]
    absorb_equation(data_R, data_S, phi[:m], alone.reshape(-1))
    absorb_each(residual_R, residual_z, alone)


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
