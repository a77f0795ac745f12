"""Everyday unknowns beside which errors of a connection are looked for, and what they leave."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from sgp_ros.diagnosis.compare.parallel_filter import ParallelFilter
from sgp_ros.diagnosis.criteria import PER_PARAMETER, STATED_ERROR
from sgp_ros.physics.memory import bristle
from sgp_ros.robots.observed_motion import ObservedMotion

PLAIN, EVERYDAY = 4, 8
"""Forces of a joint: viscous and dry friction, an offset, a rotor; these and presliding."""
_PERIODS = (0.125, 0.4, 1.2, 3.6)
"""Times in which friction builds up, in periods of the cut-off."""
_ROUNDS = 4
_NONE = 1e12
"""Prior precision of what is not there."""
FRICTION = 0.3
"""Prior standard deviation of friction and offset, relative to the rms of the joint's effort."""


class Set(NamedTuple):
    """Unknowns that are there.

    Attributes:
        level: 0 none, 1 bodies or rotors, 2 friction too, 3 a load too.
        accuracy: errors of bodies of the robot file, relative to their usual prior.
        builds_up: whether friction may.
    """

    level: int
    accuracy: float
    builds_up: bool = True

    @property
    def price(self) -> float:
        """Price of bodies that are further off than those of most files [nats]."""
        return PER_PARAMETER * (self.accuracy > STATED_ERROR)


SETS = (
    Set(0, STATED_ERROR),
    *(Set(level, accuracy) for accuracy in (1.0, STATED_ERROR) for level in (1, 2, 3)),
    Set(2, 1.0, builds_up=False),
)
OF_BODIES, OF_ROTORS, SUDDEN = range(len(SETS) - 1), range(3), len(SETS) - 1
"""Numbers of those that are compared with unknown bodies, and with known ones, and of that with
friction that turns at once, which is tried only if asked for."""
OF_MOST = SETS.index(Set(2, STATED_ERROR)), SETS.index(Set(2, 1.0))
"""Numbers of those that most robots have, with unknown bodies and with known ones."""


@dataclass(frozen=True, eq=False)
class Agreement:
    """How well a corrected recording agrees with its robot.

    Attributes:
        evidence: logarithm, best of the sets of unknowns [nats].
        unknowns: number of the set of `SETS` that is best.
        left: (k,) share of the mean squared effort that is left with them.
        discrepancy: (N, k) from the nominal robot, relative to the rms effort of each joint.
        rest: (N, k) what is left of it with the unknowns.
        share: (k,) `left` with the errors of signals and filters that no model explains.
        rows: of all that count as independent.
        nominal: (k,) share that the nominal robot leaves, of which a part has another shape.
    """

    evidence: float
    unknowns: int
    left: np.ndarray
    discrepancy: np.ndarray
    rest: np.ndarray
    share: np.ndarray
    rows: float
    nominal: np.ndarray

    @property
    def accuracy(self) -> float:
        """Errors of bodies of the robot file that explain it best, relative to the usual prior."""
        return SETS[self.unknowns].accuracy

    def leaves_less(self, other: Agreement) -> bool:
        """Return whether less of the efforts is left; stiffer drives move with less error."""
        return float(np.log(self.share / other.share).sum()) < 0.0

    def distance(self, other: Agreement) -> float:
        """Return the greatest share of a joint's effort by which two discrepancies differ."""
        return float(((self.discrepancy - other.discrepancy) ** 2).mean(axis=0).max())


