"""A kernel over many samples as a few basis functions, by Cholesky with pivots.

`k(u, u') = phi(u)^T phi(u') + remainder`. The pivots are samples, taken one after the other where
the remainder is largest, until it is everywhere small beside the noise. For the smooth kernels in
use some dozen pivots stand for thousands of samples without an approximation that could be seen.

Source: Fine and Scheinberg 2001; Harbrecht, Peters and Schneider 2012 for the error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from sgp_ros.gp.kernel import Kernel

_ROUNDING = 1e-10


@dataclass(frozen=True, slots=True, eq=False)
class PivotedBasis:
    """Basis functions of one kernel.

    Attributes:
        kernel: the kernel.
        pivots: (r, d) inputs of the pivots.
        L: (r, r) lower factor of the kernel among the pivots.
    """

    kernel: Kernel
    pivots: np.ndarray
    L: np.ndarray

    def rows(self, U: np.ndarray) -> np.ndarray:
        """Return `phi` at inputs U (n, d), (n, r). O(n r^2)."""
        if not len(self.L):  # SciPy before 1.14 refuses a triangle of size zero
            return np.zeros((len(U), 0))
        cross = self.kernel.matrix(self.pivots, U)  # (r, n)
        return np.asarray(linalg.solve_triangular(self.L, cross, lower=True, check_finite=False).T)

    def remainder(self, U: np.ndarray, phi: np.ndarray) -> np.ndarray:
        """Return the variance that phi = rows(U) (n, r) leaves out, (n,), not below zero."""
        explained = np.einsum('nr,nr->n', phi, phi)
        return np.maximum(self.kernel.diagonal(U) - explained, 0.0)


def pivoted_basis(kernel: Kernel, U: np.ndarray, tolerance: float, limit: int) -> PivotedBasis:
    """Choose pivots among the inputs U (n, d). O(n r^2).

    Args:
        kernel: of Z.
        U: inputs of the samples.
        tolerance: variance that may be left out at any of them [unit of the component squared].
        limit: most pivots.
    """
    n = len(U)
    left = kernel.diagonal(U)
    floor = max(tolerance, _ROUNDING * float(left.max()))
    V = np.zeros((min(limit, n), n))
    chosen: list[int] = []
    for step in range(len(V)):
        pivot = int(np.argmax(left))
        if left[pivot] <= floor:
            break
        cross = kernel.matrix(U[pivot : pivot + 1], U)[0]
        cross -= V[:step, pivot] @ V[:step]
        V[step] = cross / np.sqrt(left[pivot])
        left = np.maximum(left - V[step] ** 2, 0.0)
        left[pivot] = 0.0
        chosen.append(pivot)
    return PivotedBasis(kernel, U[chosen], np.tril(V[: len(chosen), chosen].T))
