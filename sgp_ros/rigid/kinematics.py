"""Points of a link while a robot moves, and the efforts that forces on them take."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sgp_ros.rigid.rigid_geometry import full_motion, geometry
from sgp_ros.rigid.tree import Tree


@dataclass(frozen=True, slots=True, eq=False)
class LinkMotion:
    """Motion of a link at n positions of the k joints that move on their own.

    Where a point of the link is and how it moves are linear in its coordinates in the frame of the
    joint of the link, `x = p + R at`. All directions are along the axes of the root. Samples come
    last in memory.

    Attributes:
        places: (4, 3, n) R by its columns, and p [m].
        moves: (4, k, 3, n) their slopes along the motion of each joint.
    """

    places: np.ndarray
    moves: np.ndarray

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
        places = np.stack([*np.moveaxis(R, 2, 0), p])
        moves = np.zeros((4, g.size, len(q), 3))
        for i, axis, start in zip(chain, axes, starts, strict=True):
            arms = np.stack([*places[:3], p - start])
            slope = np.cross(axis, arms)
            if g.slidings[i]:
                slope = np.stack([*np.zeros_like(arms[:3]), axis])
            moves[:, g.rows[i]] += g.gains[i] * slope
        last = [np.ascontiguousarray(np.swapaxes(x, -1, -2)) for x in (places, moves)]
        return cls(*last)

    def points(self, at: np.ndarray) -> np.ndarray:
        """Return where a point `at` (3,) of the link is, (n, 3) [m]."""
        return _at(self.places, at).T

    def columns(self, at: np.ndarray) -> np.ndarray:
        """Return the efforts of a unit force along each root axis on a point, (n, k, 3).

        They are the transposed Jacobian of the point, by the principle of virtual work.
        """
        return _at(self.moves, at).transpose(2, 0, 1)


def _at(linear: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return what is linear in the coordinates of a point, (4, ...), there."""
    return (np.append(at, 1.0) @ linear.reshape(4, -1)).reshape(linear.shape[1:])
