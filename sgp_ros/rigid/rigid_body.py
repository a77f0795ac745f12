"""Torques of a kinematic tree and their regressor for many samples at once, compiled.

Forces are handed from each body to the one it hangs on, down to the root; a joint feels the part
along the motion it permits. Torques of joints that follow another count for that one, times their
multiplier (virtual work). Source: Featherstone 2008, Rigid Body Dynamics Algorithms, chapter 5.
"""

from __future__ import annotations

import numpy as np

from sgp_ros.errors import NumericalError
from sgp_ros.rigid.mass_loops import fill_mass
from sgp_ros.rigid.rigid_geometry import full_motion, geometry
from sgp_ros.rigid.rigid_loops import fill_regressor, fill_torque
from sgp_ros.rigid.tree import Tree


def torque_regressor(
    tree: Tree, q: np.ndarray, v: np.ndarray, a: np.ndarray, out: np.ndarray | None = None
) -> np.ndarray:
    """Return Y with `tau = Y @ parameters.ravel()`, (n, k, 10 b).

    Columns come in tens, one ten per body in the order of `inertial.PARAMETERS`. O(b depth) per
    sample.

    Args:
        tree: of b bodies, k of which move on their own (b = k without mimic joints).
        q: positions, (n, k) [rad or m].
        v: velocities, (n, k) [rad/s or m/s].
        a: accelerations, (n, k) [rad/s^2 or m/s^2].
        out: where to write the result, (n, k, 10 b), contiguous; fresh memory can cost more
            than the computation.

    Raises:
        ValueError: motions or `out` of another shape.
    """
    full = full_motion(tree, q, v, a)
    g = geometry(tree)
    shape = (len(full[0]), g.size, 10 * len(tree.parents))
    Y = np.empty(shape) if out is None else out
    if Y.shape != shape or Y.dtype != np.float64 or not Y.flags.c_contiguous:
        raise ValueError(f'out {Y.shape} of {Y.dtype} for a contiguous {shape} of float64')
    fill_regressor(g, tree.gravity.copy(), *full, Y)
    return Y


def inverse_dynamics(
    tree: Tree, parameters: np.ndarray, q: np.ndarray, v: np.ndarray, a: np.ndarray,
    gravity: np.ndarray | None = None,
) -> np.ndarray:  # fmt: skip
    """Return the torques that a motion takes, (n, k) [N m or N]. O(b) per sample.

    Args:
        tree: of b bodies.
        parameters: (b, 10) or (10 b,), in the order of `inertial.PARAMETERS`.
        q: positions, (n, k) [rad or m].
        v: velocities, (n, k) [rad/s or m/s].
        a: accelerations, (n, k) [rad/s^2 or m/s^2].
        gravity: (3,) in the axes of the root [m/s^2]; None for that of the tree.
    """
    full = full_motion(tree, q, v, a)
    tau = np.zeros((len(full[0]), geometry(tree).size))
    pull = tree.gravity if gravity is None else gravity
    fill_torque(geometry(tree), pull.copy(), *full, _table(tree, parameters), tau)
    return tau


def mass_matrix(tree: Tree, parameters: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the joint-space inertia, (n, k, k). O(b depth) per sample."""
    still = np.zeros_like(q)
    full, _, _ = full_motion(tree, q, still, still)
    g = geometry(tree)
    M = np.zeros((len(full), g.size, g.size))
    fill_mass(g, full, _table(tree, parameters), M)
    return M


def mass_and_bias(
    tree: Tree, parameters: np.ndarray, q: np.ndarray, v: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the joint-space inertia (n, k, k) and the torques without acceleration (n, k)."""
    full, g = full_motion(tree, q, v, np.zeros_like(q)), geometry(tree)
    table, n = _table(tree, parameters), len(full[0])
    M, tau = np.zeros((n, g.size, g.size)), np.zeros((n, g.size))
    fill_mass(g, full[0], table, M)
    fill_torque(g, tree.gravity.copy(), *full, table, tau)
    return M, tau


def forward_dynamics(
    tree: Tree, parameters: np.ndarray, q: np.ndarray, v: np.ndarray, tau: np.ndarray
) -> np.ndarray:
    """Return the accelerations that torques cause, (n, k) [rad/s^2 or m/s^2]. O(k b + k^3).

    Args:
        tree: of b bodies.
        parameters: (b, 10) or (10 b,), in the order of `inertial.PARAMETERS`.
        q: positions, (n, k) [rad or m].
        v: velocities, (n, k) [rad/s or m/s].
        tau: torques, (n, k) [N m or N].

    Raises:
        NumericalError: a mass matrix that is not positive definite; the parameters are then none
            that a body can have.
    """
    M, bias = mass_and_bias(tree, parameters, q, v)
    try:
        np.linalg.cholesky(M)
    except np.linalg.LinAlgError as error:
        raise NumericalError(
            f'tree {tree.name}: a mass matrix that is not positive definite',
            'inertial parameters that bodies can have',
        ) from error
    return np.linalg.solve(M, (np.asarray(tau) - bias)[:, :, None])[:, :, 0]


def _table(tree: Tree, parameters: np.ndarray) -> np.ndarray:
    """Return inertial parameters as the loops read them, (b, 10)."""
    return np.array(parameters, dtype=np.float64).reshape(len(tree.parents), 10)
