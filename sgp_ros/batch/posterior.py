"""The joint posterior of W and Z from all samples of a recording.

Each joint's Z is written in the basis of its kernel, `Z = phi(u)^T v` with `v ~ N(0, I)`; what the
basis leaves out stays as independent variance of the sample (Snelson and Ghahramani 2006), which
by the tolerance of the basis is far below the noise. Then `y = F W + phi v + noise` is a linear
model. One QR factorization per joint eliminates v without forming a normal equation and leaves p
rows that say what the joint tells of W; the joints' rows together give W.

The noise is taken for white until then. A residual whose neighbours are correlated would make that
posterior too narrow. The estimate is linear in y, `W = sum_j P^-1 H_j^T y_j + prior`, so its
covariance under the correlations R_j of an autoregression fitted to the residual is
`P^-1 + P^-1 sum_j H_j^T (R_j - noise_j I) H_j P^-1`. Unlike a sum over blocks of time, of which a
recording holds a dozen, this estimates a few numbers from all rows; it takes the residual
for stationary.

The basis comes from a Cholesky decomposition with pivots,
`k(u, u') = phi(u)^T phi(u') + remainder`. The pivots are samples, taken one after the other where
the remainder is largest, until it is everywhere small beside the noise. For the smooth kernels in
use some dozen pivots stand for thousands of samples without an approximation that could be seen.

Source: Fine and Scheinberg 2001; Harbrecht, Peters and Schneider 2012 for the error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from sgp_ros.batch.least_squares import autoregression, coloured_products, inflation
from sgp_ros.gp.kernel import Kernel
from sgp_ros.gp.linear_algebra import symmetric_eigen
from sgp_ros.gp.model import CoefficientPrior, Model, Observations
from sgp_ros.gp.posterior import Posterior

_ROUNDING = 1e-10


@dataclass(frozen=True, slots=True, eq=False)
class PivotedBasis:
    """Basis functions of one kernel; the pivots are its inducing points.

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


_TOLERANCE = 1e-3  # of the noise variance
_CHUNK = 4096


@dataclass(frozen=True, slots=True, eq=False)
class _JointPart:
    """One joint's equation with v eliminated.

    Attributes:
        basis: of its Z; None without.
        noise: variance [unit of y squared].
        phi: (n, r) basis at the samples.
        weight: (n,) inverse variance of noise and remainder.
        factor: (r, r) upper, `factor^T factor = I + phi^T diag(weight) phi`.
        coupling: (r, p) and data: (r,), so that `factor v = data - coupling W`.
        rows: (m, p) and target: (m,) information of the joint on W.
    """

    basis: PivotedBasis | None
    noise: float
    phi: np.ndarray
    weight: np.ndarray
    factor: np.ndarray
    coupling: np.ndarray
    data: np.ndarray
    rows: np.ndarray
    target: np.ndarray

    @classmethod
    def of(
        cls, kernel: Kernel | None, noise: float, limit: int, U: np.ndarray, Fy: np.ndarray
    ) -> _JointPart:
        """Eliminate v from the equations of one joint with rows Fy (n, p + 1)."""
        n = len(U)
        basis, phi, remainder = None, np.zeros((n, 0)), np.zeros(n)
        if kernel is not None:
            basis = pivoted_basis(kernel, U, _TOLERANCE * noise, limit)
            phi = basis.rows(U)
            remainder = basis.remainder(U, phi)
        weight = 1.0 / (noise + remainder)
        r = phi.shape[1]
        R = np.eye(r, r + Fy.shape[1])
        for start in range(0, n, _CHUNK):
            part = slice(start, start + _CHUNK)
            rows = np.hstack([phi[part], Fy[part]]) * np.sqrt(weight[part])[:, None]
            R = np.asarray(np.linalg.qr(np.vstack([R, rows]), mode='r'))
        return cls(
            basis,
            noise,
            phi,
            weight,
            R[:r, :r],
            R[:r, r:-1],
            R[:r, -1],
            R[r:, r:-1],
            R[r:, -1],
        )

    def eliminate(self, F: np.ndarray, phi: np.ndarray) -> np.ndarray:
        """Return `F - phi factor^-1 coupling`, (n, p): the part of F that v cannot imitate."""
        return F - phi @ _back(self.factor, self.coupling)


