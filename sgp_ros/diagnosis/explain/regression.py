"""Least squares of the discrepancy on effects, with the inertial parameters projected out.

Rows are scaled by the standard deviation of their joint. The change w of the inertial parameters
has the prior N(0, I); with the prior as p more rows, `Q` spans what it can explain, and columns
are compared by what is left of them. Source: Golub and Pereyra 1973 for the projection of linear
coefficients while the shapes are searched.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations


@dataclass(frozen=True, eq=False)
class Frame:
    """Scaled equations and what inertial parameters explain of them.

    Attributes:
        sigma: (k,) scale of the rows [N m or N].
        Q: (N k + p, p) orthonormal.
        R: (p, p) upper triangular, `Q R = [B / sigma; I]`.
        y: (N k + p,) what is left of the target.
        is_free: whether inertial parameters may differ; else p is 0 here.
    """

    equations: Equations
    sigma: np.ndarray
    Q: np.ndarray
    R: np.ndarray
    y: np.ndarray
    is_free: bool

    @classmethod
    def of(cls, equations: Equations, sigma: np.ndarray, *, is_free: bool) -> Frame:
        """Return the frame for rows of these standard deviations."""
        N, k, _ = equations.base.shape
        base = equations.base if is_free else equations.base[:, :, :0]
        p = base.shape[2]
        scaled = (base / sigma[:, None]).reshape(N * k, p)
        Q, R = np.linalg.qr(np.concatenate([scaled, np.eye(p)]))
        target = np.concatenate([(equations.d / sigma).ravel(), np.zeros(p)])
        return cls(equations, sigma, Q, R, target - Q @ (Q.T @ target), is_free)

    def projected(self, columns: np.ndarray) -> np.ndarray:
        """Return what inertial parameters leave of filtered columns (N, k, m), (N k + p, m)."""
        N, k, m = columns.shape
        p = self.Q.shape[1]
        x = np.zeros((N * k + p, m))
        x[: N * k] = (columns / self.sigma[:, None]).reshape(N * k, m)
        return x - self.Q @ (self.Q.T @ x)

    def by_joint(self, residual: np.ndarray) -> np.ndarray:
        """Return the mean squares of a residual (N k + p,) per joint, unscaled, (k,)."""
        N, k = self.equations.d.shape
        return (residual[: N * k].reshape(N, k) ** 2).mean(axis=0) * self.sigma**2

    def parameters(self, unexplained: np.ndarray) -> np.ndarray:
        """Return w (p,) that explains best what effects (N, k) leave of the target."""
        N, k = self.equations.d.shape
        if not self.is_free:
            return np.zeros(self.equations.base.shape[2])
        x = (unexplained / self.sigma).ravel()
        return np.linalg.solve(self.R, self.Q[: N * k].T @ x)

    @property
    def occam(self) -> float:
        """What free inertial parameters cost in evidence, `log det R` [nats]."""
        return float(np.log(np.abs(np.diag(self.R))).sum())

    @property
    def determined(self) -> int:
        """Number of combinations of inertial parameters that the data tell more of than the prior.

        Their singular values of `[B / sigma; I]` are above the square root of two.
        """
        return int((np.linalg.svd(self.R, compute_uv=False) > np.sqrt(2.0)).sum())
