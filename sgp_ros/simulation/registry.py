"""The simulated robots and the kinds of effects, by name."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sgp_ros.simulation.actuation import ACTUATOR_LAG, COMMAND_DELAY
from sgp_ros.simulation.friction import COULOMB_FRICTION, POSITION_FRICTION, VISCOUS_FRICTION
from sgp_ros.simulation.linear_axis import LINEAR_AXIS
from sgp_ros.simulation.measurement import ENCODER_ECCENTRICITY
from sgp_ros.simulation.reaction_wheel import REACTION_WHEEL
from sgp_ros.simulation.toy_pendulum import TOY_PENDULUM

if TYPE_CHECKING:
    from sgp_ros.simulation.effects import EffectKind
    from sgp_ros.simulation.simulator import Simulator

SIMULATORS: dict[str, Simulator] = {
    simulator.name: simulator for simulator in (REACTION_WHEEL, TOY_PENDULUM, LINEAR_AXIS)
}

EFFECTS: dict[str, EffectKind] = {
    kind.name: kind
    for kind in (
        VISCOUS_FRICTION,
        COULOMB_FRICTION,
        POSITION_FRICTION,
        COMMAND_DELAY,
        ACTUATOR_LAG,
        ENCODER_ECCENTRICITY,
    )
}
