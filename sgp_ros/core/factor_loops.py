"""Compiled loops of the growing factor: triangular solve and plane rotations, in place.

The factor `K = L L^T` is stored column by column: row j of U is column j of L from its diagonal
on, contiguous. A column is then all that one step of a solve or of a rotation needs, and every
element of it takes the same operations in the same order, so the loops run at the width of the
processor and give the same bits at any width, alignment or place in memory. Two or four columns
are taken at once, so that the vector they act on is read and written less often. The live part is
`U[start:stop, start:stop]`; when the oldest sample leaves, `start` moves on and nothing is copied.

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
def _take_one(x0: float, u0: np.ndarray, x: np.ndarray) -> None:
    for i in range(len(x)):
        x[i] -= x0 * u0[i]


@_compiled
def _take_four(
    x0: float, x1: float, x2: float, x3: float,
    u0: np.ndarray, u1: np.ndarray, u2: np.ndarray, u3: np.ndarray, x: np.ndarray,
) -> None:  # fmt: skip
    for i in range(len(x)):
        x[i] = x[i] - x0 * u0[i] - x1 * u1[i] - x2 * u2[i] - x3 * u3[i]


@_compiled
def solve_lower(U: np.ndarray, start: int, x: np.ndarray) -> None:
    """Replace x (n,) by L^-1 x for the n x n factor that begins at `start`. O(n^2 / 2).

    Args:
        U: (N, N), row j holds column j of L from its diagonal on.
        start: first live row of U.
        x: right side, then solution.
    """
    n = len(x)
    stop = start + n
    quads = n - n % 4
    for j in range(0, quads, 4):
        r = start + j
        for a in range(j, j + 4):
            x[a] /= U[start + a, start + a]
            for c in range(a + 1, j + 4):
                x[c] -= x[a] * U[start + a, start + c]
        _take_four(
            x[j], x[j + 1], x[j + 2], x[j + 3],
            U[r, r + 4 : stop], U[r + 1, r + 4 : stop],
            U[r + 2, r + 4 : stop], U[r + 3, r + 4 : stop], x[j + 4 :],
        )  # fmt: skip
    for j in range(quads, n):
        r = start + j
        x[j] /= U[r, r]
        _take_one(x[j], U[r, r + 1 : stop], x[j + 1 :])


@_compiled
def combine_rows(v: np.ndarray, rows: np.ndarray, total: np.ndarray) -> None:
    """Set `total (m,) = v (n,) @ rows (n, m)`. O(n m).

    Rows are added in order, each element in the same way: the bits depend on no library.
    """
    total[:] = 0.0
    for i in range(len(v)):
        _take_one(-v[i], rows[i], total)


@_compiled
def _rotate(c: float, s: float, row: np.ndarray, carried: np.ndarray) -> None:
    for i in range(len(carried)):
        a = row[i]
        b = carried[i]
        row[i] = c * a + s * b
        carried[i] = c * b - s * a


@_compiled
def _rotate_twice(
    c: float, s: float, c2: float, s2: float,
    row: np.ndarray, second: np.ndarray, carried: np.ndarray,
) -> None:  # fmt: skip
    for i in range(len(carried)):
        a = row[i]
        b = carried[i]
        a2 = second[i]
        row[i] = c * a + s * b
        b = c * b - s * a
        second[i] = c2 * a2 + s2 * b
        carried[i] = c2 * b - s2 * a2


@_compiled
def absorb_column(
    U: np.ndarray, start: int, carried: np.ndarray, white: np.ndarray, extra: np.ndarray
) -> None:
    """Turn the factor of K into that of `K + carried carried^T`, whitened data alongside.

    The rotations that bring `[L carried]` to `[L' 0]` are applied to the rows of `[white; extra]`.
    O(n^2 + n m) operations for n = len(white), each stored number touched once.

    Args:
        U: (N, N), row j holds column j of L from its diagonal on.
        start: first live row of U.
        carried: (n,) the added column; used up.
        white: (n, m) whitened data `L^-1 [F y]`.
        extra: (m,) their row beside the added column, zero where no data belong to it. Used up.
    """
    n = len(white)
    stop = start + n
    for j in range(0, n - 1, 2):
        r = start + j
        radius = np.sqrt(U[r, r] * U[r, r] + carried[j] * carried[j])
        c, s = U[r, r] / radius, carried[j] / radius
        U[r, r] = radius
        a, b = U[r, r + 1], carried[j + 1]
        U[r, r + 1] = c * a + s * b
        b = c * b - s * a
        a = U[r + 1, r + 1]
        radius = np.sqrt(a * a + b * b)
        c2, s2 = a / radius, b / radius
        U[r + 1, r + 1] = radius
        _rotate_twice(c, s, c2, s2, U[r, r + 2 : stop], U[r + 1, r + 2 : stop], carried[j + 2 :])
        _rotate_twice(c, s, c2, s2, white[j], white[j + 1], extra)
    if n % 2:
        r = stop - 1
        radius = np.sqrt(U[r, r] * U[r, r] + carried[n - 1] * carried[n - 1])
        c, s = U[r, r] / radius, carried[n - 1] / radius
        U[r, r] = radius
        _rotate(c, s, white[n - 1], extra)


@_compiled
def close_gap(U: np.ndarray, start: int, n: int, m: int) -> None:
    """Move samples 0..m-1 up by one place, over sample m. O(n m), nothing for the oldest."""
    for j in range(m - 1, -1, -1):
        r = start + j
        U[r + 1, start + m + 1 : start + n] = U[r, start + m + 1 : start + n]
        U[r + 1, r + 1 : start + m + 1] = U[r, r : start + m]


@_compiled
def move_to_front(U: np.ndarray, start: int, n: int) -> None:
    """Move the factor of n samples from `start` to the first rows of U. O(n^2 / 2)."""
    for j in range(n):
        U[j, j:n] = U[start + j, start + j : start + n]


def absorbed_column_numpy(
    L: np.ndarray, carried: np.ndarray, white: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the factor (n, n) and whitened data (n, m) of `absorb_column`, from scratch."""
    factor = linalg.cholesky(L @ L.T + np.outer(carried, carried), lower=True)
    return factor, linalg.solve_triangular(factor, L @ white, lower=True)


def dropped_row_numpy(L: np.ndarray, white: np.ndarray, m: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the factor (n-1, n-1) without sample m and its whitened data (n, m) from scratch.

    The last row of the data is that of sample m given the others.
    """
    n = len(L)
    order = [*range(m), *range(m + 1, n), m]
    K, data = L @ L.T, L @ white
    factor = linalg.cholesky(K[np.ix_(order, order)], lower=True)
    return factor[: n - 1, : n - 1], linalg.solve_triangular(factor, data[order], lower=True)
