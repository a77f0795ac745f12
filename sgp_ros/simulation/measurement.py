"""Effects in the sensors."""

from __future__ import annotations

import math
from collections.abc import Mapping

from sgp_ros.simulation.effects import Action, Moment, ParameterValue
from sgp_ros.simulation.mechanism import SimulatedJoint


def eccentricity(
    joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, ParameterValue]
) -> tuple[Action, ...]:
    """Return an encoder that shows `q + amplitude sin(periods q + phase)`."""
    amplitude, phase = float(values['amplitude']), float(values['phase'])
    wave = joints[joint].turn * float(values['periods'])

    def sense(moment: Moment) -> tuple[float, float]:
        q, v = float(moment.position[joint]), float(moment.velocity[joint])
        angle = wave * q + phase
        return q + amplitude * math.sin(angle), v * (1.0 + amplitude * wave * math.cos(angle))

    return (Action(joint, sense=sense),)


def velocity_lag(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, ParameterValue]
) -> tuple[Action, ...]:
    """Return a measured velocity behind a first-order low-pass; the position is right."""
    time_constant = float(values['time_constant'])

    def rate(moment: Moment) -> tuple[float]:
        return ((float(moment.velocity[joint]) - float(moment.state[0])) / time_constant,)

    return (
        Action(
            joint,
            sense_velocity=lambda moment: float(moment.state[0]),
            start=lambda _q, v: (v,),
            state_rate=rate,
            substep_s=0.5 * time_constant,
        ),
    )
