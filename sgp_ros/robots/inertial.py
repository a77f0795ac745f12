"""The rigid-body dynamics of a tree of joints as one physics term, by Pinocchio's regressor.

Torques are linear in ten inertial parameters of each link, in this order: mass, the first moment
(mass times centre of mass) x, y, z, and the inertia tensor xx, xy, yy, xz, yz, zz, about the
origin of the joint that carries the link, in the frame of that joint. The regressor depends on
geometry and gravity alone, so a model without masses will do.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio  # type: ignore[import-untyped]  # comes without types

from sgp_ros.errors import ConfigError
from sgp_ros.robots.robot import Coefficient, Motion, Term

if TYPE_CHECKING:
    from collections.abc import Sequence

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
) -> Any:
    """Return the Pinocchio model of a fixed chain of k revolute joints without masses.

    Args:
        names: of the joints, from the base on.
        axes: (k, 3) unit vectors, each in the frame of its joint.
        offsets: (k, 3) from the joint before, in the frame of that one [m].
    """
    model = pinocchio.Model()
    parent = 0
    for name, axis, offset in zip(names, axes, offsets, strict=True):
        joint = pinocchio.JointModelRevoluteUnaligned(np.array(axis, dtype=np.float64))
        place = pinocchio.SE3(np.eye(3), np.array(offset, dtype=np.float64))
        parent = model.addJoint(parent, joint, place, name)
    return model


def inertial_term(model: Any, links: Sequence[str] | None = None) -> Term:
    """Return the torques of a rigid-body model as `10 k` columns.

    Their coefficients are `<link>.mass`, `<link>.mx` and so on (`PARAMETERS`). Torques do not tell
    all of them apart: a link that only turns about a vertical axis shows one of its ten. O(k^2)
    per sample.

    Args:
        model: a `pinocchio.Model` of k joints of one degree of freedom, in the order of the
            robot's joints. It is used as it is and must not change afterwards.
        links: k names; None for those of the joints.

    Raises:
        ConfigError: a joint with several degrees of freedom, or another number of names.
    """
    joints = list(model.names)[1:]
    if any(joint.nv != 1 for joint in list(model.joints)[1:]):
        raise ConfigError(
            f'robot {model.name}: joints with several degrees of freedom among {joints}',
            'revolute, continuous or prismatic joints',
            'replace each by several joints',
        )
    names = joints if links is None else list(links)
    if len(names) != len(joints):
        raise ConfigError(f'{len(names)} links {names}', f'one for each of the joints {joints}')
    coefficients = tuple(
        Coefficient(f'{name}.{parameter}', unit)
        for name in names
        for parameter, unit in PARAMETERS
    )

    def columns(motion: Motion) -> np.ndarray:
        return _regressor(model, motion)

    return Term(coefficients, columns, 'Pinocchio, computeJointTorqueRegressor')


def _regressor(model: Any, motion: Motion) -> np.ndarray:
    data = model.createData()
    start = pinocchio.neutral(model)
    rows = np.empty((*motion.position.shape, 10 * model.nv))
    for i, (q, v, a) in enumerate(
        zip(motion.position, motion.velocity, motion.acceleration, strict=True)
    ):
        # a continuous joint is stored as cosine and sine, which integrate() fills in
        place = pinocchio.integrate(model, start, q)
        rows[i] = pinocchio.computeJointTorqueRegressor(model, data, place, v, a)
    return rows
