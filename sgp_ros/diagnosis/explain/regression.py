"""Columns of candidate effects, and least squares with the inertial parameters projected out.

Rows are scaled by the standard deviation of their joint. The change w of the inertial parameters
has the prior N(0, I); with the prior as p more rows, `Q` spans what it can explain, and columns
are compared by what is left of them. Source: Golub and Pereyra 1973 for the projection of linear
coefficients while the shapes are searched.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.robots.observed_motion import ObservedMotion

MOST_HELD = 30_000_000
"""Numbers that are remembered before all are forgotten: 240 MB."""


class Columns:
    """Filtered columns of candidates, remembered."""

    def __init__(self, equations: Equations) -> None:
        self._equations = {frozenset[int](): equations}
        self._known: dict[tuple[object, ...], np.ndarray] = {}
        self._motions: dict[bytes, ObservedMotion] = {}
        self._held = 0

    def equations(self, dry: frozenset[int]) -> Equations:
        """Return the equations in which dry friction may hold some joints."""
        if dry not in self._equations:
            self._equations[dry] = self._equations[frozenset()].with_dry_friction(dry)
        return self._equations[dry]

    def corrected(self, w: np.ndarray | None) -> ObservedMotion:
        """Return the motion of a robot with changed bodies."""
        motion = self._equations[frozenset()].motion
        if w is None or not w.any():
            return motion
        key = w.tobytes()
        if key not in self._motions:
            if len(self._motions) > 20:
                self._motions.clear()
            tree = motion.tree
            change = (w @ self._equations[frozenset()].directions).reshape(tree.parameters.shape)
            changed = replace(tree, parameters=tree.parameters + change)
            self._motions[key] = replace(motion, tree=changed)
        return self._motions[key]

    def of(
        self, candidate: EffectAt, equations: Equations, w: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the filtered columns, (N, k, m), for bodies that differ by w (p,)."""
        bodies = w if candidate.effect.uses_bodies else None
        x = self.local(candidate, equations, self.corrected(bodies))
        return on_all_joints(x, candidate.place.joint, equations.d.shape[1])

    def local(
        self, candidate: EffectAt, equations: Equations, motion: ObservedMotion
    ) -> np.ndarray:
        """Return the filtered columns of the place, (N, m), or (N, k, m), in a motion."""
        joint = candidate.place.joint
        key = (*candidate.key, candidate.shape.tobytes(), motion)
        # what acts on one joint depends on whether that one is held, on no other
        keys = (*key, bool(equations.moving[:, max(joint, 0)].all())), (*key, equations)
        for known in keys:
            if known in self._known:
                return self._known[known]
        raw = candidate.columns(motion)
        x = equations.compact(raw, joint, is_inertial=candidate.effect.is_inertial)
        if self._held > MOST_HELD:
            self._known.clear()
            self._held = 0
        self._known[keys[raw.ndim == 3]] = x
        self._held += x.size
        return x


def on_all_joints(x: np.ndarray, joint: int, k: int) -> np.ndarray:
    """Return rows of one joint (N, m), or of all (N, k, m), as those of all, (N, k, m)."""
    if x.ndim == 3:
        return x
    result = np.zeros((len(x), k, x.shape[1]))
    result[:, joint] = x
    return result


def dry_joints(candidates: tuple[EffectAt, ...]) -> frozenset[int]:
    """Return the joints that some candidate can hold at rest."""
    return frozenset(j for s in candidates for j in s.held_joints)


def shape_bounds(
    equations: Equations, candidates: tuple[EffectAt, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the bounds of all shapes, (s,) each."""
    low, high = [], []
    for s in candidates:
        if len(s.shape):
            a, b = s.effect.bounds(equations.motion, s.place)
            low.append(a)
            high.append(b)
    if not low:
        return np.zeros(0), np.zeros(0)
    return np.concatenate(low), np.concatenate(high)


def shape_scales(equations: Equations, candidates: tuple[EffectAt, ...]) -> np.ndarray:
    """Return the changes of all shapes over which the columns change, (s,)."""
    found = [
        s.effect.scales(equations.motion, s.place, s.shape) for s in candidates if len(s.shape)
    ]
    return np.concatenate(found) if found else np.zeros(0)


def with_shapes(candidates: tuple[EffectAt, ...], x: np.ndarray) -> tuple[EffectAt, ...]:
    """Return the candidates with shapes from one vector."""
    result, at = [], 0
    for s in candidates:
        m = len(s.shape)
        result.append(s.with_shape(x[at : at + m].copy()) if m else s)
        at += m
    return tuple(result)


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
        x = np.zeros((len(self.Q), m))
        x[: N * k] = (columns / self.sigma[:, None]).reshape(N * k, m)
        return x - self.Q @ (self.Q.T @ x)

    def beyond(self, y: np.ndarray, A: np.ndarray) -> Frame:
        """Return the frame that also projects out columns A (N k + p, m), which this one did.

        For searches beside effects that keep their shapes; `R` stays that of the bodies.

        Args:
            y: (N k + p,) target, less forces that are given.
            A: columns.
        """
        if not A.shape[1]:
            return replace(self, y=y)
        own = np.linalg.qr(A / np.sqrt((A * A).sum(axis=0) + 1e-300))[0]
        return replace(self, Q=np.concatenate([self.Q, own], axis=1), y=y - own @ (own.T @ y))

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
