"""Identified parameters as entries of a DiagnosticArray that plotting tools read."""

from __future__ import annotations

from sgp_ros.engine.engine import Engine
from sgp_ros.engine.results import ParameterEstimate
from sgp_ros.recordings.writer import Status


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
