"""A chain of revolute joints with friction: torques by the Newton-Euler recursion.

Each link carries its velocity and acceleration to the next one, then hands its force and moment
back (Luh, Walker, Paul 1980). All functions take any number of leading dimensions, so that many
states cost little more than one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

GRAVITY = 9.81
"""Acceleration of gravity along -z [m/s^2]."""
_SKEW = np.zeros((3, 9))
"""`(w @ _SKEW).reshape(3, 3) x` is `w cross x`."""
_SKEW[[0, 1, 2], [7, 2, 3]] = 1.0
_SKEW[[0, 1, 2], [5, 6, 1]] = -1.0
_ENTRIES = ([0, 1, 1, 2, 2, 2], [0, 0, 1, 0, 1, 2])


@dataclass(frozen=True, slots=True)
class ArmLink:
    """A link and the revolute joint that carries it; its frame lies in the joint.

    Attributes:
        axis: (3,) unit vector of the joint.
        offset: (3,) from the joint before to this one, in the frame of the link before [m].
        mass: [kg].
        centre: (3,) centre of mass [m].
        inertia: xx, xy, yy, xz, yz, zz of the inertia tensor about the centre of mass [kg m^2].
    """

    axis: tuple[float, float, float]
    offset: tuple[float, float, float]
    mass: float
    centre: tuple[float, float, float]
    inertia: tuple[float, float, float, float, float, float]

    @property
    def tensor(self) -> np.ndarray:
        """The inertia tensor about the centre of mass, (3, 3) [kg m^2]."""
        xx, xy, yy, xz, yz, zz = self.inertia
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    def parameters(self) -> np.ndarray:
        """Return mass, mass times centre, and the inertia tensor about the joint, (10,).

        The tensor is in the order xx, xy, yy, xz, yz, zz [kg, kg m, kg m^2].
        """
        c = np.array(self.centre)
        tensor = self.tensor + self.mass * ((c @ c) * np.eye(3) - np.outer(c, c))
        return np.concatenate([[self.mass], self.mass * c, tensor[_ENTRIES]])


@dataclass(frozen=True, slots=True)
class JointFriction:
    """Friction of one joint, whose dry part grows linearly towards both limits.

    `(coulomb + growth ramp(q)) tanh(v / width) + viscous v`, where the ramp is 0 further than
    `onset` from both limits and 1 at a limit.

    Attributes:
        viscous: [N m s/rad].
        coulomb: dry friction in the middle of the range [N m].
        growth: what is added to it at a limit [N m].
        lower: limit of the position [rad].
        upper: limit of the position [rad].
        onset: distance from a limit at which the growth begins [rad].
    """

    viscous: float
    coulomb: float
    growth: float = 0.0
    lower: float = -math.pi
    upper: float = math.pi
    onset: float = 1.0

    def near_limits(self, position: np.ndarray) -> np.ndarray:
        """Return the dry friction beyond `coulomb` at positions of any shape [N m]."""
        distance = np.minimum(position - self.lower, self.upper - position)
        return self.growth * np.clip(1.0 - distance / self.onset, 0.0, None)


class SerialArm:
    """The true dynamics of an arm of k revolute joints.

    Args:
        links: k of them, from the base on.
        frictions: of the k joints.
        width: speed at which the dry friction has 76 % of its size [rad/s].
    """

    def __init__(
        self, links: tuple[ArmLink, ...], frictions: tuple[JointFriction, ...], width: float
    ) -> None:
        self.links = links
        self.frictions = frictions
        self.width = width
        self._axes = np.array([link.axis for link in links], dtype=np.float64)
        self._turn = _skew(self._axes)  # (k, 3, 3)
        self._turn_squared = self._turn @ self._turn
        self._offsets = np.array([link.offset for link in links], dtype=np.float64)
        self._moments = np.array([link.mass * np.array(link.centre) for link in links])
        self._spread = np.array([_second_moment(link) for link in links])  # (k, 3, 3)
        self._viscous = np.array([f.viscous for f in frictions])
        self._coulomb = np.array([f.coulomb for f in frictions])

    def rigid_torque(
        self, q: np.ndarray, v: np.ndarray, a: np.ndarray, gravity: float | np.ndarray = GRAVITY
    ) -> np.ndarray:
        """Return the torques of a motion without friction, (..., k) [N m]; O(k).

        Args:
            q: (..., k) positions [rad].
            v: (..., k) velocities [rad/s].
            a: (..., k) accelerations [rad/s^2].
            gravity: acceleration of gravity along -z [m/s^2], a number or (...).
        """
        R = self._rotations(q)
        v, a = np.broadcast_arrays(v, a)
        w, dw = np.zeros((*v.shape[:-1], 3)), np.zeros((*v.shape[:-1], 3))
        origin = np.zeros_like(w)
        origin[..., 2] = gravity
        A = np.zeros((*w.shape, 3))  # a point x of the link accelerates by origin + A x
        forces, moments = [], []
        for i, link in enumerate(self.links):
            to_link = np.swapaxes(R[..., i, :, :], -1, -2)
            spin = v[..., i, None] * self._axes[i]
            origin = _times(to_link, origin + A @ self._offsets[i])
            w_before = _times(to_link, w)
            w = w_before + spin
            dw = _times(to_link, dw) + _times(_skew(w_before), spin)
            dw = dw + a[..., i, None] * self._axes[i]
            W = _skew(w)
            A = _skew(dw) + W @ W
            forces.append(link.mass * origin + A @ self._moments[i])
            moments.append(_times(_skew(self._moments[i]), origin) + _axial(A @ self._spread[i]))
        return self._collected(R, forces, moments)

    def friction(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return the torques that overcome friction at states (..., k), (..., k) [N m]."""
        extra = [f.near_limits(q[..., i]) for i, f in enumerate(self.frictions)]
        dry = self._coulomb + np.stack(extra, axis=-1)
        return dry * np.tanh(v / self.width) + self._viscous * v

    def inverse_dynamics(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the torques that a motion takes, friction included, (..., k) [N m].

        Arguments as in `rigid_torque`.
        """
        return self.rigid_torque(q, v, a) + self.friction(q, v)

    def acceleration(self, q: np.ndarray, v: np.ndarray, torque: np.ndarray) -> np.ndarray:
        """Return the accelerations under torques (..., k), (..., k) [rad/s^2].

        The columns of the mass matrix are torques of unit accelerations at rest without gravity.
        """
        k = len(self.links)
        unit = np.vstack([np.eye(k), np.zeros(k)])  # (k + 1, k), the last row for the bias
        weight = np.append(np.zeros(k), 1.0)
        speed = weight[:, None] * v[..., None, :]
        rows = self.rigid_torque(q[..., None, :], speed, unit, GRAVITY * weight)
        bias = rows[..., k, :] + self.friction(q, v)
        M = rows[..., :k, :]  # (..., k, k), symmetric
        return np.linalg.solve(M, (torque - bias)[..., None])[..., 0]

    def _rotations(self, q: np.ndarray) -> np.ndarray:
        """Return the rotations from each link to the one before, (..., k, 3, 3)."""
        sine, versine = np.sin(q)[..., None, None], 1.0 - np.cos(q)[..., None, None]
        return np.eye(3) + sine * self._turn + versine * self._turn_squared

    def _collected(
        self, R: np.ndarray, forces: list[np.ndarray], moments: list[np.ndarray]
    ) -> np.ndarray:
        """Hand forces and moments of the links back to the base; return the joint torques."""
        torque = np.zeros((*forces[0].shape[:-1], len(self.links)))
        force, moment = forces[-1], moments[-1]
        for i in range(len(self.links) - 1, -1, -1):
            torque[..., i] = moment @ self._axes[i]
            if i > 0:
                force = _times(R[..., i, :, :], force)
                moment = _times(R[..., i, :, :], moment)
                moment = moments[i - 1] + moment + _times(_skew(self._offsets[i]), force)
                force = forces[i - 1] + force
        return torque


def _skew(x: np.ndarray) -> np.ndarray:
    """Return the matrices of the cross products with x, (..., 3, 3)."""
    return (x @ _SKEW).reshape(*x.shape, 3)


def _axial(M: np.ndarray) -> np.ndarray:
    """Return the sum of `rho cross (A rho)` over the mass, (..., 3), from M = A sum(rho rho^T)."""
    return M.reshape(*M.shape[:-2], 9) @ _SKEW.T


def _times(R: np.ndarray, x: np.ndarray) -> np.ndarray:
    return (R @ x[..., None])[..., 0]


def _second_moment(link: ArmLink) -> np.ndarray:
    """Return the sum of `rho rho^T` over the mass about the joint, (3, 3) [kg m^2]."""
    c = np.array(link.centre)
    return 0.5 * np.trace(link.tensor) * np.eye(3) - link.tensor + link.mass * np.outer(c, c)
