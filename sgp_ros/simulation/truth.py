"""What is true of a simulation, in a form that JSON can hold."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict

from sgp_ros.simulation.effect_text import checked_law
from sgp_ros.simulation.effects import ChosenEffect
from sgp_ros.simulation.mechanism import SimulatedJoint, physical_parameters
from sgp_ros.simulation.scenario import Scenario
from sgp_ros.simulation.simulator import Simulator


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


def _described(simulator: Simulator, effects: Iterable[ChosenEffect]) -> list[dict[str, object]]:
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
                entry['unit'] = parameter.unit_on(joint, effect.parameters.get('kind', ''))
            parameters[parameter.name] = entry
        described.append({'effect': effect.name, 'joint': effect.joint, 'parameters': parameters})
    return described
