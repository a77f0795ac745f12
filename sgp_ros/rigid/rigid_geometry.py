"""Inputs of the compiled loops over a kinematic tree: its constants, and its joints' motion.

Each body is described in the frame of its joint.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from sgp_ros.rigid.tree import Tree


class Geometry(NamedTuple):
    """Constants of a tree of b bodies for the loops; index b stands for the root.

    Attributes:
        order: (b,) bodies from the root outwards.
        parents: (b,) body each hangs on.
        turns: (b, 3, 3, 3) with `R(q) = turns[0] + sin(q) turns[1] + (1 - cos(q)) turns[2]`.
        starts: (b, 3) origin of the joint in the frame of its parent, at position 0 [m].
        slides: (b, 3) way of that origin per position; 0 for a turning joint.
        axes: (b, 3) in the frame of the joint.
        slidings: (b,) whether a joint slides.
        rows: (b,) independent joint that each follows.
        gains: (b,) multiplier of its motion.
        size: number of independent joints k.
    """

    order: np.ndarray
    parents: np.ndarray
    turns: np.ndarray
    starts: np.ndarray
    slides: np.ndarray
    axes: np.ndarray
    slidings: np.ndarray
    rows: np.ndarray
    gains: np.ndarray
    size: int


def full_motion(
    tree: Tree, q: np.ndarray, v: np.ndarray, a: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the motion of all b joints, also of those that follow others."""
    # copies, so that the loops are compiled for arrays that may be written to alone
    q, v, a = (np.array(x, dtype=np.float64, order='C') for x in (q, v, a))
    k = geometry(tree).size
    if not q.shape == v.shape == a.shape or q.ndim != 2 or q.shape[1] != k:
        raise ValueError(f'motions {q.shape}, {v.shape}, {a.shape} for {k} joints')
    if k == len(tree.parents):
        return q, v, a
    q, v, a = (np.take(x, tree.follows, axis=1) * tree.multipliers for x in (q, v, a))
    return q + tree.offsets, v, a


@lru_cache(maxsize=64)
def geometry(tree: Tree) -> Geometry:
    """Return what the loops read of a tree; kept, as every call needs it."""
    b = len(tree.parents)
    x, y, z = tree.axes.T
    O = np.zeros(b)  # noqa: E741  # the zero of the cross-product matrix
    K = np.array([[O, -z, y], [z, O, -x], [-y, x, O]]).transpose(2, 0, 1)
    K[tree.is_prismatic] = 0.0
    R = tree.rotations
    slides = np.einsum('brc,bc->br', R, tree.axes) * tree.is_prismatic[:, None]
    return Geometry(
        order=np.array(tree.outward_order()),
        parents=np.where(tree.parents < 0, b, tree.parents),
        turns=np.ascontiguousarray(np.stack([R, R @ K, R @ K @ K], axis=1)),
        starts=tree.translations.copy(),
        slides=slides,
        axes=tree.axes.copy(),
        slidings=tree.is_prismatic.copy(),
        rows=tree.follows.copy(),
        gains=tree.multipliers.copy(),
        size=tree.size,
    )
