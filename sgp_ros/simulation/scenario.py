"""Everything that determines a simulation, as one value."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from sgp_ros.errors import ConfigError
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.parts import BASE, JOINT, LAST, MOTOR, TOOL
from sgp_ros.simulation.effect_text import checked_law, with_defaults
from sgp_ros.simulation.effects import (
    EVERY_MOTOR,
    Action,
    ChosenEffect,
)
from sgp_ros.simulation.mechanism import Mechanism
from sgp_ros.simulation.registry import LAWS
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
        unlisted: what acts beside the effects that have a name.
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
    unlisted: tuple[Action, ...] = ()

    def actions(self) -> tuple[Action, ...]:
        """Return what the built-in and the added effects do."""
        chosen = (*self.mechanism.built_in(), *self.effects)
        order = list(LAWS)
        return (
            tuple(
                action
                for effect in sorted(chosen, key=lambda effect: order.index(effect.name))
                for action in effect_actions(self.simulator, effect)
            )
            + self.unlisted
        )


def effect_actions(simulator: Simulator, chosen: ChosenEffect) -> tuple[Action, ...]:
    """Return what an effect does to a robot; nothing if it changes physical parameters.

    Raises:
        ConfigError: an effect, joint or value that does not exist or suit.
    """
    effect, law = checked_law(chosen)
    able = places(simulator, effect)
    if chosen.joint not in able:
        lacking = effect.site if effect.site in {JOINT, MOTOR} else LAST
        raise ConfigError(
            f'effect {chosen.name} on joint {chosen.joint!r} of robot {simulator.name}',
            f'one of {list(able)}' if able else f'a robot with {lacking.value}',
        )
    if law.build is None:
        return ()
    values = with_defaults(law.parameters(effect), chosen.parameters)
    names = simulator.command_joints if chosen.joint == EVERY_MOTOR else (chosen.joint,)
    return tuple(
        action
        for name in names
        for action in law.build(simulator.joints, simulator.joint_names.index(name), values)
    )


def places(simulator: Simulator, effect: Effect) -> tuple[str, ...]:
    """Return the joints of a robot that an effect may be put on."""
    last = () if simulator.last_joint is None else (simulator.last_joint,)
    every = (EVERY_MOTOR,) if effect.takes_all and simulator.command_joints else ()
    return {
        JOINT: simulator.joint_names,
        MOTOR: simulator.command_joints + every,
        LAST: last,
        BASE: (BASE.value,) if last else (),
        TOOL: (TOOL.value,) if last else (),
    }[effect.site]


def with_effects(mechanism: Mechanism, effects: Iterable[ChosenEffect]) -> Mechanism:
    """Return the mechanism with the physical parameters that effects add to."""
    for effect in effects:
        for name, physical in checked_law(effect)[1].physical.items():
            value = getattr(mechanism, physical) + float(effect.parameters[name])
            mechanism = replace(mechanism, **{physical: value})
    return mechanism
