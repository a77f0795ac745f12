"""A Cholesky factor that grows by a row and drops any sample, with whitened data beside it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from sgp_ros.core.rotations import drop_row, solve_lower
from sgp_ros.errors import NumericalError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from sgp_ros.core.kernels import Kernel


class GrowingFactor:
    """Factor of `K + noise I` over the buffered inputs of one component of X.

    Attributes:
        A: (capacity, p) whitened regressor `L^-1 F`; the first `size` rows count.
        b: (capacity,) whitened observations `L^-1 y`.
        size: samples held.

    Args:
        kernel: of the component; None where Z is zero, then nothing but noise is factored.
        noise: its noise variance.
        p: number of coefficients.
        capacity: most samples held at once.
    """

    def __init__(self, kernel: Kernel | None, noise: float, p: int, capacity: int) -> None:
        self._kernel = kernel
        self._noise = noise
        dense = capacity if kernel is not None else 0
        self._L = np.zeros((dense, dense))
        self._S = np.zeros((dense, 0 if kernel is None else len(kernel.inputs)))
        self.A = np.zeros((capacity, p))
        self.b = np.zeros(capacity)
        self.size = 0

    def prior_variance(self, u: np.ndarray) -> float:
        """Return the variance of Z at an input u (d,) before any sample."""
        return 0.0 if self._kernel is None else float(self._kernel.diagonal(u[None])[0])

    def solve(self, u: np.ndarray) -> np.ndarray:
        """Return `L^-1 k(U, u)`, (size,), for an input u (d,)."""
        if self._kernel is None:
            return np.zeros(self.size)
        s = self._kernel.scale(u[None])[0]
        v = self._kernel.vector(self._S[: self.size], s)
        solve_lower(self._L, self.size, v)
        return v

    def pivot(self, v: np.ndarray, u: np.ndarray) -> float:
        """Return the diagonal element that `append` would add, for `v = solve(u)`.

        Raises:
            NumericalError: the sample adds no positive variance in double precision.
        """
        square = self.prior_variance(u) + self._noise - float(v @ v)
        if not square > 0.0:
            raise NumericalError(
                f'a sample repeats {self.size} others to rounding, variance {square:.3g}',
                'a noise variance above the rounding error of the signal variance',
                'raise the noise variance',
            )
        return math.sqrt(square)

    def append(
        self, v: np.ndarray, u: np.ndarray, f: np.ndarray, y: float
    ) -> tuple[np.ndarray, float]:
        """Border the factor with input u, regressor f (p,) and observation y.

        Args:
            v: `solve(u)`, (size,).
            u: input, (d,).
            f: regressor, (p,).
            y: observation.

        Returns:
            The whitened row (p,) and value: `p(y | earlier samples, W)`.

        Raises:
            NumericalError: as `pivot`.
        """
        n = self.size
        diagonal = self.pivot(v, u)
        row = (f - v @ self.A[:n]) / diagonal
        value = float((y - v @ self.b[:n]) / diagonal)
        if self._kernel is not None:
            self._L[n, :n] = v
            self._L[n, n] = diagonal
            self._S[n] = self._kernel.scale(u[None])[0]
        self.A[n] = row
        self.b[n] = value
        self.size += 1
        return row, value

    def drop(self, m: int) -> tuple[np.ndarray, float]:
        """Remove sample m.

        Returns:
            The whitened row (p,) and value of that sample given the remaining ones.
        """
        n = self.size
        if self._kernel is not None:
            drop_row(self._L, self.A, self.b, n, m)
            self._S[m : n - 1] = self._S[m + 1 : n]
            row, value = self.A[n - 1].copy(), float(self.b[n - 1])
        else:
            row, value = self.A[m].copy(), float(self.b[m])
            self.A[m : n - 1] = self.A[m + 1 : n]
            self.b[m : n - 1] = self.b[m + 1 : n]
        self.size -= 1
        return row, value

    def refactorise(self, U: np.ndarray, F: np.ndarray, y: np.ndarray) -> None:
        """Factor anew from inputs U (n, d), regressors F (n, p), observations y (n,). O(n^3 / 3).

        Raises:
            NumericalError: the covariance is not positive definite.
        """
        n = self.size = len(y)
        if not n:
            return
        if self._kernel is None:
            root = np.sqrt(self._noise)
            self.A[:n], self.b[:n] = F / root, y / root
            return
        K = self._kernel.matrix(U)
        K[np.diag_indices(n)] += self._noise
        try:
            L = linalg.cholesky(K, lower=True, check_finite=False)
        except linalg.LinAlgError as error:
            raise NumericalError(
                f'the covariance of {n} samples is not positive definite',
                'a noise variance above the rounding error of the signal variance',
                'raise the noise variance',
            ) from error
        white = linalg.solve_triangular(L, np.column_stack([F, y]), lower=True)
        self._L[:n, :n] = L
        self._S[:n] = self._kernel.scale(U)
        self.A[:n], self.b[:n] = white[:, :-1], white[:, -1]

    def state(self) -> dict[str, np.ndarray]:
        """Return what `restore` needs, as arrays."""
        n = self.size
        return {
            'L': self._L[:n, :n], 'S': self._S[:n], 'A': self.A[:n], 'b': self.b[:n],
        }  # fmt: skip

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue exactly where `state` was taken."""
        n = self.size = len(state['b'])
        self.A[:n], self.b[:n] = state['A'], state['b']
        if self._kernel is not None:
            self._L[:n, :n], self._S[:n] = state['L'], state['S']
