"""Rows of observations that share one Cholesky factor, whitened by it.

Without an observation matrix each component of X has its own block of n rows. With one, all rows
stand in a single block, since g(u) mixes the components.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from sgp_ros.gp.kernel import Kernel
from sgp_ros.gp.linear_algebra import covariance_factor
from sgp_ros.gp.model import Model, Observations


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Rows of observations that share one factor.

    Attributes:
        components: indices of the components of X that enter these rows.
        gain: (N, len(components)) factor of each component in each row; None for ones.
        L: (N, N) lower factor, or None where the covariance is `noise I`.
        noise: variance on the diagonal, used without L.
        A, b: whitened regressor (N, p) and observations (N,).
        K: (N, N) covariance of Z of the one component of these rows; None with gain or without Z.
    """

    components: tuple[int, ...]
    gain: np.ndarray | None
    L: np.ndarray | None
    noise: float
    A: np.ndarray
    b: np.ndarray
    K: np.ndarray | None = None

    @property
    def log_det(self) -> float:
        """Logarithm of the determinant of the rows' covariance."""
        if self.L is None:
            return len(self.b) * float(np.log(self.noise))
        return 2.0 * float(np.log(np.diag(self.L)).sum())

    def unwhiten(self, x: np.ndarray) -> np.ndarray:
        """Return L^-T x."""
        if self.L is None:
            return x / np.sqrt(self.noise)
        return linalg.solve_triangular(self.L, x, lower=True, trans='T', check_finite=False)

    def by_sample(self, x: np.ndarray, n: int) -> np.ndarray:
        """Return L^-T x of n samples times the gains of the components, (n, len(components))."""
        alpha = self.unwhiten(x)[:, None]
        if self.gain is None:
            return alpha
        return np.asarray((alpha * self.gain).reshape(n, -1, self.gain.shape[1]).sum(axis=1))


def build_blocks(model: Model, data: Observations) -> list[Block]:
    """Factor and whiten all observations.

    Raises:
        NumericalError: a covariance is not positive definite in double precision.
    """
    if data.G is None:
        return [
            _direct_block(j, kernel, noise, data)
            for j, (kernel, noise) in enumerate(zip(model.kernels, model.noise, strict=True))
        ]
    n, m, k = data.G.shape
    gain = data.G.reshape(n * m, k)
    K = np.zeros((n * m, n * m))
    for j, kernel in enumerate(model.kernels):
        if kernel is not None:
            stretched = np.repeat(np.repeat(kernel.matrix(data.U), m, axis=0), m, axis=1)
            K += np.outer(gain[:, j], gain[:, j]) * stretched
    K[np.diag_indices(n * m)] += np.tile(np.array(model.noise), n)
    rows = np.einsum('nmk,nkp->nmp', data.G, data.F).reshape(n * m, -1)
    return [_factored_block(tuple(range(k)), gain, K, rows, data.y.ravel())]


def _direct_block(j: int, kernel: Kernel | None, noise: float, data: Observations) -> Block:
    if kernel is None:
        root = np.sqrt(noise)
        return Block((j,), None, None, noise, data.F[:, j] / root, data.y[:, j] / root)
    K = kernel.matrix(data.U)
    noisy = K.copy()
    noisy[np.diag_indices(len(K))] += noise
    return replace(_factored_block((j,), None, noisy, data.F[:, j], data.y[:, j]), K=K)


def _factored_block(
    components: tuple[int, ...],
    gain: np.ndarray | None,
    K: np.ndarray,
    rows: np.ndarray,
    y: np.ndarray,
) -> Block:
    L = covariance_factor(K, may_overwrite=True)
    stacked = np.column_stack([rows, y])
    white = linalg.solve_triangular(L, stacked, lower=True, check_finite=False)
    return Block(components, gain, L, 0.0, white[:, :-1], white[:, -1])
