"""Triangular systems in which some columns are free, as no data will ever determine them.

The standard inertial parameters of an arm are more than its motion tells apart. A decomposition by
pivoting finds out which combinations it does tell, but for every sample anew that is most of the
work of a step. Where numbers that are information and numbers that are rounding lie far apart, row
echelon form by rotations is enough: columns without a pivot are free. What a row of a regressor
leaves in them after elimination is the part that nothing determines; without such a part its
product with W is the same for every choice of the free ones, so they may be zero.

The loops stand beside plain NumPy versions that the tests compare them with.

Source: Golub and Van Loan, section 5.5 (rank-deficient least squares).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit

_compiled: Callable[[Any], Any] = njit(cache=True, error_model='numpy')

ROUNDING, CLEAR = 1e-12, 1e-6
"""Share of the norm of its column up to which an element is rounding, and from which on it is
information beyond doubt; in between a decomposition by pivoting has to tell."""
DETERMINED = 1e-10
"""Share of a row outside of what is determined up to which it is rounding beyond doubt."""


class Echelon:
    """Row echelon form of a system `A x = z` with columns of norm one, or zero.

    Attributes:
        is_clear: whether every element was either rounding or information; otherwise this is of no
            use.

    Args:
        A: (p, p) upper triangular.
        z: (p,).
        scale: (p,) by which columns were divided.
    """

    def __init__(self, A: np.ndarray, z: np.ndarray, scale: np.ndarray) -> None:
        p = len(z)
        self._E, self._t, self._scale = np.zeros((p, p)), np.zeros(p), scale
        self.is_clear = bool(reduce_rows(A, z, self._E, self._t, np.zeros(p)))

    def products(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Return `rows W` (r,) and S (r, p) with covariance `S S^T`, for rows (r, p). O(r p^2).

        None unless every row is determined beyond doubt.
        """
        if not self.is_clear:
            return None
        spread, values, outside = rows.copy(), np.empty(len(rows)), np.empty(len(rows))
        eliminate(self._E, self._t, self._scale, spread, values, outside)
        return (values, spread) if (outside <= DETERMINED).all() else None


@_compiled
def _rotate(E: np.ndarray, i: int, row: np.ndarray, c: float, s: float) -> None:
    for j in range(i, np.uint64(len(row))):
        above = E[i, j]
        E[i, j] = c * above + s * row[j]
        row[j] = c * row[j] - s * above


@_compiled
def reduce_rows(
    A: np.ndarray, z: np.ndarray, E: np.ndarray, t: np.ndarray, row: np.ndarray
) -> bool:
    """Bring `A x = z` to echelon form `E x = t`, each row at the place of its pivot. O(p^3).

    Args:
        A: (p, p) upper triangular.
        z: (p,).
        E: (p, p) of zeros, becomes the form; rows without a pivot stay zero.
        t: (p,) of zeros, becomes its right side.
        row: (p,), for what is rotated.

    Returns:
        Whether every element was clearly a pivot or clearly not one.
    """
    for i in range(len(z)):
        for j in range(i, len(z)):
            row[j] = A[i, j]
        value = z[i]
        for c in range(i, len(z)):
            if E[c, c] != 0.0:
                radius = np.sqrt(E[c, c] * E[c, c] + row[c] * row[c])
                cosine, sine = E[c, c] / radius, row[c] / radius
                _rotate(E, np.uint64(c), row, cosine, sine)
                above = t[c]
                t[c] = cosine * above + sine * value
                value = cosine * value - sine * above
            elif abs(row[c]) >= CLEAR:
                for j in range(c, len(z)):
                    E[c, j] = row[j]
                t[c] = value
                break
            elif not abs(row[c]) <= ROUNDING:
                return False
    return True


@_compiled
def _subtract(E: np.ndarray, i: int, factor: float, row: np.ndarray) -> None:
    for j in range(i + np.uint64(1), np.uint64(len(row))):
        row[j] -= factor * E[i, j]


@_compiled
def eliminate(
    E: np.ndarray, t: np.ndarray, scale: np.ndarray, rows: np.ndarray,
    values: np.ndarray, outside: np.ndarray,
) -> None:  # fmt: skip
    """Express rows (r, p) by those of an echelon form. O(r p^2 / 2).

    Args:
        E: (p, p) echelon form of columns divided by their scale.
        t: (p,) its right side.
        scale: (p,).
        rows: (r, p), become their coordinates y, zero for free columns.
        values: (r,), become `y t`.
        outside: (r,), become the norms of what is left in free columns, over those of the rows.
    """
    for a in range(len(rows)):
        row = rows[a]
        whole, left, value = 0.0, 0.0, 0.0
        for i in range(len(t)):
            row[i] /= scale[i]
            whole += row[i] * row[i]
        for i in range(len(t)):
            if E[i, i] == 0.0:
                left += row[i] * row[i]
                row[i] = 0.0
                continue
            row[i] /= E[i, i]
            _subtract(E, np.uint64(i), row[i], row)
            value += row[i] * t[i]
        values[a] = value
        outside[a] = np.sqrt(left / whole) if whole > 0.0 else 0.0


def products_numpy(
    A: np.ndarray, z: np.ndarray, scale: np.ndarray, rows: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the values and the covariance of `Echelon.products`, by the library."""
    inverse = np.linalg.pinv(A, rcond=ROUNDING)
    spread = rows / scale @ inverse
    return spread @ z, spread @ spread.T
