"""Random trees of joints with friction, their torques by Newton and Euler in any precision.

Each link moves with its joint; velocity and acceleration pass outwards, forces come back inwards
(Luh, Walker, Paul 1980), here once for every one of the ten inertial parameters of each link, in
which they are linear. In extended precision the rank of what comes out is beyond doubt, which is
what the study of identifiability needs as its truth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

GRAVITY = 9.81
"""Acceleration of gravity along -z [m/s^2]."""


@dataclass(frozen=True, slots=True, eq=False)
class RandomTree:
    """k links, each on a revolute or prismatic joint.

    Attributes:
        parents: (k,) index of the link that carries each joint, -1 for the base.
        is_prismatic: (k,) of bool.
        axes: (k, 3) unit vectors, in the frame of the joint.
        rotations: (k, 3, 3) from the frame of the joint at zero to that of the parent.
        offsets: (k, 3) of the joint in the frame of the parent [m].
        inertias: (k, 10) mass, first moment, inertia tensor xx, xy, yy, xz, yz, zz about the
            joint [kg, kg m, kg m^2].
        viscous: (k,) friction [N m s/rad or N s/m].
        coulomb: (k,) friction [N m or N].
    """

    parents: tuple[int, ...]
    is_prismatic: tuple[bool, ...]
    axes: np.ndarray
    rotations: np.ndarray
    offsets: np.ndarray
    inertias: np.ndarray
    viscous: np.ndarray
    coulomb: np.ndarray

    @property
    def parameters(self) -> np.ndarray:
        """All parameters, (12 k,): ten of each link, then viscous, then Coulomb friction."""
        return np.concatenate([self.inertias.ravel(), self.viscous, self.coulomb])

    def columns(
        self, q: np.ndarray, v: np.ndarray, a: np.ndarray, precision: type = np.float64
    ) -> np.ndarray:
        """Return the columns whose product with `parameters` is the torque, (n, k, 12 k).

        Args:
            q: positions, (n, k) [rad or m].
            v: velocities, (n, k) [rad/s or m/s].
            a: accelerations, (n, k) [rad/s^2 or m/s^2].
            precision: such as `np.longdouble`; O(n k^2) at any.
        """
        n, k = q.shape
        q, v, a = (x.astype(precision) for x in (q, v, a))
        F = np.zeros((n, k, 12 * k), dtype=precision)
        places: list[tuple[np.ndarray, np.ndarray]] = []
        states: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        zero: np.ndarray = np.zeros((n, 3), dtype=precision)
        base = (zero, zero, zero + np.array([0, 0, precision(GRAVITY)]))
        for j, parent in enumerate(self.parents):
            places.append(self._place(j, q[:, j]))
            before = base if parent < 0 else states[parent]
            states.append(self._carried(j, places[j], before, v[:, j], a[:, j]))
            force, moment = _body_columns(*states[j])  # (n, 3, 10) each
            i = j
            while i >= 0:
                axis = self._axis(i, precision)
                acting = force if self.is_prismatic[i] else moment
                F[:, i, 10 * j : 10 * j + 10] = np.einsum('c,nci->ni', axis, acting)
                rotation, offset = places[i]
                force = np.einsum('nab,nbi->nai', rotation, force)
                moment = np.einsum('nab,nbi->nai', rotation, moment)
                moment = moment + np.einsum('nab,nbi->nai', _skew(offset), force)
                i = self.parents[i]
            F[:, j, 10 * k + j], F[:, j, 11 * k + j] = v[:, j], np.sign(v[:, j])
        return F

    def _axis(self, j: int, precision: type) -> np.ndarray:
        """Return the unit vector of joint j, of length one to all digits."""
        axis = self.axes[j].astype(precision)
        return axis / np.sqrt((axis * axis).sum())

    def _place(self, j: int, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return rotation (n, 3, 3) and offset (n, 3) from the frame of link j to its parent's."""
        axis, n = self._axis(j, q.dtype.type), len(q)
        fixed, offset = self.rotations[j].astype(q.dtype), self.offsets[j].astype(q.dtype)
        fixed = fixed @ (3 * np.eye(3) - fixed.T @ fixed) / 2  # orthogonal to all digits
        if self.is_prismatic[j]:
            return np.tile(fixed, (n, 1, 1)), offset + np.outer(q, fixed @ axis)
        S = _skew(axis[None])[0]
        turn = (
            np.eye(3, dtype=q.dtype)
            + np.sin(q)[:, None, None] * S
            + (1 - np.cos(q))[:, None, None] * (S @ S)
        )
        return fixed @ turn, np.tile(offset, (n, 1))

    def _carried(
        self,
        j: int,
        place: tuple[np.ndarray, np.ndarray],
        before: tuple[np.ndarray, np.ndarray, np.ndarray],
        v: np.ndarray,
        a: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return spin, its rate, and acceleration less gravity of the origin of link j, (n, 3)."""
        rotation, offset = place
        spin, rate, acceleration = before
        acceleration = (
            acceleration + np.cross(rate, offset) + np.cross(spin, np.cross(spin, offset))
        )
        spin, rate, acceleration = (
            np.einsum('nba,nb->na', rotation, x) for x in (spin, rate, acceleration)
        )
        along, pushed = (np.outer(x, self._axis(j, v.dtype.type)) for x in (v, a))
        if self.is_prismatic[j]:
            return spin, rate, acceleration + pushed + 2 * np.cross(spin, along)
        return spin + along, rate + pushed + np.cross(spin, along), acceleration


def random_tree(rng: np.random.Generator, k: int) -> RandomTree:
    """Return a tree of k joints with bodies of some kilograms and decimetres.

    Half of the trees have right angles and some joints in one place, as built robots do: they
    hide more parameters than general ones. A joint hangs on the one before with probability 3/4.
    """
    is_regular = rng.random() < 0.5
    parents = [-1] + [
        j - 1 if rng.random() < 0.75 else int(rng.integers(-1, j - 1)) if j > 1 else -1
        for j in range(1, k)
    ]
    axes, rotations, offsets, inertias = [], [], [], []
    for _ in range(k):
        axis = np.eye(3)[rng.integers(3)] if is_regular else rng.normal(size=3)
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        turn = turn * np.linalg.det(turn)
        if is_regular:
            turn = np.eye(3)[:, rng.permutation(3)]
            turn = turn * np.linalg.det(turn)
        offset = rng.uniform(-0.4, 0.4, size=3)
        if is_regular:
            offset = offset * (rng.random(3) < 0.5)
        axes.append(axis / np.linalg.norm(axis))
        rotations.append(turn)
        offsets.append(offset)
        inertias.append(_random_body(rng))
    return RandomTree(
        tuple(parents), tuple(bool(x) for x in rng.random(k) < 0.25), np.array(axes),
        np.array(rotations), np.array(offsets), np.array(inertias),
        rng.uniform(0.05, 1.0, size=k), rng.uniform(0.05, 1.0, size=k),
    )  # fmt: skip


def _random_body(rng: np.random.Generator) -> np.ndarray:
    """Return the ten parameters of six mass points about the origin."""
    m, x = rng.uniform(0.1, 1.0, size=6), rng.normal(scale=0.15, size=3)
    x = x + rng.normal(scale=0.1, size=(6, 3))
    tensor = np.einsum('i,ij,ij->', m, x, x) * np.eye(3) - (x.T * m) @ x
    entries = tensor[[0, 1, 1, 2, 2, 2], [0, 0, 1, 0, 1, 2]]
    return np.concatenate([[m.sum()], m @ x, entries])


def _skew(x: np.ndarray) -> np.ndarray:
    """Return the matrices of `x cross` for x (n, 3), (n, 3, 3)."""
    S = np.zeros((len(x), 3, 3), dtype=x.dtype)
    S[:, [2, 0, 1], [1, 2, 0]] = x
    S[:, [1, 2, 0], [2, 0, 1]] = -x
    return S


def _body_columns(
    spin: np.ndarray, rate: np.ndarray, acceleration: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return force and moment about the origin per inertial parameter, (n, 3, 10) each.

    `f = m a + (rate x + spin x spin x) h` and `n = h x a + I rate + spin x I spin`.
    """
    force = np.zeros((len(spin), 3, 10), dtype=spin.dtype)
    moment = np.zeros_like(force)
    S = _skew(spin)
    force[:, :, 0] = acceleration
    force[:, :, 1:4] = _skew(rate) + S @ S
    moment[:, :, 1:4] = -_skew(acceleration)
    moment[:, :, 4:] = _tensor_columns(rate) + S @ _tensor_columns(spin)
    return force, moment


def _tensor_columns(x: np.ndarray) -> np.ndarray:
    """Return L with `I x = L (xx, xy, yy, xz, yz, zz)`, (n, 3, 6)."""
    L = np.zeros((len(x), 3, 6), dtype=x.dtype)
    L[:, 0, [0, 1, 3]] = x
    L[:, 1, [1, 2, 4]] = x
    L[:, 2, [3, 4, 5]] = x
    return L
