"""Compiled loops on the square-root information of features that share coefficients.

The rows `[R S | z]` say `R theta + S W = z` with unit noise: R (m, m) upper triangular, S (m, p).
The plain NumPy versions at the end of this module compute the same from scratch.

Source: Golub and Van Loan, section 5.1; Bierman 1977, chapter IV.
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
def absorb_equation(
    R: np.ndarray, S: np.ndarray, m: int, phi: np.ndarray, rest: np.ndarray
) -> None:
    """Add the equation `phi theta + rest[:-1] W = rest[-1]` of unit noise.

    Rotations zero phi (m,) against R; what they leave in `rest` is an equation on W alone, and no
    information is in both. O(m (m / 2 + p)).

    Args:
        R: (M, M), changed in its leading m x m part.
        S: (M, p + 1), regressor and right side, changed in its first m rows.
        m: features in use.
        phi: (m,) or longer, used up.
        rest: (p + 1,) regressor and value, then what remains of them.
    """
    for i in range(m):
        if phi[i] == 0.0:
            continue
        radius = np.hypot(R[i, i], phi[i])
        cosine = R[i, i] / radius
        sine = phi[i] / radius
        for j in range(i, m):
            above = R[i, j]
            R[i, j] = cosine * above + sine * phi[j]
            phi[j] = cosine * phi[j] - sine * above
        for j in range(len(rest)):
            above = S[i, j]
            S[i, j] = cosine * above + sine * rest[j]
            rest[j] = cosine * rest[j] - sine * above


@_compiled
def solve_transposed(R: np.ndarray, m: int, x: np.ndarray) -> None:
    """Replace x (m,) by R^-T x for the leading m x m part of R, by rows of R. O(m^2 / 2)."""
    for i in range(m):
        x[i] /= R[i, i]
        for j in range(i + 1, m):
            x[j] -= R[i, j] * x[i]


def absorbed_equations_numpy(
    R: np.ndarray, S: np.ndarray, phi: np.ndarray, rest: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return R (m, m), S (m, p + 1) and what is left on W (r, p + 1), by one QR, up to row signs.

    Args:
        R: (m, m) before.
        S: (m, p + 1) before.
        phi: (r, m) of r equations.
        rest: (r, p + 1) of these.
    """
    m = len(R)
    stacked = np.block([[R, S], [phi, rest]])
    Q, upper = np.linalg.qr(stacked[:, :m], mode='complete')
    turned = Q.T @ stacked[:, m:]
    return upper[:m], turned[:m], turned[m:]


def solved_transposed_numpy(R: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return R^-T x, (m,), by the solver of the library."""
    return np.asarray(linalg.solve_triangular(R, x, trans='T'))
