"""Everything that determines a simulation, as one value, and what is true of it for JSON."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace

from sgp_ros.errors import ConfigError
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.law import NAME as LAW
from sgp_ros.physics.place import BASE, JOINT, LAST, MOTOR, TOOL
from sgp_ros.simulation.effect_text import checked_law, with_defaults
from sgp_ros.simulation.effects import EVERY_MOTOR, Action
from sgp_ros.simulation.mechanism import Mechanism, SimulatedJoint, physical_parameters
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
    effects: tuple[EffectAt, ...]
    sensors: Sensors
    controller: str
    seed: int
    period_ns: int
    start_ns: int
    torque_noise: tuple[float, ...]
    position: tuple[float, ...]
    velocity: tuple[float, ...]
    unlisted: tuple[Action, ...] = ()

    def moving(self) -> Mechanism:
        """Return the mechanism with coordinates that no controller knows of."""
        mechanism = self.mechanism
        for effect in self.effects:
            changed = checked_law(effect)[1].changed
            if changed is not None:
                mechanism = changed(mechanism, effect.parameters)
        return mechanism

    def actions(self) -> tuple[Action, ...]:
        """Return what the built-in and the added effects do."""
        chosen = (*self.mechanism.built_in(), *self.effects)
        order = [*LAWS, LAW]
        return (
            tuple(
                action
                for effect in sorted(chosen, key=lambda effect: order.index(effect.name))
                for action in effect_actions(self.simulator, effect)
            )
            + self.unlisted
        )


def effect_actions(simulator: Simulator, chosen: EffectAt) -> tuple[Action, ...]:
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


def with_effects(mechanism: Mechanism, effects: Iterable[EffectAt]) -> Mechanism:
    """Return the mechanism with the physical parameters that effects add to."""
    for effect in effects:
        for name, physical in checked_law(effect)[1].physical.items():
            value = getattr(mechanism, physical) + float(effect.parameters[name])
            mechanism = replace(mechanism, **{physical: value})
    return mechanism


def describe_truth(scenario: Scenario) -> dict[str, object]:
    """Return the true parameters, coefficients and effects of a simulation.

    Each entry of `coefficients` has the true `value` and what it is made of: `nominal` (the robot
    as it is usually), `physical` (what changed physical parameters add) and `effects` (what added
    effects of the same physics add, such as viscous friction on the pole to w3 and w7). Effects
    of other physics stand in `effects` only.
    """
    simulator = scenario.simulator
    return {
        'schema': 1,
        'robot': simulator.name,
        'description': simulator.description,
        'seed': scenario.seed,
        'controller': scenario.controller,
        'rate_hz': 1e9 / scenario.period_ns,
        'start_ns': scenario.start_ns,
        'joints': list(simulator.joint_names),
        'command_joints': list(simulator.command_joints),
        'command_unit': simulator.command_unit,
        'effort_gain': dict(zip(simulator.joint_names, simulator.effort_gain, strict=False)),
        'start': {'position': list(scenario.position), 'velocity': list(scenario.velocity)},
        'physical': physical_parameters(scenario.mechanism),
        'coefficients': _coefficients(scenario),
        'built_in_effects': _described(simulator, scenario.mechanism.built_in()),
        'effects': _described(simulator, scenario.effects),
        'torque_noise': dict(zip(simulator.joint_names, scenario.torque_noise, strict=True)),
        'sensors': {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in asdict(scenario.sensors).items()
        },
    }


def _coefficients(scenario: Scenario) -> dict[str, dict[str, float | str]]:
    simulator = scenario.simulator
    nominal = simulator.mechanism.coefficients()
    changed = scenario.mechanism.coefficients()
    true = simulator.absorbed(scenario.mechanism, scenario.effects).coefficients()
    return {
        c.name: {
            'value': c.value,
            'unit': c.unit,
            'nominal': a.value,
            'physical': b.value - a.value,
            'effects': c.value - b.value,
        }
        for a, b, c in zip(nominal, changed, true, strict=True)
    }


def _described(simulator: Simulator, effects: Iterable[EffectAt]) -> list[dict[str, object]]:
    described: list[dict[str, object]] = []
    for effect in effects:
        joint = next(
            (j for j in simulator.joints if j.name == effect.joint), SimulatedJoint(effect.joint)
        )
        parameters: dict[str, dict[str, object]] = {}
        known, law = checked_law(effect)
        for parameter in law.parameters(known):
            if parameter.name not in effect.parameters:
                continue
            entry: dict[str, object] = {'value': effect.parameters[parameter.name]}
            if not parameter.choices and not parameter.is_joint:
                shown = parameter.of_kind(str(effect.parameters.get('kind', '')))
                entry['unit'] = shown.unit_on(is_prismatic=joint.is_prismatic)
            parameters[parameter.name] = entry
        entry_of: dict[str, object] = {
            'effect': effect.name,
            'joint': effect.joint,
            'parameters': parameters,
        }
        if effect.name == LAW:
            entry_of['formula'] = effect.effect.formula
        described.append(entry_of)
    return described
