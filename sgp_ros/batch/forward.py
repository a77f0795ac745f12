"""Forward dynamics of an identified robot, with dry friction that can hold a joint still.

A robot's physics is linear in W and affine in acceleration and effort. So its regressor alone
gives the mass matrix, the driving torque, and the level of dry friction, which is where the
torque jumps as a velocity passes through zero. A joint at rest sticks as long as the friction
that would hold it is below that level (Karnopp 1985, with a band of no width); a joint that moves
keeps the direction of its friction until its velocity is zero.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sgp_ros.physics.term import Motion
from sgp_ros.robots.robot import Robot

Residual = Callable[[np.ndarray, np.ndarray], np.ndarray]

_BESIDE_REST = 1e-200
"""A velocity so small that only its sign is felt."""
_JUMP = 1e-100


class ForcedMotion(Protocol):
    """Equations of motion `M(q) a = drive(q, v, effort)` with dry friction in the drive.

    What is called effort may hold more columns than there are joints: the functions below hand
    its rows on and never look inside.
    """

    def equations(
        self, q: np.ndarray, v: np.ndarray, effort: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return M, (m, k, k), and the drive, (m, k), of m states."""

    def level_of_dry_friction(self, q: np.ndarray, effort: np.ndarray) -> np.ndarray:
        """Return the level of dry friction of each joint, (m, k) [unit of the drive]."""


