"""Compiled passes over n x n matrices that NumPy would make with several large temporaries.

At a thousand samples a fresh matrix costs as much as the arithmetic on it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit

_compiled: Callable[[Any], Any] = njit(cache=True, error_model='numpy')
_TILE = 32


@_compiled
def turn_into_exponents(products: np.ndarray, a: np.ndarray, b: np.ndarray) -> None:
    """Replace inner products (n, m) by `min(products - (a + b), 0)` with a (n,), b (m,).

    For half squared norms a and b these are the exponents `-1/2 |s - t|^2`, cut where rounding
    would make them positive.
    """
    for i in range(len(a)):
        for j in range(len(b)):
            products[i, j] = min(products[i, j] - (a[i] + b[j]), 0.0)


@_compiled
def subtract_symmetric(H: np.ndarray, upper: np.ndarray) -> None:
    """Subtract from H (n, n) the symmetric matrix of which only `upper` (n, n) is given.

    In square tiles: rows and columns of one tile stay in the cache.
    """
    n = len(H)
    for start in range(0, n, _TILE):
        for other in range(start, n, _TILE):
            for i in range(start, min(start + _TILE, n)):
                for j in range(max(i, other), min(other + _TILE, n)):
                    H[i, j] -= upper[i, j]
                    if j > i:
                        H[j, i] -= upper[i, j]


def exponents_numpy(products: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return what `turn_into_exponents` leaves."""
    return np.minimum(products - (a[:, None] + b[None, :]), 0.0)


def subtracted_numpy(H: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Return what `subtract_symmetric` leaves."""
    return H - np.triu(upper) - np.triu(upper, 1).T
