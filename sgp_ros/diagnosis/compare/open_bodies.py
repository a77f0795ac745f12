"""Bodies that a robot file leaves open, estimated from the recording itself.

Files of robots often state geometry and leave inertias out. Efforts are linear in the ten
parameters pi of each open body, and friction and an offset must stand beside them, for they would
otherwise be taken for inertia:

    tau + tau_stated - tau_known(q, v, a) = Y(q, v, a) pi + b v + c s(v) + f + noise,

solved by least squares with rows scaled by the rest of their joint. Then the nearest bodies that
can exist take the place of pi. They are a start, not a measurement: the comparison of models lets
them differ by as much as themselves. Source: Gautier 1991 for the linear equations; Wensing, Kim,
Slotine 2018 for bodies that can exist.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sgp_ros.diagnosis.compare.bandwidth import choose_bandwidth
from sgp_ros.diagnosis.compare.trajectory import RawTrajectory, observe, parallel_filter
from sgp_ros.errors import ConfigError
from sgp_ros.rigid.base_parameters import RegressorFactor
from sgp_ros.rigid.consistent import project_information
from sgp_ros.rigid.rigid_body import mass_matrix, torque_regressor
from sgp_ros.rigid.tree import Tree

_SINGULAR = 1e-12
"""Least eigenvalue of the mass matrix with a unit diagonal."""
_ROUNDS = 3
"""Rounds of least squares in which each joint is weighed by what it leaves."""


def open_bodies(robot: str, tree: Tree) -> tuple[int, ...]:
    """Return the bodies without usable inertia, where the robot needs one; mostly empty.

    A body without mass, or of mass in a point, is usable where the others resist acceleration.

    Args:
        robot: its name.
        tree: nominal robot; its zero position is looked at.

    Raises:
        ConfigError: the mass matrix is singular though every link has mass and inertia.
    """
    (M,) = mass_matrix(tree, tree.parameters, np.zeros((1, tree.size)))
    size = np.sqrt(np.maximum(np.diag(M), 0.0))
    if size.min() > 0.0 and np.linalg.eigvalsh(M / np.outer(size, size))[0] > _SINGULAR:
        return ()
    mass, moment = tree.parameters[:, 0], tree.parameters[:, 1:4]
    trace = tree.parameters[:, [4, 6, 9]].sum(axis=1)
    about_centre = trace - 2.0 * (moment**2).sum(axis=1) / np.where(mass > 0.0, mass, 1.0)
    found = np.flatnonzero((mass <= 0.0) | (about_centre <= _SINGULAR * np.maximum(trace, 1e-9)))
    if not len(found):
        raise ConfigError(
            f'the mass matrix of the nominal robot {robot} is singular',
            'every joint to move some mass or inertia',
            'correct the inertias of the URDF, or give others with --bodies',
        )
    return tuple(int(i) for i in found)


def with_open_bodies(raw: RawTrajectory, tree: Tree, bodies: Sequence[int]) -> Tree:
    """Return the tree with open bodies as the recording shows them.

    Args:
        raw: that is learned from.
        tree: nominal robot.
        bodies: indices of the open ones.

    Raises:
        NumericalError: no bodies that can exist were found.
    """
    if not bodies:
        return tree
    known = tree.parameters.copy()
    known[list(bodies)] = 0.0
    bare = replace(tree, parameters=known)
    bandwidth = choose_bandwidth(raw, bare)
    motion, low = observe(raw, bare, bandwidth), parallel_filter(raw, bandwidth)
    k = tree.size
    y = low(motion.effort + motion.stated_force - motion.nominal_effort)  # (N, k)
    places = [10 * body + i for body in bodies for i in range(10)]
    Y = torque_regressor(bare, motion.position, motion.velocity, motion.acceleration)
    A = np.zeros((*y.shape, len(places) + 3 * k))
    for j in range(k):
        A[:, j, : len(places)] = low(Y[:, j, places])
        own = (motion.velocity[:, j], motion.direction[:, j], np.ones(len(motion.time)))
        for i, column in enumerate(own):
            A[:, j, len(places) + 3 * j + i] = low(column)
    pi, R = _solved(A, y, len(places))
    blocks = [range(10 * i, 10 * i + 10) for i in range(len(bodies))]
    known[list(bodies)] = project_information(pi, R, blocks).coefficients.reshape(-1, 10)
    return replace(tree, parameters=known)


def _solved(A: np.ndarray, y: np.ndarray, p: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the first p coefficients of A (N, k, m) on y (N, k), and their information R (p, p).

    `R^T R` is their information once the other coefficients are eliminated: the last block of a QR
    with the others first.
    """
    sigma = np.sqrt((y**2).mean(axis=0))
    for _ in range(_ROUNDS):
        sigma = np.where(sigma > 0.0, sigma, 1.0)
        rows = (A / sigma[:, None]).reshape(-1, A.shape[2])
        scale = np.sqrt((rows**2).sum(axis=0))
        scale[scale == 0.0] = 1.0
        found = np.linalg.lstsq(rows / scale, (y / sigma).ravel(), rcond=1e-7)[0] / scale
        sigma = np.sqrt(((y - A @ found) ** 2).mean(axis=0))
    order = np.roll(np.arange(A.shape[2]), -p)
    R = RegressorFactor.nothing(len(order)).with_rows(rows[:, order]).R
    return found[:p], R[-p:, -p:]


def open_remark(tree: Tree, bodies: Sequence[int]) -> tuple[str, ...]:
    """Return remarks on bodies that the file left open; empty without any."""
    if not bodies:
        return ()
    links = ', '.join(tree.link_names[i] for i in bodies)
    text = (
        f'The robot file has no usable inertia of {links}: it was estimated from this recording, '
        'together with friction and an offset of each joint. If you have measured values, give '
        'them with --bodies.'
    )
    return (text,)