class BatchPosterior:
    """The posterior of W and Z given all rows, for fixed hyper-parameters.

    Cost O(n (r + p)^2) per joint with r basis functions.

    Args:
        model: hyper-parameters.
        data: n observations, without observation matrix.
        prior: of W.
        block: (n,) rows of one number follow each other in time at equal distance.
        limit: most basis functions of a joint.
    """

    def __init__(
        self,
        model: Model,
        data: Observations,
        prior: CoefficientPrior,
        block: np.ndarray,
        limit: int,
    ) -> None:
        Fy = np.concatenate([data.F, data.y[:, :, None]], axis=2)
        self.model = model
        self._parts = [
            _JointPart.of(kernel, noise, limit, data.U, Fy[:, j])
            for j, (kernel, noise) in enumerate(zip(model.kernels, model.noise, strict=True))
        ]
        rows = np.vstack([part.rows for part in self._parts])
        target = np.concatenate([part.target for part in self._parts])
        whitened = Observations(np.zeros((len(rows), 1)), rows[:, None, :], target[:, None])
        self._physics = Posterior(Model((None,), (1.0,)), whitened, prior)
        self._weights = [
            _back(part.factor, part.data - part.coupling @ self.coefficients)
            for part in self._parts
        ]
        self.rows_per_free_row = np.ones(len(self._parts))
        self._spread = self._coloured_spread(data, prior, block)

    @property
    def coefficients(self) -> np.ndarray:
        """Posterior mean of W, (p,); undetermined directions stay at zero."""
        return self._physics.coefficients

    @property
    def white_covariance(self) -> np.ndarray:
        """Covariance of W if the noise were white, over the determined directions, (p, p)."""
        return self._physics.covariance

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of W under the correlations of the residual, (p, p)."""
        return self._spread @ self._spread.T

    @property
    def is_identifiable(self) -> np.ndarray:
        """Whether the data or the prior determine each coefficient, (p,) of bool."""
        return self._physics.is_identifiable

    @property
    def basis_sizes(self) -> tuple[int, ...]:
        """Number of basis functions of each joint's Z."""
        return tuple(part.phi.shape[1] for part in self._parts)

    def residual(self, data: Observations) -> np.ndarray:
        """Return what W and Z leave of the samples that were learned, (n, k)."""
        process = [part.phi @ v for part, v in zip(self._parts, self._weights, strict=True)]
        return data.y - data.F @ self.coefficients - np.column_stack(process)

    def predict(self, U: np.ndarray, F: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Predict y at inputs U (q, d) with regressors F (q, k, p).

        Returns:
            mean (q, k) and variance (q, k), noise included; infinite where an undetermined
            direction of W enters.
        """
        mean = F @ self.coefficients  # (q, k)
        variance = np.empty_like(mean)
        for j, (part, v) in enumerate(zip(self._parts, self._weights, strict=True)):
            phi, own = np.zeros((len(U), 0)), np.zeros(len(U))
            if part.basis is not None:
                phi = part.basis.rows(U)
                own = part.basis.remainder(U, phi)
                spread = _back(part.factor, phi.T, trans='T')
                own += np.einsum('rq,rq->q', spread, spread)
            mean[:, j] += phi @ v
            free = part.eliminate(F[:, j], phi)
            of_w = self._physics.predict(np.zeros((len(U), 1)), free[:, None, :]).variance[:, 0]
            coloured = ((free @ self._spread) ** 2).sum(axis=1)
            variance[:, j] = own + part.noise + np.where(np.isfinite(of_w), coloured, np.inf)
        return mean, variance

    def _coloured_spread(
        self, data: Observations, prior: CoefficientPrior, block: np.ndarray
    ) -> np.ndarray:
        """Return a square root of the covariance of W under the residual's correlations, (p, r).

        `P^-1 (P_0 + H^T R H) P^-1` with the information P of prior and data and P_0 of the prior:
        a sum of squares, so that no rounding makes a variance negative.
        """
        residual = self.residual(data)
        inverse = self._physics.covariance
        total = np.zeros_like(inverse)
        for j, part in enumerate(self._parts):
            error = residual[:, j]
            weights, innovation = autoregression(error, block)
            self.rows_per_free_row[j] = inflation(weights, innovation)
            H = part.eliminate(data.F[:, j], part.phi) * part.weight[:, None]
            power = max(part.noise, float(np.mean(error**2)))
            total += power * coloured_products(H, block, weights, innovation)
        S = _square_root(inverse)
        return S @ np.hstack([S.T @ prior.root.T, _square_root(S.T @ total @ S)])


def _back(R: np.ndarray, b: np.ndarray, trans: str = 'N') -> np.ndarray:
    """Solve R x = b for an upper triangle; SciPy before 1.14 refuses one of size zero."""
    return np.asarray(linalg.solve_triangular(R, b, trans)) if len(b) else np.zeros(b.shape)


def _square_root(covariance: np.ndarray) -> np.ndarray:
    """Return S with `S S^T = covariance`, positive semidefinite up to rounding."""
    scale = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    scale[scale == 0.0] = 1.0
    values, vectors = symmetric_eigen(covariance / np.outer(scale, scale))
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))
