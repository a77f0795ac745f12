"""Effects in the sensors."""

from __future__ import annotations

import math
from collections.abc import Mapping

from sgp_ros.simulation.effects import Action, EffectKind, EffectParameter, Moment, ParameterValue
from sgp_ros.simulation.mechanism import SimulatedJoint


def _eccentricity(
    joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, ParameterValue]
) -> tuple[Action, ...]:
    amplitude, phase = float(values['amplitude']), float(values['phase'])
    wave = joints[joint].turn * float(values['periods'])

    def sense(moment: Moment) -> tuple[float, float]:
        q, v = float(moment.position[joint]), float(moment.velocity[joint])
        angle = wave * q + phase
        return q + amplitude * math.sin(angle), v * (1.0 + amplitude * wave * math.cos(angle))

    return (Action(joint, sense=sense),)


def _velocity_lag(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, ParameterValue]
) -> tuple[Action, ...]:
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


ENCODER_ECCENTRICITY = EffectKind(
    'encoder_eccentricity',
    (
        EffectParameter('amplitude', 'rad'),
        EffectParameter('periods', '1/revolution'),
        EffectParameter('phase', 'rad'),
    ),
    _eccentricity,
)
"""The encoder shows `q + amplitude sin(periods q + phase)`, its velocity the derivative."""

VELOCITY_FILTER_LAG = EffectKind(
    'velocity_filter_lag', (EffectParameter('time_constant', 's', low=1e-4),), _velocity_lag
)
"""The measured velocity is the true one behind a first-order low-pass; the position is right."""
