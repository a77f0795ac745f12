"""The rigid-body dynamics of a tree of joints as one physics term.

Torques are linear in ten inertial parameters of each link, in this order: mass, the first moment
(mass times centre of mass) x, y, z, and the inertia tensor xx, xy, yy, xz, yz, zz, about the
origin of the joint that carries the link, in the frame of that joint. The regressor depends on
geometry and gravity alone, so a tree without masses will do.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sgp_ros.errors import ConfigError
from sgp_ros.physics.term import Coefficient, Motion, Term
from sgp_ros.rigid.rigid_body import torque_regressor
from sgp_ros.rigid.tree import GRAVITY, Tree

PARAMETERS = (
    ('mass', 'kg'),
    ('mx', 'kg m'),
    ('my', 'kg m'),
    ('mz', 'kg m'),
    ('Ixx', 'kg m^2'),
    ('Ixy', 'kg m^2'),
    ('Iyy', 'kg m^2'),
    ('Ixz', 'kg m^2'),
    ('Iyz', 'kg m^2'),
    ('Izz', 'kg m^2'),
)
"""Name and unit of the inertial parameters of a link, in the order of the columns."""


def revolute_chain(
    names: Sequence[str], axes: Sequence[Sequence[float]], offsets: Sequence[Sequence[float]]
) -> Tree:
    """Return the tree of a fixed chain of k revolute joints without masses and limits.

    Args:
        names: of the joints, from the base on; the links have the same.
        axes: (k, 3) unit vectors, each in the frame of its joint.
        offsets: (k, 3) from the joint before, in the frame of that one [m].
    """
    k = len(names)
    none, endless = np.zeros(k), np.full(k, np.inf)
    return Tree(
        name='chain',
        joint_names=tuple(names),
        link_names=tuple(names),
        parents=np.arange(k) - 1,
        rotations=np.tile(np.eye(3), (k, 1, 1)),
        translations=np.array(offsets, dtype=np.float64),
        axes=np.array(axes, dtype=np.float64),
        is_prismatic=np.zeros(k, dtype=bool),
        gravity=np.array(GRAVITY),
        parameters=np.zeros((k, 10)),
        lower=-endless,
        upper=endless,
        velocity_limit=endless,
        effort_limit=endless,
        damping=none,
        friction=none,
        is_actuated=np.ones(k, dtype=bool),
        follows=np.arange(k),
        multipliers=np.ones(k),
        offsets=none,
    )


def inertial_term(
    tree: Tree, links: Sequence[str] | None = None, bodies: Sequence[int] | None = None
) -> Term:
    """Return the torques of a rigid-body tree as ten columns for each body.

    Their coefficients are `<link>.mass`, `<link>.mx` and so on (`PARAMETERS`); each belongs to the
    joint that carries the link. Torques do not tell all of them apart: a link that only turns
    about a vertical axis shows one of its ten.

    Args:
        tree: its joints that move on their own are those of the robot, in the same order.
        links: names of the b bodies; None for those of the tree.
        bodies: indices of the bodies whose columns are wanted; None for all.

    Raises:
        ConfigError: another number of names than bodies.
    """
    names = tree.link_names if links is None else tuple(links)
    if len(names) != len(tree.link_names):
        raise ConfigError(
            f'{len(names)} links {list(names)}', f'one for each of {list(tree.joint_names)}'
        )
    chosen = range(len(names)) if bodies is None else bodies
    coefficients = tuple(
        Coefficient(f'{names[i]}.{parameter}', unit, tree.joint_names[tree.follows[i]])
        for i in chosen
        for parameter, unit in PARAMETERS
    )
    kept = np.array([10 * i + c for i in chosen for c in range(10)], dtype=np.intp)

    def columns(motion: Motion) -> np.ndarray:
        Y = torque_regressor(tree, motion.position, motion.velocity, motion.acceleration)
        return Y if bodies is None else Y[:, :, kept]

    return Term(coefficients, columns, 'Featherstone 2008, chapter 5')
