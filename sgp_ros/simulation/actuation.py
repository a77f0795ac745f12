"""Effects between the command and the force on the joint."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sgp_ros.simulation.effects import Action, EffectKind, EffectParameter

if TYPE_CHECKING:
    from collections.abc import Mapping

    from sgp_ros.simulation.effects import Moment, ParameterValue
    from sgp_ros.simulation.mechanism import SimulatedJoint


def _delay(
    joint: int, _description: SimulatedJoint, values: Mapping[str, ParameterValue]
) -> Action:
    return Action(joint, delay_s=float(values['delay']))


def _lag(joint: int, _description: SimulatedJoint, values: Mapping[str, ParameterValue]) -> Action:
    time_constant = float(values['time_constant'])

    def rate(moment: Moment) -> tuple[float]:
        return ((float(moment.drive[joint]) - float(moment.state[0])) / time_constant,)

    return Action(
        joint, drive=lambda moment: float(moment.state[0]), initial_state=(0.0,), state_rate=rate
    )


COMMAND_DELAY = EffectKind(
    'command_delay', (EffectParameter('delay', 's', low=0.0),), _delay, needs_motor=True
)
"""The command arrives later by exactly `delay`, also between two steps of the control."""

ACTUATOR_LAG = EffectKind(
    'actuator_lag',
    (EffectParameter('time_constant', 's', low=1e-3),),
    _lag,
    needs_motor=True,
)
"""First-order lag between the force that the motor should give and the one it gives."""
