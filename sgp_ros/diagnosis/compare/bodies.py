"""Wrong inertial parameters: their prior, and the columns of one joint that follow.

A body may have another mass, another centre, another inertia: ten changes of one standard
deviation each. What they do to a joint is factored once, for every scale of its rows.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from sgp_ros.rigid.tree import Tree

SPREAD = 0.25
"""Prior standard deviation of mass and inertia, relative; of the centre, to the radius."""
OPEN_SPREAD = 1.0
"""The same of bodies that the robot file leaves open."""

_SMALLEST = 1e-3
"""Of the nominal size, the least that bodies are taken for."""
LOAD = 0.25
"""Prior standard deviation of the mass of a load at a tip, relative to all that moves."""
_TOOL = 0.15
"""Distance of a load beyond an outermost link, relative to the length of the robot."""


@dataclass(frozen=True, eq=False)
class Factor:
    """Base of one joint (N, p) as `Q @ R`, which no scale of its rows changes.

    A frame scales the rows of each joint by another number. Only the small triangles are factored
    again then: `[R_1 / s_1; ...; R_k / s_k; I] = S R` gives the basis `diag(Q_1, ..., Q_k, I) S`
    of all rows, orthonormal to rounding. O(k p^3) a frame instead of O(N k p^2).

    Attributes:
        Q: (N, r) orthonormal, of the columns that are not zero.
        R: (r, p).
    """

    Q: np.ndarray
    R: np.ndarray

    @classmethod
    def of(cls, base: np.ndarray) -> Factor:
        """Return the factor of a base (N, p)."""
        seen = np.flatnonzero(base.any(axis=0))
        Q, own = np.linalg.qr(base[:, seen])
        R = np.zeros((len(own), base.shape[1]))
        R[:, seen] = own
        return cls(Q, R)


def body_directions(
    tree: Tree, unstated: Collection[int] = (), accuracy: float = 1.0
) -> np.ndarray:
    """Return changes of the inertial parameters, one standard deviation each, (p, 10 b).

    Per body: mass at the same centre and size, the centre along three axes, six entries of the
    inertia about the centre.

    Args:
        tree: nominal robot.
        unstated: bodies that its file leaves open.
        accuracy: by which the deviations of all others are multiplied.
    """
    rows = []
    for body, values in enumerate(tree.parameters):
        spread = OPEN_SPREAD if body in unstated else SPREAD * accuracy
        mass = max(float(values[0]), 1e-6)
        c = values[1:4] / mass
        about = 0.5 * (values[4] + values[6] + values[9])
        radius = float(np.sqrt(max(about / mass, 1e-6)))
        shift = np.array(_point(c))
        own = values[4:] - mass * shift
        size = float(np.clip(own[[0, 2, 5]].mean(), 1e-3 * mass * radius**2, None))
        changes = np.zeros((10, 10))
        changes[0] = spread * values
        for axis in range(3):
            e = np.eye(3)[axis] * 0.5 * spread * radius
            changes[1 + axis, 1:4] = mass * e
            changes[1 + axis, 4:] = mass * (_point(c + e) - _point(c - e)) / 2.0
        for entry in range(6):
            changes[4 + entry, 4 + entry] = spread * size
        full = np.zeros((10, tree.parameters.size))
        full[:, 10 * body : 10 * body + 10] = changes
        rows.append(full)
    return np.concatenate(rows)


def shrinkage(directions: np.ndarray, tree: Tree, w: np.ndarray) -> float:
    """Return what bodies cost that are much smaller than those of the robot [nats].

    The normal prior of their change reaches bodies of no size within a few deviations. Size is a
    scale: this is by how much the same prior of its logarithm costs more.

    Args:
        directions: (p, 10 b) of `body_directions`.
        tree: nominal robot.
        w: (p,) change in these directions.
    """
    mass = tree.parameters[:, 0]
    spread = np.diagonal(directions)[::10] / np.maximum(mass, 1e-300)
    spread = np.where(spread > 0.0, spread, 1.0)
    size = np.clip(1.0 + spread * w[::10], _SMALLEST, 1.0)
    return 0.5 * float(((np.log(size) ** 2 - (1.0 - size) ** 2) / spread**2).sum())


def load_precision(directions: np.ndarray, tree: Tree, accuracy: float = 1.0) -> np.ndarray:
    """Return the inverse covariance of changes w (p,) with loads on outermost links, (p, p).

    Without a load it is `1 / accuracy^2`. A load has a mass, a first moment and an inertia of
    their own, which are unknown; a link without any inertia carries none.

    Args:
        directions: (p, 10 b) of `body_directions`.
        tree: nominal robot.
        accuracy: standard deviation of changes without a load.
    """
    precision = np.eye(len(directions)) / accuracy**2
    mass = LOAD * float(tree.parameters[:, 0].sum())
    tool = _TOOL * float(np.linalg.norm(tree.translations, axis=1).sum())
    for tip in tree.outermost:
        values, own = tree.parameters[tip], slice(10 * tip, 10 * tip + 10)
        if values[0] > 0.0:
            about = 0.5 * (values[4] + values[6] + values[9])
            far = float(np.sqrt(max(about / float(values[0]), 1e-6))) + tool
            load = mass * np.array([1.0, far, far, far, *[far * far] * 6])
            X = np.linalg.solve(directions[own, own].T, np.diag(load))  # w of each load
            precision[own, own] = np.linalg.inv(accuracy**2 * np.eye(10) + X @ X.T)
    return precision


def _point(c: np.ndarray) -> np.ndarray:
    """Return xx, xy, yy, xz, yz, zz of a unit mass at c."""
    x, y, z = c
    return np.array([y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y])
