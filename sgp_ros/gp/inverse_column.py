"""One column of the inverse of a factored covariance, compiled, in place of the whole inverse."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit
from scipy import linalg

from sgp_ros.gp.factor_loops import solve_lower

_compiled: Callable[[Any], Any] = njit(cache=True, error_model='numpy')


@_compiled
def _take_sums(U: np.ndarray, r: int, first: int, n: int, start: int, x: np.ndarray) -> None:
    # Unsigned indices, as a signed one might count from the end.
    one, two, three = np.uint64(1), np.uint64(2), np.uint64(3)
    i = r - start
    s0, s1, s2, s3 = x[i], x[i + one], x[i + two], x[i + three]
    for j in range(first, n):
        c = start + j
        s0 -= U[r, c] * x[j]
        s1 -= U[r + one, c] * x[j]
        s2 -= U[r + two, c] * x[j]
        s3 -= U[r + three, c] * x[j]
    x[i], x[i + one], x[i + two], x[i + three] = s0, s1, s2, s3


@_compiled
def _substitute_back(U: np.ndarray, start: int, x: np.ndarray) -> None:
    """Replace x (n,) by L^-T x. Four sums at once, of which none waits for another."""
    n = len(x)
    rest = n % 4
    for i in range(n - 4, rest - 1, -4):
        _take_sums(U, np.uint64(start + i), np.uint64(i + 4), np.uint64(n), np.uint64(start), x)
        for a in range(i + 3, i - 1, -1):
            for j in range(a + 1, i + 4):
                x[a] -= U[start + a, start + j] * x[j]
            x[a] /= U[start + a, start + a]
    for a in range(rest - 1, -1, -1):
        for j in range(a + 1, n):
            x[a] -= U[start + a, start + j] * x[j]
        x[a] /= U[start + a, start + a]


@_compiled
def inverse_column(U: np.ndarray, start: int, n: int, m: int) -> np.ndarray:
    """Return column m (n,) of `(L L^T)^-1` for a lower factor L of n samples.

    Forward substitution from row m on, then back substitution, by columns of L, as
    they are stored. O(n^2 / 2 + (n - m)^2 / 2), no n x n array.

    Args:
        U: (N, N), row j holds column j of L from its diagonal on.
        start: first live row of U.
        n: samples held.
        m: which of them.
    """
    x = np.zeros(n)
    x[m] = 1.0
    solve_lower(U, start + m, x[m:])
    _substitute_back(U, start, x)
    return x


def inverse_column_numpy(L: np.ndarray, m: int) -> np.ndarray:
    """Return what `inverse_column` does, by the solver of the library."""
    return np.asarray(linalg.cho_solve((L, True), np.eye(len(L))[m]))
