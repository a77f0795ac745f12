"""Products that give the gain of a trial over a model, without a fit.

With B an orthonormal basis of what bodies and effects explain, r what they leave, and x the
columns of a trial, of which only the rows of one joint differ from zero,
`|r - (x - B B^T x) c|^2` follows for each joint from `x^T x`, `B^T x`, `x^T r` and the products of
B with itself and with r, joint by joint. The part of B that is due to bodies follows from small
products that no scale changes, so that N rows are gone through once for each column.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.explain.candidates import split
from sgp_ros.diagnosis.explain.fitted_model import Model, floors
from sgp_ros.diagnosis.explain.frame import EXPLAINED, Frame
from sgp_ros.diagnosis.explain.regression import Columns, Seen


@dataclass(frozen=True, eq=False)
class Rest:
    """Residual of a model in one frame, with products of the basis B of the model's columns.

    B has the P columns `[Q, own]`, Q that of the bodies.

    Attributes:
        frame: scaled equations.
        r: (N, k) residual.
        own: (N, k, m) orthonormal beside Q together with the rows of the prior: what effects add.
        BB: (k, P, P) products of the basis with itself, joint by joint.
        Br: (k, P) products of the basis and the residual, joint by joint.
    """

    frame: Frame
    r: np.ndarray
    own: np.ndarray
    BB: np.ndarray
    Br: np.ndarray

    @classmethod
    def of(cls, columns: Columns, model: Model, dry: frozenset[int]) -> Rest:
        """Return what a model leaves where dry friction may hold some joints."""
        frame = Frame.of(
            columns.equations(dry), model.sigma, is_free=model.is_free, pull=model.frame.pull
        )
        y, A, _ = split(frame, columns, model.effects, model.w)
        own = np.zeros((len(y), 0))
        if A.shape[1]:
            own = np.linalg.qr(A / np.sqrt((A * A).sum(axis=0) + 1e-300))[0]
            y = y - own @ (own.T @ y)
        N, k = frame.equations.d.shape
        r, F = y[: N * k].reshape(N, k), own[: N * k].reshape(N, k, -1)
        p = frame.R.shape[1]
        P = p + F.shape[2]
        BB, Br = np.empty((k, P, P)), np.empty((k, P))
        for j, factor in enumerate(frame.equations.factors):
            S, f = frame.S[j], F[:, j]
            BB[j, :p, :p], BB[j, p:, p:] = S.T @ S, f.T @ f
            BB[j, :p, p:] = S.T @ (factor.Q.T @ f)
            BB[j, p:, :p] = BB[j, :p, p:].T
            Br[j, :p], Br[j, p:] = S.T @ (factor.Q.T @ r[:, j]), f.T @ r[:, j]
        return cls(frame, r, F, BB, Br)

    @property
    def equations(self) -> Equations:
        """The equations of the frame."""
        return self.frame.equations

    @cached_property
    def by_joint(self) -> tuple[np.ndarray, ...]:
        """Part of the basis that effects add, joint by joint, (m, N) each."""
        return tuple(np.ascontiguousarray(part.T) for part in self.own.transpose(1, 0, 2))

    @cached_property
    def left_over(self) -> np.ndarray:
        """Residual joint by joint, (k, N)."""
        return np.ascontiguousarray(self.r.T)

    @cached_property
    def left(self) -> np.ndarray:
        """Mean squares of the residual, (k,) [N^2 m^2 or N^2]."""
        return np.asarray((self.r**2).mean(axis=0) * self.frame.sigma**2)

    @cached_property
    def floor(self) -> np.ndarray:
        """Least mean squares that count, (k,) [N^2 m^2 or N^2]."""
        return floors(self.equations)


@dataclass(frozen=True, eq=False)
class Products:
    """Products of columns, less what the model explains of them, with themselves and the residual.

    Those of S candidates with m columns each, every candidate by itself.

    Attributes:
        own: (S, k, m, m), joint by joint.
        cross: (S, k, m) with the residual, joint by joint.
        G: (S, m, m) over all rows.
        b: (S, m) with the residual over all rows.
    """

    own: np.ndarray
    cross: np.ndarray
    G: np.ndarray
    b: np.ndarray

    @classmethod
    def of(cls, rest: Rest, seen: Seen) -> Products:
        """Return those of filtered columns."""
        frame, S = rest.frame, seen.count
        k, P = rest.Br.shape
        p, m = frame.R.shape[1], seen.x.shape[-1] // S
        xx, xr = np.zeros((S, k, m, m)), np.zeros((S, k, m))
        Bx = {}
        for j, x in seen.rows.items():
            s = frame.sigma[j]
            Bx[j] = np.empty((P, S, m))
            if p:
                Bx[j][:p] = (frame.S[j].T @ (seen.explained[j] / s)).reshape(p, S, m)
            Bx[j][p:] = (rest.by_joint[j] @ x / s).reshape(P - p, S, m)
            xr[:, j] = (rest.left_over[j] @ x / s).reshape(S, m)
            xx[:, j] = seen.squares[j] / s**2
        u = sum(Bx.values(), np.zeros((P, S, m)))
        among = (rest.BB @ u.reshape(P, S * m)).reshape(k, P, S, m)
        own = xx + np.einsum('psa,jpsb->sjab', u, among)
        for j, part in Bx.items():
            shared = np.einsum('psa,psb->sab', part, u)
            own[:, j] -= shared + shared.transpose(0, 2, 1)
        whole = xx.sum(axis=1)
        G, at = whole - np.einsum('psa,psb->sab', u, u), np.arange(m)
        left = G[:, at, at]
        G[:, at, at] = np.where(left > EXPLAINED * whole[:, at, at], left, np.inf)
        cross = xr - np.einsum('jp,psa->sja', rest.Br, u)
        return cls(own, cross, G, xr.sum(axis=1))

    def coefficients(self) -> np.ndarray:
        """Return the least squares (S, m); zero for columns that are explained already."""
        if self.b.shape[1] == 1:
            return self.b / self.G[:, 0]
        size = np.sqrt(np.diagonal(self.G, 0, 1, 2))
        G = np.where(np.isfinite(self.G), self.G, 0.0) / (size[:, :, None] * size[:, None, :])
        at = np.arange(size.shape[1])
        G[:, at, at] = np.isfinite(size)
        inverse = np.linalg.pinv(G, rcond=EXPLAINED, hermitian=True)
        return np.asarray((inverse @ (self.b / size)[:, :, None])[:, :, 0] / size)
