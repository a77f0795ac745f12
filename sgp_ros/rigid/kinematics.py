"""Points of a link while a robot moves, and the efforts that forces on them take."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sgp_ros.rigid.rigid_geometry import full_motion, geometry
from sgp_ros.rigid.tree import Tree


@dataclass(frozen=True, slots=True, eq=False)
class LinkMotion:
    """Motion of a link that hangs on d joints, at n positions of the k that move on their own.

    All directions are along the axes of the root.

    Attributes:
        rotation: (n, 3, 3) from the frame of its joint to that of the root.
        origin: (n, 3) of that frame [m].
        axes: (n, d, 3) of the joints.
        starts: (n, d, 3) points on these axes [m].
        slides: (d,) whether each joint slides.
        gains: (d, k) its motion per motion of the joints that move on their own.
    """

    rotation: np.ndarray
    origin: np.ndarray
    axes: np.ndarray
    starts: np.ndarray
    slides: np.ndarray
    gains: np.ndarray

    @classmethod
    def of(cls, tree: Tree, q: np.ndarray, body: int) -> LinkMotion:
        """Return that of a body of a tree at positions q (n, k) [rad or m]. O(depth)."""
        still, g = np.zeros_like(q), geometry(tree)
        full, _, _ = full_motion(tree, q, still, still)
        chain = [body]
        while tree.parents[chain[-1]] >= 0:
            chain.append(int(tree.parents[chain[-1]]))
        chain.reverse()
        R, p = np.broadcast_to(np.eye(3), (len(q), 3, 3)), np.zeros((len(q), 3))
        axes, starts = [], []
        for i in chain:
            x = full[:, i, None]
            p = p + np.einsum('nab,nb->na', R, g.starts[i] + x * g.slides[i])
            angle = np.zeros_like(x) if g.slidings[i] else x
            parts = np.ones_like(x), np.sin(angle), 1.0 - np.cos(angle)
            R = R @ np.einsum('tn,tab->nab', np.stack(parts)[..., 0], g.turns[i])
            axes.append(R @ g.axes[i])
            starts.append(p)
        gains = g.gains[chain, None] * (g.rows[chain, None] == np.arange(g.size))
        return cls(R, p, np.stack(axes, 1), np.stack(starts, 1), g.slidings[chain], gains)

    def points(self, at: np.ndarray) -> np.ndarray:
        """Return where a point `at` (3,) of the link is, (n, 3) [m]."""
        return np.asarray(self.origin + self.rotation @ at)

    def columns(self, at: np.ndarray) -> np.ndarray:
        """Return the efforts of a unit force along each root axis on a point, (n, k, 3).

        They are the transposed Jacobian of the point, by the principle of virtual work.
        """
        arms = self.points(at)[:, None] - self.starts
        J = np.where(self.slides[:, None], self.axes, np.cross(self.axes, arms))
        return np.einsum('ndx,dk->nkx', J, self.gains)
