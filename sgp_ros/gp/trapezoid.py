"""Compiled loops on the square-root information of features that share coefficients.

The rows `[R S | z]` say `R theta + S W = z` with unit noise: R (m, m) upper triangular, S (m, p).
Outputs with the same features share R, their `S | z` stand side by side.
The plain NumPy versions at the end of this module compute the same from scratch.

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
