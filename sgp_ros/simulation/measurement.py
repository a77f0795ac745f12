"""Effects in the sensors."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from sgp_ros.simulation.effects import Action, EffectKind, EffectParameter

if TYPE_CHECKING:
    from collections.abc import Mapping

    from sgp_ros.simulation.effects import Moment, ParameterValue
    from sgp_ros.simulation.mechanism import SimulatedJoint


def _eccentricity(
    joint: int, description: SimulatedJoint, values: Mapping[str, ParameterValue]
) -> Action:
    amplitude, phase = float(values['amplitude']), float(values['phase'])
    turn = 2.0 * math.pi if description.is_prismatic else 1.0
    wave = turn * float(values['periods'])

    def sense(moment: Moment) -> tuple[float, float]:
        q, v = float(moment.position[joint]), float(moment.velocity[joint])
        angle = wave * q + phase
        return q + amplitude * math.sin(angle), v * (1.0 + amplitude * wave * math.cos(angle))

    return Action(joint, sense=sense)


ENCODER_ECCENTRICITY = EffectKind(
    'encoder_eccentricity',
    (
        EffectParameter('amplitude', 'rad', low=0.0),
        EffectParameter('periods', '1/revolution', low=0.0),
        EffectParameter('phase', 'rad'),
    ),
    _eccentricity,
)
"""The encoder shows `q + amplitude sin(periods q + phase)`, its velocity the derivative."""
