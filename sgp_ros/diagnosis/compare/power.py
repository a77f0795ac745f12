"""Powers that forces are compared with: those of efforts, or of what a free swing would lose.

Where no joint has a motor, the motion is that of bodies, springs and friction of any common scale:
forces are told for the inertia that the robot file states.
"""

from __future__ import annotations

import numpy as np

from sgp_ros.diagnosis.criteria import COUNTED_SHARE, FLOOR_SHARE, LEAST_SHARE, LOST_ENERGY
from sgp_ros.rigid.rigid_body import torque_regressor
from sgp_ros.rigid.tree import Tree
from sgp_ros.robots.observed_motion import ObservedMotion

_POSES = 200
_HELD = 0.01
"""Part of the prior standard deviation of its inertia that is left to a robot without motors."""


def reference_power(
    motion: ObservedMotion, inertial: np.ndarray, noise: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean squares that shares refer to, and errors of signals beyond those of shares.

    That is the mean squared efforts; at joints without a motor, inertial forces of their own
    acceleration. A single joint that swings loses nothing but to friction, and it adds up over
    the way `s`: one of level F counts from `F s = LOST_ENERGY max(m v^2 / 2)`, however small it is
    beside the weight, if it counts beside the noise of the encoders. Errors of the signals are
    still relative to the inertial forces.

    Args:
        motion: that was seen, n rows.
        inertial: (N, k) low-passed inertial forces of each joint's own acceleration [N m or N].
        noise: (k,) mean squares of what the encoders' noise makes of these.

    Returns:
        Powers, 1 where nothing moves, and errors, (k,) each [N^2 m^2 or N^2].
    """
    driven = motion.tree.is_actuated[: motion.tree.size]
    own = (inertial**2).mean(axis=0)
    counted, error = own, np.zeros(len(own))
    if motion.is_swing:
        level = LOST_ENERGY / np.maximum(loss(motion, np.sign(motion.velocity)), 1e-300)
        counted = np.minimum(own, np.maximum(level**2 / COUNTED_SHARE, noise / LEAST_SHARE))
        error = FLOOR_SHARE * (own - counted) + noise
    power = np.where(driven, (motion.effort**2).mean(axis=0), counted)
    power = np.where(motion.moves & (power > 0.0), power, 1.0)
    return power, error


def loss(motion: ObservedMotion, force: np.ndarray) -> np.ndarray:
    """Return the work of forces (n, k) in a recording, by the greatest kinetic energy, (k,)."""
    work = motion.step * np.abs((force * motion.velocity).sum(axis=0))
    recordings = 1 if motion.recording is None else len(np.unique(motion.recording))
    energy = (0.5 * motion.mass_diagonal * motion.velocity**2).max(axis=0)
    return np.asarray(work / recordings / np.maximum(energy, 1e-300))


def at_one_scale(directions: np.ndarray, motion: ObservedMotion) -> np.ndarray:
    """Return changes of bodies that keep the inertia of a robot none of whose joints has a motor.

    Args:
        directions: (p, 10 b) changes, each with the prior N(0, 1).
        motion: that was seen.

    Returns:
        (p, 10 b), that of all inertia nearly none; as given where a joint has a motor.
    """
    tree = motion.tree
    if tree.is_actuated[: tree.size].any():
        return directions
    q = motion.position[:: max(1, len(motion.position) // _POSES)]
    slope = np.zeros(len(directions))
    for j in np.flatnonzero(motion.moves).tolist():
        Y = _accelerated(tree, q, j)
        slope += ((Y @ directions.T) / (Y @ tree.parameters.ravel())[:, None]).mean(axis=0)
    n = slope / np.linalg.norm(slope)
    return np.asarray(directions - (1.0 - _HELD) * np.outer(n, n @ directions))


def _accelerated(tree: Tree, q: np.ndarray, joint: int) -> np.ndarray:
    """Return the regressor of what a unit of a joint's acceleration takes there, (n, 10 b)."""
    still = np.zeros_like(q)
    a = still + np.eye(q.shape[1])[joint]
    return np.asarray(
        (torque_regressor(tree, q, still, a) - torque_regressor(tree, q, still, still))[:, joint]
    )


def moving_power(motion: ObservedMotion, power: np.ndarray) -> np.ndarray:
    """Return the mean squares of what moves the joints, (k,) [N^2 m^2 or N^2].

    That is efforts less those of gravity, where there is a motor; no more than `power` (k,).
    """
    still = np.zeros_like(motion.position)
    held = motion.effort_for(motion.position, still, still)
    driven = motion.tree.is_actuated[: motion.tree.size]
    moving = ((motion.effort - held) ** 2).mean(axis=0)
    return np.where(driven & (moving > 0.0), np.minimum(moving, power), power)
