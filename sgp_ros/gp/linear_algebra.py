"""Decompositions that data can break, with a fallback and one error, and compiled passes.

LAPACK's fast singular value decomposition (gesdd, by divide and conquer) can fail to converge on
finite numbers; the slow one (gesvd, by QR iterations) then takes its place. Numbers that are not
finite are refused before, in words that say so.

The passes go over n x n matrices, which NumPy would do with several large temporaries: at a
thousand samples a fresh matrix costs as much as the arithmetic on it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit
from scipy import linalg

from sgp_ros.errors import NumericalError

_compiled: Callable[[Any], Any] = njit(cache=True, error_model='numpy')
_TILE = 32


def svd(A: np.ndarray, *, is_full: bool = False) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return U, the singular values and V^T of A (n, m); thin, or with square U and V.

    Raises:
        NumericalError: numbers that are not finite, or no convergence by either algorithm.
    """
    require_finite(A)
    try:
        return np.linalg.svd(A, full_matrices=is_full)
    except linalg.LinAlgError:
        return _slow_svd(A, is_full=is_full)


def singular_values(A: np.ndarray) -> np.ndarray:
    """Return the singular values of A (n, m), largest first, (min(n, m),).

    Raises:
        NumericalError: as `svd`.
    """
    require_finite(A)
    try:
        return np.asarray(linalg.svdvals(A))
    except linalg.LinAlgError:
        return _slow_svd(A, is_full=False)[1]


def null_space(A: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis (m, m - r) of the null space of A (n, m) of rank r.

    Raises:
        NumericalError: as `svd`.
    """
    require_finite(A)
    try:
        return np.asarray(linalg.null_space(A))
    except linalg.LinAlgError:
        _, S, Vt = _slow_svd(A, is_full=True)
        return Vt[_rank(A, S) :].T


def column_space(A: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis (n, r) of the columns of A (n, m) of rank r.

    Raises:
        NumericalError: as `svd`.
    """
    require_finite(A)
    try:
        return np.asarray(linalg.orth(A))
    except linalg.LinAlgError:
        U, S, _ = _slow_svd(A, is_full=False)
        return U[:, : _rank(A, S)]


def least_norm(A: np.ndarray, b: np.ndarray, tolerance: float) -> np.ndarray:
    """Return the shortest x (m,) or (m, c) of all that minimise `|A x - b|`.

    Args:
        A: (n, m).
        b: (n,) or (n, c).
        tolerance: singular values below this share of the largest one count as zero.

    Raises:
        NumericalError: as `svd`.
    """
    require_finite(A, b)
    try:
        return np.asarray(np.linalg.lstsq(A, b, rcond=tolerance)[0])
    except linalg.LinAlgError:
        U, S, Vt = _slow_svd(A, is_full=False)
        r = int((tolerance * S.max(initial=0.0) < S).sum())
        return np.asarray((Vt[:r].T / S[:r]) @ (U[:, :r].T @ b))


def symmetric_eigen(A: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the eigenvalues, least first, and eigenvectors of a symmetric A (n, n).

    Raises:
        NumericalError: as `svd`.
    """
    require_finite(A)
    try:
        values, vectors = np.linalg.eigh(A)
    except linalg.LinAlgError:
        try:
            values, vectors = linalg.eigh(A, driver='ev')
        except linalg.LinAlgError as error:
            raise _no_convergence('eigenvalues', A) from error
    return np.asarray(values), np.asarray(vectors)


def covariance_factor(K: np.ndarray, *, may_overwrite: bool = False) -> np.ndarray:
    """Return the lower Cholesky factor of a covariance of n samples (n, n). O(n^3 / 3).

    Raises:
        NumericalError: it is not positive definite in double precision.
    """
    try:
        L = linalg.cholesky(K, lower=True, overwrite_a=may_overwrite, check_finite=False)
    except linalg.LinAlgError as error:
        raise NumericalError(
            f'the covariance of {len(K)} samples is not positive definite',
            'a noise variance above the rounding error of the signal variance',
            'raise the noise variance',
        ) from error
    return np.asarray(L)


def require_finite(*arrays: np.ndarray) -> None:
    """Refuse NaN and infinity.

    Raises:
        NumericalError: how many of how many numbers are not finite.
    """
    for A in arrays:
        wrong = A.size - np.count_nonzero(np.isfinite(A))
        if wrong:
            raise NumericalError(
                f'{wrong} of {A.size} numbers of a least-squares problem are not finite',
                'finite samples and hyper-parameters',
                'check the recording and the robot for numbers too large to be squared',
            )


def _slow_svd(A: np.ndarray, *, is_full: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    try:
        U, S, Vt = linalg.svd(A, full_matrices=is_full, lapack_driver='gesvd', check_finite=False)
    except linalg.LinAlgError as error:
        raise _no_convergence('singular values', A) from error
    return U, S, Vt


def _rank(A: np.ndarray, S: np.ndarray) -> int:
    return int((np.finfo(float).eps * max(A.shape) * S.max(initial=0.0) < S).sum())


def _no_convergence(what: str, A: np.ndarray) -> NumericalError:
    return NumericalError(
        f'the {what} of a {A.shape[0]} x {A.shape[1]} matrix did not converge',
        'columns of sizes that double precision can hold side by side',
        'check the units of the recording and the robot',
    )


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


def column_scale(F: np.ndarray, root: np.ndarray) -> np.ndarray:
    """Return a positive scale per column of the stacked rows of F (n, k, p) and root (r, p).

    Raises:
        NumericalError: the square of a number is not finite.
    """
    with np.errstate(over='ignore'):
        scale = np.sqrt((F * F).sum(axis=(0, 1)) + (root * root).sum(axis=0))
    require_finite(scale)
    scale[scale == 0.0] = 1.0
    return scale
