"""Filtered columns of candidate effects, remembered, and their shapes as one vector."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.compare.sample import sampled
from sgp_ros.diagnosis.explain.inertia_slope import InertiaSlope
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import Place
from sgp_ros.robots.observed_motion import ObservedMotion

MOST_HELD = 15_000_000
"""Numbers that are remembered before the first ones are forgotten: 120 MB."""
MOST_SLOPES = 15_000_000
"""Slopes of efforts that motions of changed bodies hold before they let go of them: 120 MB."""


class Columns:
    """Filtered columns of candidates, remembered.

    Attributes:
        settled: what searches on them have looked at in vain.
    """

    def __init__(self, equations: Equations) -> None:
        self._equations = {frozenset[int](): equations}
        self._known: dict[tuple[object, ...], Seen] = {}
        self._edges: dict[tuple[object, ...], np.ndarray | None] = {}
        self._motions: dict[bytes, ObservedMotion] = {}
        self._held = 0
        self.settled = set[object]()

    def equations(self, dry: frozenset[int]) -> Equations:
        """Return the equations in which dry friction may hold some joints."""
        if dry not in self._equations:
            self._equations[dry] = self._equations[frozenset()].with_dry_friction(dry)
        return self._equations[dry]

    @property
    def rows(self) -> int:
        """Number N of equations."""
        return len(self._equations[frozenset()].d)

    @cached_property
    def sample(self) -> Columns:
        """Columns on a few rows, see `sampled`; these, where they are few."""
        equations = self._equations[frozenset()]
        few = sampled(equations)
        return self if few is equations else Columns(few)

    @cached_property
    def inertia_slope(self) -> InertiaSlope | None:
        """Gain of the likelihood with the inertia of joints without a motor; None for none."""
        found = InertiaSlope(self._equations[frozenset()])
        return found if found.joints.size else None

    def corrected(self, w: np.ndarray | None, within: float = 0.0) -> ObservedMotion:
        """Return the motion of a robot with changed bodies, or with others that differ so little.

        Args:
            w: (p,) change of the bodies; None for none.
            within: difference that may be [standard deviations of the prior].
        """
        motion = self._equations[frozenset()].motion
        if w is None or not w.any():
            return motion
        key = w.tobytes()
        if within > 0.0:
            near = (k for k in self._motions if np.abs(np.frombuffer(k) - w).max() <= within)
            key = next(near, key)
        if key not in self._motions:
            others, too_many = self._motions.values(), len(self._motions) > 20
            if too_many or sum(o.remembered for o in others) > MOST_SLOPES:
                for other in others:  # columns of theirs, which are kept, hold them
                    other.forget()
            if too_many:
                self._motions.clear()
            self._motions[key] = self._equations[frozenset()].with_bodies(motion, w)
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
        return self.seen(candidate, equations, motion).x

    def seen(self, candidate: EffectAt, equations: Equations, motion: ObservedMotion) -> Seen:
        """Return the filtered columns of the place in a motion, with their products."""
        is_inertial, joint = candidate.effect.is_inertial, candidate.place.joint
        key = (*candidate.form, motion)
        return self._kept(
            key, equations, joint, lambda: candidate.columns(motion), is_inertial=is_inertial
        )

    def bank(
        self, starts: Sequence[EffectAt], equations: Equations, motion: ObservedMotion
    ) -> Seen:
        """Return the filtered columns of several shapes of one law at one place, side by side.

        Those of a law that is small are to first order in its size.
        """
        place, effect = starts[0].place, starts[0].effect
        small = effect.small

        def columns() -> np.ndarray:
            made = [
                s.columns(motion) if small is None else small.columns(motion, place, s.shape)
                for s in starts
            ]
            assert len({x.shape for x in made}) == 1
            return np.concatenate(made, axis=-1)

        key = (*starts[0].form, np.stack([s.shape for s in starts]).tobytes(), motion, 'bank')
        is_inertial = effect.is_inertial and small is None
        return self._kept(
            key, equations, place.joint, columns, is_inertial=is_inertial, count=len(starts)
        )

    def bins(
        self, effect: Effect, place: Place, equations: Equations
    ) -> tuple[Seen, np.ndarray] | None:
        """Return the filtered columns of narrow bins of the range, and their edges, if any."""
        key, motion = (effect.key, place, 'bins'), equations.motion
        if key not in self._edges:
            made = effect.bins(motion, place)
            self._edges[key] = None if made is None else made[1]
        edges = self._edges[key]
        if edges is None:
            return None

        def columns() -> np.ndarray:
            made = effect.bins(motion, place)
            assert made is not None
            return made[0]

        return self._kept(key, equations, place.joint, columns), edges

    def _kept(
        self, key: tuple[object, ...], equations: Equations, joint: int,
        make: Callable[[], np.ndarray], *, is_inertial: bool = False, count: int = 1,
    ) -> Seen:  # fmt: skip
        # what acts on one joint depends on whether that one is held, on no other
        keys = (*key, bool(equations.is_never_held[max(joint, 0)])), (*key, equations)
        for known in keys:
            if known in self._known:
                self._known[known] = found = self._known.pop(known)  # the last one to be forgotten
                return found
        raw = make()
        x = equations.compact(raw, joint, is_inertial=is_inertial)
        found = Seen(equations, x, joint, count)
        self._held += found.x.size
        while self._held > MOST_HELD and self._known:
            self._held -= self._known.pop(next(iter(self._known))).x.size
        self._known[keys[raw.ndim == 3]] = found
        return found


@dataclass(frozen=True, eq=False)
class Seen:
    """Filtered columns with their products, which no scale of the rows changes.

    Attributes:
        x: (N, m) of one joint, or (N, k, m).
        joint: whose rows they are, where they are of one.
        count: of candidates whose columns lie side by side.
    """

    equations: Equations
    x: np.ndarray
    joint: int
    count: int = 1

    @cached_property
    def rows(self) -> dict[int, np.ndarray]:
        """Columns by joint, (N, m) each."""
        if self.x.ndim == 2:
            return {self.joint: self.x}
        return {j: self.x[:, j] for j in range(self.x.shape[1])}

    @cached_property
    def squares(self) -> dict[int, np.ndarray]:
        """Products of the columns of each candidate by joint, (count, m / count, m / count)."""
        at, found = np.arange(self.count), {}
        for j, x in self.rows.items():
            if x.shape[1] == self.count:
                found[j] = np.einsum('ns,ns->s', x, x)[:, None, None]
            else:  # products of one candidate with another are thrown away, and yet faster
                found[j] = (x.T @ x).reshape(self.count, -1, self.count, x.shape[1] // self.count)
                found[j] = found[j][at, :, at]
        return found

    @cached_property
    def explained(self) -> dict[int, np.ndarray]:
        """Products of the bases of bodies with the columns by joint, (r_j, m) each."""
        factors = self.equations.factors
        return {j: factors[j].Q.T @ x for j, x in self.rows.items()}


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
