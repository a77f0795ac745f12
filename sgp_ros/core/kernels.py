"""Covariance functions of the process Z.

A kernel belongs to one component of X and says which columns of the inputs it sees. It evaluates
itself and contracts its own gradient, so the evidence never holds an array larger than n x n.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class SquaredExponential:
    """Squared exponential kernel with one length scale per input.

    `kappa(u, u') = variance exp(-sum_i (u_i - u'_i)^2 / (2 l_i^2))`
    (Wu and Movellan, equation 4).

    Attributes:
        variance: `sigma_z` [unit of the component squared].
        lengthscales: `l`, one per input [unit of the input].
        inputs: columns of U that the kernel sees, as many as length scales.
    """

    variance: float
    lengthscales: tuple[float, ...]
    inputs: tuple[int, ...]

    def __post_init__(self) -> None:
        """Refuse what is no kernel.

        Raises:
            ValueError: numbers of length scales and inputs differ, or one is not positive.
        """
        if len(self.lengthscales) != len(self.inputs) or not self.inputs:
            raise ValueError(f'{len(self.lengthscales)} length scales, {len(self.inputs)} inputs')
        if not min(self.variance, *self.lengthscales) > 0.0:
            raise ValueError('the variance and the length scales must be positive')

    def scale(self, U: np.ndarray) -> np.ndarray:
        """Return the inputs it sees in units of their length scales, (n, d)."""
        return U[:, self.inputs] / np.array(self.lengthscales)

    def matrix(self, U: np.ndarray, V: np.ndarray | None = None) -> np.ndarray:
        """Return the covariances between rows of U (n, d) and of V (m, d), (n, m).

        Cost O(n m d). Without V, the covariances among the rows of U.
        """
        S = self.scale(U)
        T = S if V is None else self.scale(V)
        squares = (S * S).sum(axis=1)[:, None] + (T * T).sum(axis=1)[None, :]
        squares -= 2.0 * (S @ T.T)
        np.maximum(squares, 0.0, out=squares)
        squares *= -0.5
        np.exp(squares, out=squares)
        squares *= self.variance
        return squares

    def diagonal(self, n: int) -> np.ndarray:
        """Return the prior variances of n inputs, (n,)."""
        return np.full(n, self.variance)

    def vector(self, S: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Return the covariances of one scaled input s (d,) with scaled inputs S (n, d), (n,)."""
        difference = S - s
        return self.variance * np.exp(-0.5 * np.einsum('ij,ij->i', difference, difference))

    @property
    def log_parameters(self) -> np.ndarray:
        """Logarithms of variance and length scales, (1 + d,)."""
        return np.log(np.array([self.variance, *self.lengthscales]))

    def with_log_parameters(self, theta: np.ndarray) -> SquaredExponential:
        """Return this kernel with the parameters whose logarithms are `theta`, (1 + d,)."""
        values = np.exp(theta)
        return SquaredExponential(
            float(values[0]), tuple(float(x) for x in values[1:]), self.inputs
        )

    def gradient(self, U: np.ndarray, weighted: np.ndarray) -> np.ndarray:
        """Contract dK/dtheta with a symmetric H, given the product `weighted = H * K`, (1 + d,).

        `dK/dlog l_i = K * (s_i - s'_i)^2`, so the contraction is
        `2 (sum_a r_a s_ia^2 - s_i^T weighted s_i)` with row sums r: O(n^2 d), no n x n x d array.
        """
        S = self.scale(U)
        rows = weighted.sum(axis=1)
        lengths = 2.0 * (rows @ (S * S) - np.einsum('ai,ai->i', S, weighted @ S))
        return np.concatenate([[rows.sum()], lengths])


Kernel = SquaredExponential
KERNELS = {'squared_exponential': SquaredExponential}
"""Kernels by name; each passes the contract suite."""
