"""Least squares with the inertial parameters projected out.

Rows are scaled by the standard deviation of their joint. The instants of measured efforts and the
change of the inertial parameters, together w, have the prior N(0, I). N rows tell no more than
`INDEPENDENT_ROWS` independent ones, for what is wrong with the columns repeats in every row:
beside them the prior weighs N over that number. With the prior as p more rows, `Q` spans what it
can explain, and columns are compared by what is left of them. Source: Golub and Pereyra 1973 for
the projection of linear coefficients while the shapes are searched.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import INDEPENDENT_ROWS

EXPLAINED = 1e-13
"""Part of a column's square below which it counts as explained by others."""


@dataclass(frozen=True, eq=False)
class Frame:
    """Scaled equations and what inertial parameters explain of them.

    Attributes:
        sigma: (k,) scale of the rows [N m or N].
        S: orthonormal coefficients of the bases of the joints, (r_j, p) each, and of the prior,
            (p, p): `Q = diag(Q_1, ..., Q_k, I) S`, see `Factor`.
        R: (p, p) upper triangular, `Q R = [B / sigma; sqrt(weight) I]`.
        is_free: whether inertial parameters may differ; else p here counts the instants alone.
        weight: of the prior, in rows.
        pull: (p,) slope in w of what the likelihood gains with the inertia of joints without a
            motor, see `explain/inertia_slope.py`; zeros for none.
    """

    equations: Equations
    sigma: np.ndarray
    S: tuple[np.ndarray, ...]
    R: np.ndarray
    is_free: bool
    weight: float
    pull: np.ndarray

    @classmethod
    def of(
        cls, equations: Equations, sigma: np.ndarray, *, is_free: bool,
        weight: float | None = None, pull: np.ndarray | None = None,
    ) -> Frame:  # fmt: skip
        """Return the frame for rows of these standard deviations; N rows give the usual weight."""
        factors = equations.factors
        p = equations.size if is_free else equations.instants
        parts = [f.R[:, :p] / s for f, s in zip(factors, sigma, strict=True)]
        weight = weight or max(1.0, len(equations.d) / INDEPENDENT_ROWS)
        S, R = np.linalg.qr(np.concatenate([*parts, math.sqrt(weight) * np.eye(p)]))
        ends = np.cumsum([len(part) for part in parts])
        return cls(equations, sigma, tuple(np.split(S, ends)), R, is_free, weight,
                   np.zeros(p) if pull is None else pull)  # fmt: skip

    @property
    def Q(self) -> np.ndarray:  # noqa: N802  # as in the equations
        """Orthonormal basis of what is projected out, (N k + p, p)."""
        N, k = self.equations.d.shape
        rows = np.empty((N, k, self.R.shape[1]))
        for j, factor in enumerate(self.equations.factors):
            rows[:, j] = factor.Q @ self.S[j]
        return np.concatenate([rows.reshape(N * k, -1), self.S[-1]])

    @property
    def wanted(self) -> np.ndarray:
        """Target of the rows of the prior, (p,): `weight |w|^2 / 2 - pull w` is least there."""
        return self.pull / math.sqrt(self.weight)

    @cached_property
    def y(self) -> np.ndarray:
        """Rest of the target, (N k + p,)."""
        y = self.projected(self.equations.d[:, :, None])[:, 0]
        if self.pull.any():
            N, k = self.equations.d.shape
            u = self.S[-1].T @ self.wanted
            y[: N * k] -= np.stack(
                [f.Q @ (self.S[j] @ u) for j, f in enumerate(self.equations.factors)], axis=1
            ).ravel()
            y[N * k :] += self.wanted - self.S[-1] @ u
        return y

    def projected(self, columns: np.ndarray) -> np.ndarray:
        """Return what inertial parameters leave of filtered columns (N, k, m), (N k + p, m)."""
        N, k, m = columns.shape
        x = np.zeros((N * k + len(self.S[-1]), m))
        scaled = np.divide(columns, self.sigma[:, None], out=x[: N * k].reshape(N, k, m))
        if self.R.size:
            u = self.explained(scaled)
            for j, factor in enumerate(self.equations.factors):
                scaled[:, j] -= factor.Q @ (self.S[j] @ u)
            x[N * k :] = -self.S[-1] @ u
        return x

    def explained(self, scaled: np.ndarray) -> np.ndarray:
        """Return the products of the basis with scaled columns (N, k, m), (p, m)."""
        u = np.zeros((self.R.shape[1], scaled.shape[2]))
        for j, factor in enumerate(self.equations.factors):
            if scaled[:, j].any():
                u += self.S[j].T @ (factor.Q.T @ scaled[:, j])
        return u

    def by_joint(self, residual: np.ndarray) -> np.ndarray:
        """Return the mean squares of a residual (N k + p,) per joint, unscaled, (k,)."""
        N, k = self.equations.d.shape
        return (residual[: N * k].reshape(N, k) ** 2).mean(axis=0) * self.sigma**2

    def parameters(self, unexplained: np.ndarray) -> np.ndarray:
        """Return w (p,) that explains best what effects (N, k) leave of the target."""
        u = self.explained((unexplained / self.sigma)[:, :, None])[:, 0]
        u += self.S[-1].T @ self.wanted
        w = np.zeros(self.equations.size)
        w[: len(self.R)] = np.linalg.solve(self.R, u)
        return w

    @property
    def occam(self) -> float:
        """Cost of free inertial parameters in evidence, `log det R / sqrt(weight)` [nats]."""
        return float(np.log(np.abs(np.diag(self.R)) / math.sqrt(self.weight)).sum())

    @property
    def determined(self) -> int:
        """Number of combinations of inertial parameters that data determine better than the prior.

        Their singular values of R are above `sqrt(2 weight)`.
        """
        return int((np.linalg.svd(self.R, compute_uv=False) > math.sqrt(2.0 * self.weight)).sum())

    @property
    def covariance(self) -> np.ndarray:
        """Expected square errors of w, (p, p): from the rows, and from the shrinkage by the prior.

        `A^-1 (D + weight^2 V) A^-1` with the information D of the rows, `A = D + weight I` and the
        usual variances V: what made bodies of a more accurate file likely may have been what no
        row shows of them.
        """
        inverse = np.linalg.inv(self.R.T @ self.R)
        V = np.full(len(inverse), self.equations.accuracy**-2)
        V[: self.equations.instants] = 1.0
        return np.asarray(inverse + self.weight * (inverse * (self.weight * V - 1.0)) @ inverse)
