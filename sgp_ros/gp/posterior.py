"""Joint inference of W and Z from a batch of observations, with the evidence and its gradient.

With K the covariance of Z plus noise, K = L L^T, A = L^-1 F and b = L^-1 y, the posterior of W
solves the least-squares problem `[A; root] W = [b; target]`. A thin SVD of that stack, its columns
scaled, gives mean, spread and the directions that nothing determines, for any prior up to the flat
one; the covariance `F sigma_w F^T` of equation (15) is never formed. Without an observation
matrix the components of X are coupled only by W and each has its own n x n factor.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg

from sgp_ros.gp.blocks import Block, build_blocks
from sgp_ros.gp.linear_algebra import (
    column_scale,
    column_space,
    null_space,
    require_finite,
    singular_values,
    subtract_symmetric,
    svd,
)
from sgp_ros.gp.model import CoefficientPrior, Model, Observations


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """Predicted X(q) at q queries.

    Attributes:
        mean: (q, k).
        covariance: (q, k, k); the diagonal is infinite where an undetermined direction of W
            enters.
    """

    mean: np.ndarray
    covariance: np.ndarray

    @property
    def variance(self) -> np.ndarray:
        """Variances of the components, (q, k)."""
        return np.einsum('qkk->qk', self.covariance)

    def observed(self, noise: np.ndarray, G: np.ndarray | None = None) -> Prediction:
        """Return the prediction of Y = g X + V.

        Args:
            noise: (m,) variances of V.
            G: (q, m, k) observation matrices; None for the identity.
        """
        if G is None:
            return Prediction(self.mean, self.covariance + np.diag(noise))
        mean = np.einsum('qmk,qk->qm', G, self.mean)
        covariance = np.einsum('qmk,qkl,qnl->qmn', G, self.covariance, G) + np.diag(noise)
        return Prediction(mean, covariance)


RANK_TOLERANCE = 1e-11
"""Least singular value of balanced columns, over the largest, that counts as information on W.
Rounding leaves 1e-16 times the root of the number of rows in rows computed from a state, and a
hundred times that once rows were filtered or Z was eliminated from them; a real signal below 1e-11
could not be told from it."""
ZERO_COLUMN = 4096 * float(np.finfo(float).eps)
"""Norm of a column beside the largest one up to which it is rounding, as in `base_parameters`: as
a number, something would be divided by it and give a coefficient of 1e15."""
NULL_TOLERANCE = 1e-8
"""Share of a regressor row that may point along undetermined directions before it counts."""


@dataclass(frozen=True, slots=True, eq=False)
class _Solution:
    """Least-squares solution of the stacked whitened system.

    Attributes:
        w: (p,) posterior mean; the undetermined part is zero.
        spread: (p, r) with posterior covariance `spread spread^T`.
        null: (p, p - r) orthonormal directions of scaled coefficients that nothing determines.
        scale: (p,) by which the columns were divided.
        left: (N + prior rows, r) left singular vectors.
        residual: (N + prior rows,) of the stacked system.
        log_det: of the posterior precision over the determined directions.
    """

    w: np.ndarray
    spread: np.ndarray
    null: np.ndarray
    scale: np.ndarray
    left: np.ndarray
    residual: np.ndarray
    log_det: float


class Posterior:
    """The posterior of W and Z given observations, for fixed hyper-parameters.

    Cost O(k n^3 / 3 + k n^2 p) to build, O(k n^2) per query with variance.

    Raises:
        NumericalError: a covariance is not positive definite in double precision, or numbers are
            not finite.
    """

    def __init__(self, model: Model, data: Observations, prior: CoefficientPrior) -> None:
        self.model, self.data, self.prior = model, data, prior
        require_finite(data.U, data.F, data.y)
        self._blocks = build_blocks(model, data)
        A = np.vstack([block.A for block in self._blocks] + [prior.root])
        b = np.concatenate([block.b for block in self._blocks] + [prior.target])
        self._solution = _solve(A, b, data, prior)

    @property
    def coefficients(self) -> np.ndarray:
        """Posterior mean of W, (p,); undetermined directions stay at zero."""
        return self._solution.w

    @property
    def covariance(self) -> np.ndarray:
        """Posterior covariance of W over the determined directions, (p, p)."""
        return self._solution.spread @ self._solution.spread.T

    @property
    def is_identifiable(self) -> np.ndarray:
        """Whether the data or the prior determine each coefficient, (p,) of bool."""
        return np.linalg.norm(self._solution.null, axis=1) < NULL_TOLERANCE

    @property
    def log_evidence(self) -> float:
        """Log density of y [nat], over the determined directions where the prior is flat.

        `-1/2 (log|K| + log|P| - log|Lambda| + residual + (N - flat) log 2 pi)`: for a proper
        prior exactly log N(y; E[Y], sigma_dd). The formula printed in the paper is read so.
        """
        count = sum(len(block.b) for block in self._blocks)
        flat = self._solution.spread.shape[1] - len(self.prior.target)
        log_det = sum(block.log_det for block in self._blocks)
        log_det += self._solution.log_det - self.prior.log_det
        quadratic = float(self._solution.residual @ self._solution.residual)
        return -0.5 * (log_det + quadratic + (count - flat) * float(np.log(2.0 * np.pi)))

    def evidence_gradient(self) -> np.ndarray:
        """Return the gradient of `log_evidence` by `model.log_parameters`.

        `1/2 tr((alpha alpha^T - C^-1) dK)` with `alpha = L^-T residual` and
        `C^-1 = L^-T (I - left left^T) L^-1`. Cost O(n^3) per factor.
        """
        kernels = self.model.kernels
        parts: list[np.ndarray | None] = [None] * len(kernels)
        noise = np.zeros(len(self.model.noise))
        start = 0
        for block in self._blocks:
            stop = start + len(block.b)
            H = _curvature(
                block, self._solution.residual[start:stop], self._solution.left[start:stop]
            )
            outputs = np.diag(H).reshape(len(self.data.U), -1).sum(axis=0)
            first = block.components[0] if block.gain is None else 0
            noise[first : first + len(outputs)] += 0.5 * outputs
            for column, component in enumerate(block.components):
                kernel = kernels[component]
                if kernel is not None and block.K is not None:
                    parts[component] = 0.5 * kernel.gradient_from(block.K, self.data.U, H)
                elif kernel is not None:
                    folded = self._fold(H, block, column)
                    parts[component] = 0.5 * kernel.gradient(self.data.U, folded)
            start = stop
        gradients = [part for part in parts if part is not None]
        return np.concatenate([*gradients, noise * np.array(self.model.noise)])

    def predict(self, U: np.ndarray, F: np.ndarray) -> Prediction:
        """Predict X at inputs U (q, d) with regressors F (q, k, p).

        Mean `f w + v^T (b - A w)`, covariance `k** - v^T v + g P^-1 g^T` with `v = L^-1 k*` and
        `g = f - v^T A`: equations (8)-(20) rearranged.
        """
        q, k, _ = F.shape
        mean = F @ self._solution.w  # (q, k)
        G = F.copy()
        covariance = np.zeros((q, k, k))
        start = 0
        for block in self._blocks:
            stop = start + len(block.b)
            cross = [self._cross(block, column, U) for column in range(len(block.components))]
            for column, component in enumerate(block.components):
                v = cross[column]
                if v is None:
                    continue
                kernel = self.model.kernels[component]
                mean[:, component] += v.T @ self._solution.residual[start:stop]
                G[:, component] -= v.T @ block.A
                assert kernel is not None
                covariance[:, component, component] += kernel.diagonal(U)
                for other_column, other in enumerate(block.components):
                    w = cross[other_column]
                    if w is not None:
                        covariance[:, component, other] -= np.einsum('nq,nq->q', v, w)
            start = stop
        spread = G @ self._solution.spread  # (q, k, r)
        covariance += spread @ spread.transpose(0, 2, 1)
        _mark_undetermined(covariance, G, self._solution)
        return Prediction(mean, covariance)

    def process_mean(self, U: np.ndarray) -> np.ndarray:
        """Return the mean of Z at inputs U (q, d), (q, k).

        `k*^T K^-1 (y - F w)`, that is O(k n) per query, with nothing solved for.
        """
        mean = np.zeros((len(U), len(self.model.kernels)))
        for component, kernel in enumerate(self.model.kernels):
            if kernel is not None:
                mean[:, component] = kernel.matrix(U, self.data.U) @ self._weights[:, component]
        return mean

    @cached_property
    def _weights(self) -> np.ndarray:
        """Weight of each observation in the mean of Z, (n, k)."""
        weights, start = np.zeros((len(self.data.U), len(self.model.kernels))), 0
        for block in self._blocks:
            stop = start + len(block.b)
            weights[:, list(block.components)] = block.by_sample(
                self._solution.residual[start:stop], len(weights)
            )
            start = stop
        return weights

    def _cross(self, block: Block, column: int, U: np.ndarray) -> np.ndarray | None:
        kernel = self.model.kernels[block.components[column]]
        if kernel is None or block.L is None:
            return None
        k = kernel.matrix(self.data.U, U)  # (n, q)
        if block.gain is not None:
            k = np.repeat(k, len(block.b) // len(k), axis=0) * block.gain[:, column, None]
        return linalg.solve_triangular(block.L, k, lower=True, check_finite=False)

    def _fold(self, H: np.ndarray, block: Block, column: int) -> np.ndarray:
        assert block.gain is not None
        n = len(self.data.U)
        weighted = H * np.outer(block.gain[:, column], block.gain[:, column])
        return weighted.reshape(n, len(block.b) // n, n, -1).sum(axis=(1, 3))


def _solve(A: np.ndarray, b: np.ndarray, data: Observations, prior: CoefficientPrior) -> _Solution:
    p = A.shape[1]
    # The scale leaves out the hyper-parameters: the evidence over the determined directions
    # would otherwise change with the scale. A second scaling balances the columns for the SVD.
    scale = column_scale(data.F, prior.root)
    size = np.linalg.norm(A, axis=0)
    is_zero = size <= ZERO_COLUMN * size.max(initial=0.0)
    A, scale = np.where(is_zero, 0.0, A), np.where(is_zero, 1.0, scale)
    norms = np.where(is_zero, 1.0, np.linalg.norm(A / scale, axis=0))
    U, S, Vt = svd(A / (scale * norms))
    limit = RANK_TOLERANCE * (S[0] if len(S) else 0.0)
    rank = int((limit < S).sum())
    U, S = U[:, :rank], S[:rank]
    spread = Vt[:rank].T / S / (scale * norms)[:, None]
    w = spread @ (U.T @ b)
    null = _null_space(Vt, rank, norms)
    if rank == p:
        log_det = 2.0 * float(np.log(S).sum() + np.log(scale * norms).sum())
    else:
        log_det = 2.0 * float(np.log(singular_values(A / scale)[:rank]).sum()) if rank else 0.0
    return _Solution(w, spread, null, scale, U, b - A @ w, log_det)


def _null_space(Vt: np.ndarray, rank: int, norms: np.ndarray) -> np.ndarray:
    p = Vt.shape[1]
    if rank == p:
        return np.zeros((p, 0))
    basis = null_space(Vt[:rank]) if rank else np.eye(p)
    return column_space(basis / norms[:, None])


def _curvature(block: Block, residual: np.ndarray, left: np.ndarray) -> np.ndarray:
    """Return `alpha alpha^T - C^-1` of a block, (N, N)."""
    alpha = block.unwhiten(residual)
    Q = block.unwhiten(left)
    factors = np.column_stack([alpha, Q])
    H = factors @ factors.T
    if block.L is None:
        H[np.diag_indices(len(H))] -= 1.0 / block.noise
    else:
        inverse, _ = linalg.lapack.dpotri(block.L, lower=True)
        subtract_symmetric(H, inverse.T)
    return H


def _mark_undetermined(covariance: np.ndarray, G: np.ndarray, solution: _Solution) -> None:
    if not solution.null.shape[1]:
        return
    scaled = G / solution.scale
    outside = np.linalg.norm(scaled @ solution.null, axis=2)
    rows, columns = np.nonzero(outside > NULL_TOLERANCE * np.linalg.norm(scaled, axis=2))
    covariance[rows, columns, columns] = np.inf
