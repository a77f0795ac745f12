"""Compiled loops that hold an input against the samples of a factor: covariances, solve, products.

The factor `K = L L^T` is stored column by column: row j of U is column j of L from its diagonal
on, contiguous (`gp.factor_loops`). Every element of a column takes the same operations in the same
order, so the loops run at the width of the processor and give the same bits at any width,
alignment or place in memory. Nothing is allocated. Functions that call one another stand in one
module, because that is what the cache of compiled code watches.

Source: Golub and Van Loan, section 3.1 (forward substitution by columns).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit
from scipy import linalg

_compiled: Callable[[Any], Any] = njit(cache=True, error_model='numpy')

SQUARED_EXPONENTIAL, MATERN32, MATERN52 = 1, 2, 3
"""Correlations that `fill_covariances` knows, those of `gp.kernels`."""
_FAR = 1e6


@_compiled
def _take_four(
    U: np.ndarray, r: int, first: int, stop: int, start: int,
    x0: float, x1: float, x2: float, x3: float, x: np.ndarray,
) -> None:  # fmt: skip
    one, two, three = np.uint64(1), np.uint64(2), np.uint64(3)
    for i in range(first, stop):
        x[i - start] = (
            x[i - start] - x0 * U[r, i] - x1 * U[r + one, i]
            - x2 * U[r + two, i] - x3 * U[r + three, i]
        )  # fmt: skip


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
        for a in range(j, j + 4):
            x[a] /= U[start + a, start + a]
            for c in range(a + 1, j + 4):
                x[c] -= x[a] * U[start + a, start + c]
        r = start + j
        # Unsigned indices: a signed one might count from the end, and the loop would stay scalar.
        _take_four(
            U, np.uint64(r), np.uint64(r + 4), np.uint64(stop), np.uint64(start),
            x[j], x[j + 1], x[j + 2], x[j + 3], x,
        )  # fmt: skip
    for j in range(quads, n):
        for a in range(quads, j):
            x[j] -= x[a] * U[start + a, start + j]
        x[j] /= U[start + j, start + j]


@_compiled
def combine_rows(v: np.ndarray, rows: np.ndarray, total: np.ndarray) -> None:
    """Set `total (m,) = v (n,) @ rows (n, m)`. O(n m).

    Rows are added in order, each element in the same way: the bits do not depend on a library.
    """
    n = len(v)
    quads = n - n % 4
    total[:] = 0.0
    for i in range(0, quads, 4):
        v0, v1, v2, v3 = v[i], v[i + 1], v[i + 2], v[i + 3]
        for c in range(len(total)):
            total[c] = (
                total[c] + v0 * rows[i, c] + v1 * rows[i + 1, c]
                + v2 * rows[i + 2, c] + v3 * rows[i + 3, c]
            )  # fmt: skip
    for i in range(quads, n):
        for c in range(len(total)):
            total[c] += v[i] * rows[i, c]


@_compiled
def _take_squares(S: np.ndarray, r: int, s: np.ndarray, v: np.ndarray, i: int) -> None:
    # Unsigned indices, as a signed one might count from the end.
    one, two, three = np.uint64(1), np.uint64(2), np.uint64(3)
    a, b, c, d = 0.0, 0.0, 0.0, 0.0
    for j in range(np.uint64(len(s))):
        at = s[j]
        a += (S[r, j] - at) * (S[r, j] - at)
        b += (S[r + one, j] - at) * (S[r + one, j] - at)
        c += (S[r + two, j] - at) * (S[r + two, j] - at)
        d += (S[r + three, j] - at) * (S[r + three, j] - at)
    v[i], v[i + one], v[i + two], v[i + three] = a, b, c, d


@_compiled
def fill_covariances(
    form: int, variance: float, S: np.ndarray, start: int, s: np.ndarray, v: np.ndarray
) -> None:
    """Set v (n,) to the covariances of one scaled input s (d,) with n of S (N, d) from `start` on.

    O(n d). Four independent squared distances at once.
    """
    n = len(v)
    quads = n - n % 4
    for i in range(0, quads, 4):
        _take_squares(S, np.uint64(start + i), s, v, np.uint64(i))
    for i in range(quads, n):
        v[i] = 0.0
        for j in range(len(s)):
            v[i] += (S[start + i, j] - s[j]) * (S[start + i, j] - s[j])
    if form == SQUARED_EXPONENTIAL:
        for i in range(n):
            v[i] = variance * np.exp(-0.5 * v[i])
    elif form == MATERN32:
        for i in range(n):
            x = np.sqrt(min(3.0 * v[i], _FAR))
            v[i] = variance * ((1.0 + x) * np.exp(-x))
    else:
        for i in range(n):
            x = np.sqrt(min(5.0 * v[i], _FAR))
            v[i] = variance * ((1.0 + x + x * x / 3.0) * np.exp(-x))


@_compiled
def whiten_vector(
    U: np.ndarray, white: np.ndarray, start: int, scales: np.ndarray,
    v: np.ndarray, explained: np.ndarray,
) -> float:  # fmt: skip
    """Replace covariances v (n,) by L^-1 v, and return their squared norm. O(n^2 / 2 + n k w).

    Args:
        U: (N, N), row j holds column j of L from its diagonal on.
        white: (N, k w) whitened data of k outputs.
        start: first live row of both.
        scales: (k,) of the outputs.
        v: covariances of an input with the samples.
        explained: (k w,), becomes the prediction of the data there by the samples.
    """
    n = len(v)
    solve_lower(U, start, v)
    combine_rows(v, white[start : start + n], explained)
    width = len(explained) // len(scales)
    for j in range(len(explained)):
        explained[j] *= scales[j // width]
    quads = n - n % 4
    a, b, c, d = 0.0, 0.0, 0.0, 0.0
    for i in range(0, quads, 4):
        a += v[i] * v[i]
        b += v[i + 1] * v[i + 1]
        c += v[i + 2] * v[i + 2]
        d += v[i + 3] * v[i + 3]
    for i in range(quads, n):
        a += v[i] * v[i]
    return (a + b) + (c + d)


@_compiled
def whiten_input(
    form: int, variance: float, u: np.ndarray, columns: np.ndarray, lengths: np.ndarray,
    U: np.ndarray, S: np.ndarray, white: np.ndarray, start: int, scales: np.ndarray,
    s: np.ndarray, v: np.ndarray, explained: np.ndarray,
) -> float:  # fmt: skip
    """As `whiten_vector` for an input u: scaled to s (d,), its covariances in v (n,).

    Args:
        form: of the correlation, such as `SQUARED_EXPONENTIAL`.
        variance: of the signal.
        u: all inputs.
        columns: (d,) those that the kernel sees.
        lengths: (d,) their length scales.
        U: (N, N) factor.
        S: (N, d) scaled inputs of the samples.
        white: (N, k w) whitened data of k outputs.
        start: first live row of each.
        scales: (k,) of the outputs.
        s: becomes the scaled input.
        v: (n,), becomes the whitened covariances.
        explained: (k w,), becomes the prediction of the data there by the samples.
    """
    for j in range(len(s)):
        s[j] = u[columns[j]] / lengths[j]
    fill_covariances(form, variance, S, start, s, v)
    return float(whiten_vector(U, white, start, scales, v, explained))


def whitened_numpy(
    L: np.ndarray, covariances: np.ndarray, white: np.ndarray, scales: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return v, prediction and squared norm of `whiten_vector`, by the library.

    Args:
        L: (n, n) lower factor.
        covariances: (n,).
        white: (n, k w).
        scales: (k,).
    """
    v = covariances  # SciPy before 1.14 refuses what is empty
    if len(L):
        v = np.asarray(linalg.solve_triangular(L, covariances, lower=True))
    explained = (v @ white).reshape(len(scales), -1) * scales[:, None]
    return v, explained.reshape(-1), float(v @ v)
