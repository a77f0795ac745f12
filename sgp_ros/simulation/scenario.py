"""Everything that determines a simulation, as one value."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from sgp_ros.errors import ConfigError
from sgp_ros.simulation.effect_text import checked_effect

if TYPE_CHECKING:
    from sgp_ros.simulation.effects import Action, ChosenEffect
    from sgp_ros.simulation.mechanism import Mechanism
    from sgp_ros.simulation.sensors import Sensors
    from sgp_ros.simulation.simulator import Simulator


@dataclass(frozen=True, slots=True, eq=False)
class Scenario:
    """The choices behind a simulation; two simulations of equal scenarios are equal bit for bit.

    Attributes:
        simulator: the robot.
        mechanism: its equation of motion with the physical parameters in force.
        effects: added to it, in this order.
        sensors: in force.
        controller: name.
        seed: of all random numbers.
        period_ns: between two samples [ns].
        start_ns: stamp of the first sample [ns].
        torque_noise: (k,) density [N m s^0.5 or N s^0.5].
        position: (k,) at the start [rad or m].
        velocity: (k,) at the start [rad/s or m/s].
    """

    simulator: Simulator
    mechanism: Mechanism
    effects: tuple[ChosenEffect, ...]
    sensors: Sensors
    controller: str
    seed: int
    period_ns: int
    start_ns: int
    torque_noise: tuple[float, ...]
    position: tuple[float, ...]
    velocity: tuple[float, ...]

    def actions(self) -> tuple[Action, ...]:
        """Return what the built-in and the added effects do."""
        chosen = (*self.mechanism.built_in(), *self.effects)
        return tuple(effect_action(self.simulator, effect) for effect in chosen)


def effect_action(simulator: Simulator, effect: ChosenEffect) -> Action:
    """Return what an effect does to a robot.

    Raises:
        ConfigError: an effect, joint or value that does not exist or suit.
    """
    kind = checked_effect(effect)
    able = simulator.command_joints if kind.needs_motor else simulator.joint_names
    if effect.joint not in able:
        raise ConfigError(
            f'effect {effect.name} on joint {effect.joint!r} of robot {simulator.name}',
            f'one of {list(able)}' if able else 'a robot with a motor',
        )
    index = simulator.joint_names.index(effect.joint)
    return kind.build(index, simulator.joints[index], effect.parameters)
