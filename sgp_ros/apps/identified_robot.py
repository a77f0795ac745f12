"""An identified robot as files: robot YAML for the next run, URDF for everything else."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import yaml

from sgp_ros.errors import ConfigError
from sgp_ros.report.files import write_text
from sgp_ros.robots.robot import Robot


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
    write_text(out / 'robot_identified.yaml', robot_yaml(robot, values, std))
    (out / 'robot_identified.urdf').unlink(missing_ok=True)  # of an earlier run
    if has_bodies and 'urdf' in robot.source and len(values):
        try:
            text = robot_urdf(robot, values)
        except ConfigError:  # no body of positive mass, so no URDF can hold it
            return
        write_text(out / 'robot_identified.urdf', text)


def robot_yaml(robot: Robot, values: np.ndarray, std: np.ndarray) -> str:
    """Return the identified robot as a robot YAML, the prior for the next run."""
    document = {
        'schema': 1,
        **(robot.source or {'robot': robot.name, 'joints': list(robot.joint_names)}),
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


def robot_urdf(robot: Robot, values: np.ndarray) -> str:
    """Return the robot's URDF with identified bodies and friction.

    Raises:
        ConfigError: a mass is not positive, or the URDF is no longer what it was.
    """
    from sgp_ros.rigid.urdf_writer import write_urdf  # noqa: PLC0415 - as above
    from sgp_ros.robots.urdf_robot import urdf_text  # noqa: PLC0415 - loads Pinocchio

    names = [c.name for c in robot.coefficients]
    named = dict(zip(names, values.tolist(), strict=True))
    bodies = {
        name.removesuffix('.mass'): values[i : i + 10]
        for i, name in enumerate(names)
        if name.endswith('.mass')
    }
    dynamics = {
        joint: (named.get(f'{joint}.viscous', 0.0), named.get(f'{joint}.coulomb', 0.0))
        for joint in robot.joint_names
    }
    text = urdf_text(robot)
    return write_urdf(text, bodies, dynamics)
