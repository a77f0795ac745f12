"""An identified robot as files: robot YAML for the next run, URDF for everything else."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml

from sgp_ros.report.files import write_text
from sgp_ros.robots.robot import Robot

URDF_NAME = 'robot_identified.urdf'


def nominal_coefficients(robot: Robot) -> np.ndarray | None:
    """Return the coefficients as the robot's URDF has them, (p,); None without a URDF."""
    if 'urdf' not in robot.source:
        return None
    from sgp_ros.robots.urdf_robot import nominal_robot  # noqa: PLC0415 - loads Pinocchio

    return np.array([c.prior_mean for c in nominal_robot(robot).coefficients])


def write_identified(
    out: Path, robot: Robot, values: np.ndarray, std: np.ndarray, *, has_bodies: bool = True
) -> None:
    """Write `robot_identified.yaml`, and `robot_identified.urdf` for a robot from a URDF.

    Args:
        out: folder.
        robot: that was identified.
        values: (p,) coefficients; none where nothing was learned.
        std: (p,) standard deviations, infinite for what is not determined.
        has_bodies: the values are those of real bodies; no URDF can hold others.
    """
    text = robot_urdf(robot, values) if has_bodies and len(values) else None
    if text is not None:
        write_text(out / URDF_NAME, text)
    urdf = str(robot.source.get('urdf', ''))
    if text is not None:
        urdf = URDF_NAME
    elif urdf and not urdf.lstrip().startswith('<'):
        urdf = os.path.relpath(urdf, out)
    write_text(out / 'robot_identified.yaml', robot_yaml(robot, values, std, urdf))


def robot_yaml(robot: Robot, values: np.ndarray, std: np.ndarray, urdf: str = '') -> str:
    """Return the identified robot as a robot YAML, the prior for the next run.

    Args:
        robot: that was identified.
        values: (p,) coefficients; none where nothing was learned.
        std: (p,) standard deviations.
        urdf: the file that it names, relative to its own place; empty for that of the robot.
    """
    document = {
        'schema': 1,
        **(robot.source or {'robot': robot.name, 'joints': list(robot.joint_names)}),
        **({'urdf': urdf} if urdf else {}),
        'parameters': {
            c.name: {
                'value': float(w),
                'std': float(s) if math.isfinite(s) else None,
                'unit': c.unit,
            }
            for c, w, s in zip(robot.coefficients[: len(values)], values, std, strict=True)
        },
    }
    return yaml.safe_dump(document, sort_keys=False)


def robot_urdf(robot: Robot, values: np.ndarray) -> str | None:
    """Return the robot's URDF with identified bodies, damping and dry friction.

    None where the robot has no URDF, or none can hold the bodies. Physics without a term stays.
    """
    if 'urdf' not in robot.source:
        return None
    from sgp_ros.robots.nominal import nominal_model  # noqa: PLC0415 - loads Pinocchio
    from sgp_ros.robots.stated_values import stated_urdf  # noqa: PLC0415 - as above

    found = dict(zip((c.name for c in robot.coefficients), values.tolist(), strict=True))
    stated = {name: {'value': value} for name, value in found.items()}
    known = nominal_model(replace(robot, source={**robot.source, 'parameters': stated}))
    tree = known.tree
    if known.lacks_bodies:
        return None
    sizes = zip(tree.joint_names, tree.damping, tree.friction, strict=True)
    dynamics = {joint: (float(b), float(c)) for joint, b, c in sizes}
    return stated_urdf(robot, known.without_stated(tree.parameters), dynamics)