@dataclass(frozen=True, eq=False)
class Products:
    """Products of the columns of p bodies and eight everyday forces, joint by joint.

    Means over the rows.

    Attributes:
        G: (k, p + 8, p + 8) with themselves.
        g: (k, p + 8) with the discrepancy.
        squares: (k,) of the discrepancy.
    """

    G: np.ndarray
    g: np.ndarray
    squares: np.ndarray

    def weighted(self, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the sums over joints with weights (k,), (P, P) and (P,) for P = p + 8 k."""
        k, p = len(weight), self.G.shape[1] - EVERYDAY
        G, g = self.G * weight[:, None, None], self.g * weight[:, None]
        A, b = np.zeros((p + EVERYDAY * k,) * 2), np.zeros(p + EVERYDAY * k)
        A[:p, :p], b[:p] = G[:, :p, :p].sum(axis=0), g[:, :p].sum(axis=0)
        for j in range(k):
            own = slice(p + EVERYDAY * j, p + EVERYDAY * (j + 1))
            A[:p, own], A[own, :p], A[own, own] = G[j, :p, p:], G[j, p:, :p], G[j, p:, p:]
            b[own] = g[j, p:]
        return A, b

    def left(self, b: np.ndarray) -> np.ndarray:
        """Return the mean squares (k,) that unknowns b (p + 8 k,) leave."""
        k, p = len(self.squares), self.G.shape[1] - EVERYDAY
        own = np.concatenate([np.tile(b[:p], (k, 1)), b[p:].reshape(k, EVERYDAY)], axis=1)
        twice = 2.0 * self.g - (self.G @ own[:, :, None])[:, :, 0]
        return np.maximum(self.squares - (own * twice).sum(axis=1), 0.0)


class Explained(NamedTuple):
    """Efforts as a set of unknowns explains them.

    Attributes:
        evidence: logarithm [nats].
        variance: (k,) mean squares that are left, with those that no model explains.
        b: (p + 8 k,) the unknowns; 0 for those that are not there.
    """

    evidence: float
    variance: np.ndarray
    b: np.ndarray


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Filtered efforts of a motion, by everyday unknowns.

    Attributes:
        nominal: (N, k) of the nominal robot [N m or N].
        bodies: (N, k, p) per standard deviation of each inertial parameter's change.
        friction: (N, k, 8) of a unit of viscous and dry friction, of an offset, of a rotor at
            each joint, of none where the size of its inertia would be open, and of what dry
            friction lacks while it builds up, over ways from short to long.
    """

    nominal: np.ndarray
    bodies: np.ndarray
    friction: np.ndarray

    @classmethod
    def of(
        cls, motion: ObservedMotion, regressor: np.ndarray, low: ParallelFilter,
        directions: np.ndarray, moving: np.ndarray, *, has_rotors: bool,
    ) -> Unknowns:  # fmt: skip
        """Return those of a motion with its regressor (n, k, 10 b), behind a filter.

        Rows in which a joint is not `moving` (n, k) are left out of its equation. Rotors are there
        where efforts are explained: of a motion they leave the size of all inertia open. Of
        friction that builds up in a short time only the impulse that it lacks is seen.
        """
        tree, v = motion.tree, motion.velocity * moving
        k = tree.size
        Y = low(regressor if moving.all() else regressor * moving[:, :, None])
        nominal = Y @ tree.parameters.ravel() + low(tree.damping[:k] * v)
        bodies = -(Y.reshape(len(Y) * k, -1) @ directions.T).reshape(len(Y), k, -1)
        size = np.maximum(np.sqrt((v * v).mean(axis=0)), 1e-12)
        a = motion.acceleration * (moving * has_rotors)
        a = a / np.maximum(np.sqrt((a * a).mean(axis=0)), 1e-12)
        pace = np.sqrt((motion.acceleration**2).mean(axis=0))
        parts = [v / size, motion.direction * moving, 1.0 * moving, a]
        for periods in _PERIODS:
            ways = np.maximum(0.5 * (periods / low.cutoff) ** 2 * pace, 1e-12)
            both = zip(motion.position.T, ways, strict=True)
            built = np.column_stack([bristle(q, float(way)) for q, way in both])
            parts.append((built - motion.direction) * moving)
        friction = np.stack(parts, axis=2)
        return cls(nominal, bodies, low(friction))

    def of_known_bodies(self, acceleration: np.ndarray, rotors: np.ndarray) -> Unknowns:
        """Return those with rotors for bodies, and without viscous friction and other rotors.

        Args:
            acceleration: filtered (N, k).
            rotors: typical inertias of the joints, (k, k) diagonal.
        """
        friction = self.friction.copy()
        friction[:, :, [0, 3]] = 0.0
        return replace(self, bodies=-acceleration[:, :, None] * rotors, friction=friction)

    @cached_property
    def _squares(self) -> np.ndarray:
        X = np.concatenate([self.bodies, self.friction], axis=2).transpose(1, 0, 2)
        return X.transpose(0, 2, 1) @ X / X.shape[1]

    def products(self, d: np.ndarray, size: np.ndarray) -> Products:
        """Return the products for a discrepancy (N, k) and forces of these sizes (k,)."""
        (N, k), p = d.shape, self.bodies.shape[2]
        scale = np.ones((k, p + EVERYDAY))
        scale[:, p:] = size[:, None]
        g = np.empty((k, p + EVERYDAY))
        for j in range(k):
            g[j, :p], g[j, p:] = self.bodies[:, j].T @ d[:, j], self.friction[:, j].T @ d[:, j]
        G = self._squares * scale[:, :, None] * scale[:, None, :]
        return Products(G, g * scale / N, (d**2).mean(axis=0))

    def force(self, b: np.ndarray, size: np.ndarray) -> np.ndarray:
        """Return the efforts of unknowns b (p + 8 k,), (N, k) [N m or N]."""
        k, p = self.bodies.shape[1:]
        each = b[p:].reshape(k, EVERYDAY) * size[:, None]
        return self.bodies @ b[:p] + (self.friction * each).sum(axis=2)


def explained(
    products: Products, kind: Set, power: np.ndarray, floor: np.ndarray, rows: float,
    precision: np.ndarray | None = None,
) -> Explained:  # fmt: skip
    """Return the evidence of efforts with a set of unknowns.

    Args:
        products: of the discrepancy and the columns.
        kind: unknowns that are there.
        power: (k,) mean squared efforts.
        floor: (k,) mean squares that no model explains.
        rows: number that counts as independent.
        precision: (p, p) of the prior of bodies, where it is not that of their accuracy.
    """
    k, p = len(power), products.G.shape[1] - EVERYDAY
    b = np.zeros(p + EVERYDAY * k)
    count = (0, p, len(b))[min(kind.level, 2)]
    prior = np.eye(count)
    if count:
        prior[:p, :p] = np.eye(p) / kind.accuracy**2 if precision is None else precision
    if not kind.builds_up:
        built = [p + EVERYDAY * j + i for j in range(k) for i in range(PLAIN, EVERYDAY)]
        prior[built, built] = _NONE
    variance, occam = products.squares + floor, 0.0
    for _ in range(_ROUNDS if count else 0):
        A, g = products.weighted(rows / variance)
        A = A[:count, :count] + prior
        try:
            b[:count] = np.linalg.solve(A, g[:count])
        except np.linalg.LinAlgError:  # units so far off that nothing can be computed
            return Explained(-math.inf, variance, np.zeros(len(b)))
        variance = products.left(b) + floor
    if count:
        occam = 0.5 * float(np.linalg.slogdet(A)[1] - np.linalg.slogdet(prior)[1])
    own = b[:count]
    value = -0.5 * rows * float(np.log(variance / power).sum()) - 0.5 * float(own @ prior @ own)
    return Explained(value - occam, variance, b)
