"""Suspected effects and their filtered columns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.robots.observed_motion import ObservedMotion


class Columns:
    """Filtered columns of suspects, remembered."""

    def __init__(self, equations: Equations) -> None:
        self._equations = {frozenset[int](): equations}
        self._known: dict[tuple[object, ...], np.ndarray] = {}
        self._motions: dict[bytes, ObservedMotion] = {}

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
        self, suspect: EffectAt, equations: Equations, w: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the filtered columns, (N, k, m), for bodies that differ by w (p,)."""
        bodies = w if suspect.effect.uses_bodies else None
        tail = b'' if bodies is None else bodies.tobytes()
        key = (*suspect.key, suspect.shape.tobytes(), equations, tail)
        if key not in self._known:
            if len(self._known) > 400:
                self._known.clear()
            motion = self.corrected(bodies)
            raw = suspect.columns(motion)
            self._known[key] = equations.filtered(
                raw, suspect.place.joint, is_inertial=suspect.effect.is_inertial
            )
        return self._known[key]


def dry_joints(suspects: tuple[EffectAt, ...]) -> frozenset[int]:
    """Return the joints that some suspect can hold at rest."""
    return frozenset(s.place.joint for s in suspects if s.is_holding)


def shape_bounds(
    equations: Equations, suspects: tuple[EffectAt, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the bounds of all shapes, (s,) each."""
    low, high = [], []
    for s in suspects:
        if len(s.shape):
            a, b = s.effect.bounds(equations.motion, s.place)
            low.append(a)
            high.append(b)
    if not low:
        return np.zeros(0), np.zeros(0)
    return np.concatenate(low), np.concatenate(high)


def with_shapes(suspects: tuple[EffectAt, ...], x: np.ndarray) -> tuple[EffectAt, ...]:
    """Return the suspects with shapes from one vector."""
    result, at = [], 0
    for s in suspects:
        m = len(s.shape)
        result.append(s.with_shape(x[at : at + m].copy()) if m else s)
        at += m
    return tuple(result)
