"""What the node publishes of one estimate, before it is a message of any library.

The same values go to the topics and into the record, so the two cannot differ.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sgp_ros.engine.samples import JointSample
from sgp_ros.recordings.writer import Status

if TYPE_CHECKING:
    from sgp_ros.engine.engine import Engine
    from sgp_ros.engine.results import Estimate, ParameterEstimate

_NONE = np.zeros(0)


@dataclass(frozen=True, slots=True, eq=False)
class Point:
    """A trajectory of one point: (k,) each, or empty where there is nothing to say."""

    positions: np.ndarray
    velocities: np.ndarray
    accelerations: np.ndarray
    effort: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Outputs:
    """What is published of one estimate.

    Attributes:
        stamp_ns: of the sample predicted [ns].
        names: joints, k of them.
        prediction: query and means.
        variance: variances, noise included [units squared]; no positions or velocities.
        joint_state: measured state with the predicted effort.
    """

    stamp_ns: int
    names: tuple[str, ...]
    prediction: Point
    variance: Point
    joint_state: JointSample


def outputs(estimate: Estimate) -> Outputs | None:
    """Return what is published of `estimate`; None where it predicts nothing."""
    acceleration, effort = (
        (_NONE, _NONE) if np.all(np.isnan(c.mean)) else (c.mean, c.variance)
        for c in (estimate.acceleration, estimate.effort)
    )
    if not (len(acceleration[0]) or len(effort[0])):
        return None
    state = (estimate.position, estimate.velocity)
    return Outputs(
        estimate.stamp_ns,
        estimate.names,
        Point(*state, acceleration[0], effort[0]),
        Point(_NONE, _NONE, acceleration[1], effort[1]),
        JointSample(
            estimate.stamp_ns, estimate.names, *state, effort[0] if len(effort[0]) else None
        ),
    )


def parameter_statuses(engine: Engine) -> list[Status]:
    """Return one status per identified coefficient, its numbers plain enough to be plotted."""
    return [parameter_status(p, engine.robot.name) for p in engine.parameters()]


def parameter_status(parameter: ParameterEstimate, robot: str) -> Status:
    """Return the status of one coefficient of `robot`; no `std` where it is not identifiable."""
    values = {'value': repr(parameter.value)}
    if parameter.std is None:
        message = 'not determined by the motion so far'
    else:
        values['std'] = repr(parameter.std)
        message = f'{parameter.value:.6g} +- {1.96 * parameter.std:.2g} {parameter.unit} (95 %)'
    values['unit'] = parameter.unit
    values['identifiable'] = str(int(parameter.is_identifiable))
    if parameter.joint is not None:
        values['joint'] = parameter.joint
    return Status(parameter.name, 0, message, robot, values)
