"""The coefficients of real bodies nearest to what was identified."""

from __future__ import annotations

import numpy as np

from sgp_ros.physics.joint_terms import term_laws
from sgp_ros.rigid.consistent import ConsistentEstimate, project_information
from sgp_ros.robots.robot import Robot

DISSIPATIVE = tuple(
    name for _, form in term_laws().values() if form.is_dissipative for name in form.names
)
"""Endings of names of coefficients that are not negative in a real machine."""


def nearest_bodies(
    robot: Robot, mean: np.ndarray, R: np.ndarray, nominal: np.ndarray | None
) -> ConsistentEstimate | None:
    """Return the coefficients of real bodies that the data contradict least.

    Args:
        robot: with the coefficients of whole bodies (`robots.inertial`).
        mean: (p,) identified.
        R: (r, p) square-root information on them, of any rank.
        nominal: (p,) fills in what the data leave open; None for nothing.

    Returns:
        None for a robot without such coefficients.

    Raises:
        NumericalError: the solver did not converge.
    """
    names = [c.name for c in robot.coefficients]
    blocks = [range(i, i + 10) for i, name in enumerate(names) if name.endswith('.mass')]
    if not blocks:
        return None
    dissipative = [i for i, name in enumerate(names) if name.rpartition('.')[2] in DISSIPATIVE]
    return project_information(mean, R, blocks, nonnegative=dissipative, reference=nominal)