@dataclass(frozen=True, slots=True, eq=False)
class Dynamics:
    """Equations of motion `M(q) a = drive(q, v, effort)` of k joints with known coefficients.

    For a robot with target `effort`, M and drive are torques; with target `acceleration` M is
    the identity and drive the acceleration.

    Attributes:
        robot: physics linear in W.
        W: coefficients, (p,).
        residual: mean of Z from q (m, k) and v (m, k) to (m, k) [unit of the target]; None for
            none.
    """

    robot: Robot
    W: np.ndarray
    residual: Residual | None = None

    def equations(
        self, q: np.ndarray, v: np.ndarray, effort: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return M, (m, k, k), and the drive, (m, k), of m states.

        For the target `effort` both are read off one regressor of (k + 1) m rows: torques without
        acceleration, and what each unit acceleration adds.

        Args:
            q: (m, k) [rad or m].
            v: (m, k) [rad/s or m/s].
            effort: (m, k) [N m, N or the joint's command unit].
        """
        m, k = q.shape
        z = 0.0 if self.residual is None else self.residual(q, v)
        if self.robot.target == 'acceleration':
            physics = self.robot.regressor(Motion(q, v, np.zeros_like(q), effort)) @ self.W
            return np.broadcast_to(np.eye(k), (m, k, k)), physics + z
        unit = np.repeat(np.vstack([np.zeros((1, k)), np.eye(k)]), m, axis=0)
        q_s, v_s, effort_s = (np.tile(x, (k + 1, 1)) for x in (q, v, effort))
        torque = self.robot.regressor(Motion(q_s, v_s, unit, effort_s)) @ self.W
        torque = torque.reshape(k + 1, m, k)
        return np.moveaxis(torque[1:] - torque[0], 0, 2), effort - torque[0] - z

    def level_of_dry_friction(self, q: np.ndarray, effort: np.ndarray) -> np.ndarray:
        """Return the level of dry friction of each joint, (m, k) [unit of the drive].

        Half the jump of a joint's equation as its own velocity passes through zero; negative where
        W says that friction pushes. Friction that depends on the direction of another joint is
        no part of it.
        """
        m, rest = len(q), np.zeros_like(q)
        beside = np.vstack([rest + _BESIDE_REST, rest - _BESIDE_REST])
        places, none, efforts = (np.vstack([x, x]) for x in (q, rest, effort))
        physics = self.robot.regressor(Motion(places, beside, none, efforts)) @ self.W
        jump = physics[:m] - physics[m:]
        sign = -1.0 if self.robot.target == 'acceleration' else 1.0
        return np.where(np.abs(jump) > _JUMP, 0.5 * sign * jump, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class DryFriction:
    """State of dry friction until a joint stops or starts.

    Attributes:
        level: (m, k) [unit of the drive].
        side: (m, k) direction that friction opposes: -1, 1, or 0 where no dry friction is.
        sticks: (m, k), whether the joint is held at rest.
    """

    level: np.ndarray
    side: np.ndarray
    sticks: np.ndarray


def dry_friction(
    dynamics: ForcedMotion, q: np.ndarray, v: np.ndarray, effort: np.ndarray
) -> DryFriction:
    """Return which joints stick and which way friction points in the others.

    All joints at rest are taken to stick; the one whose holding force exceeds its level most is
    released in the direction of that force, until none does. O(k) solutions.

    Args:
        dynamics: of k joints.
        q: (m, k) [rad or m].
        v: (m, k) [rad/s or m/s]; exactly zero at rest.
        effort: (m, k) [N m, N or the joint's command unit].
    """
    level = dynamics.level_of_dry_friction(q, effort)
    side = np.where(level != 0.0, np.sign(v), 0.0)
    sticks = (v == 0.0) & (level != 0.0)
    rows = np.flatnonzero(sticks.any(axis=1))
    for _ in range(q.shape[1]):
        if not len(rows):
            break
        now = DryFriction(level[rows], side[rows], sticks[rows])
        M, drive = _equations(dynamics, now, q[rows], v[rows], effort[rows])
        a = _solve(M, drive, now.sticks)
        holding = np.where(now.sticks, drive - np.einsum('mij,mj->mi', M, a), 0.0)
        excess = np.where(now.sticks, np.abs(holding) - now.level, -np.inf)
        worst = excess.argmax(axis=1)
        over = excess[np.arange(len(rows)), worst] > 0.0
        rows, worst, holding = rows[over], worst[over], holding[over]
        sticks[rows, worst] = False
        side[rows, worst] = np.sign(holding[np.arange(len(rows)), worst])
    return DryFriction(level, side, sticks)


def acceleration_under(
    dynamics: ForcedMotion, friction: DryFriction, q: np.ndarray, v: np.ndarray, effort: np.ndarray
) -> np.ndarray:
    """Return the acceleration with the given state of dry friction, (m, k).

    Not a number where the mass matrix has no inverse.
    """
    M, drive = _equations(dynamics, friction, q, v, effort)
    return _solve(M, drive, friction.sticks)


def forward(
    robot: Robot,
    W: np.ndarray,
    q: np.ndarray,
    v: np.ndarray,
    effort: np.ndarray,
    residual: Residual | None = None,
) -> np.ndarray:
    """Return the acceleration of m states at once, (m, k) [rad/s^2 or m/s^2].

    `M(q) a = effort - bias(q, v) - Z(q, v)` for the target `effort`, where M and bias are read
    off the regressor; `a = f(q, v, effort) W + Z(q, v)` for the target `acceleration`. A joint
    whose velocity is exactly zero sticks if dry friction can hold it. O(m k^2 (p + k)).

    Args:
        robot: physics of k joints, linear in W.
        W: (p,) [unit of each coefficient].
        q: (m, k) [rad or m].
        v: (m, k) [rad/s or m/s].
        effort: (m, k) [N m, N or the joint's command unit].
        residual: mean of Z from q and v [unit of the target].

    Returns:
        Not a number where the mass matrix has no inverse.
    """
    dynamics = Dynamics(robot, W, residual)
    friction = dry_friction(dynamics, q, v, effort)
    return acceleration_under(dynamics, friction, q, v, effort)


def _equations(
    dynamics: ForcedMotion, friction: DryFriction, q: np.ndarray, v: np.ndarray, effort: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mass matrix and drive with friction on the side it is on, (m, k, k) and (m, k)."""
    felt = np.where(v == 0.0, _BESIDE_REST * friction.side, v)
    correction = friction.level * (np.sign(felt) - friction.side)
    M, drive = dynamics.equations(q, felt, effort)
    return M, drive + correction


def _solve(M: np.ndarray, drive: np.ndarray, sticks: np.ndarray) -> np.ndarray:
    """Accelerations of the joints that do not stick, zero for those that do, (m, k)."""
    k = drive.shape[1]
    A, b = M, drive
    if sticks.any():
        moves = ~sticks
        A = np.where(moves[:, :, None] & moves[:, None, :], M, np.eye(k))
        b = np.where(moves, drive, 0.0)
    if np.isfinite(A).all():
        with suppress(np.linalg.LinAlgError):  # one of them is singular: which?
            return np.asarray(np.linalg.solve(A, b[:, :, None])[:, :, 0])
    determinant = np.linalg.det(A)
    is_regular = np.isfinite(determinant) & (determinant != 0.0)
    A = np.where(is_regular[:, None, None], A, np.eye(k))
    a = np.linalg.solve(A, b[:, :, None])[:, :, 0]
    return np.where(is_regular[:, None], a, np.nan)
