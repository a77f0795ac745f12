"""A simulation known by its model file, as bodies and all physics beside them.

A diagnosis against it counts both from the bodies alone, so that the numbers of machine and
simulation stand side by side: the nominal robot is the one of the file without its friction.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from sgp_ros.errors import ConfigError
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.robots.nominal import Nominal, nominal_model
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.robot import Robot
from sgp_ros.robots.stated_effects import joint_friction
from sgp_ros.robots.stated_values import stated_urdf
from sgp_ros.robots.urdf_robot import build_urdf_robot

_DROPPED = ('parameters', 'terms', 'prior', 'effects')
"""Of a robot YAML, what states physics that then counts beside the bodies."""


def simulated_model(file: str, robot: Nominal) -> tuple[Nominal, tuple[EffectAt, ...]]:
    """Return the bodies of a simulation as a nominal robot, and the physics that it states.

    Args:
        file: model file or robot YAML.
        robot: that was recorded; its joints and efforts count.

    Raises:
        ConfigError: no model, one of other joints, or one that no URDF can hold.
    """
    names = robot.tree.moving_names
    sim = nominal_model(load_robot(file))
    if set(sim.tree.moving_names) != set(names):
        raise ConfigError(
            f'simulation {Path(file).name} has the joints {list(sim.tree.moving_names)}',
            f'those of the robot, {list(names)}', 'give a model of the same machine',
        )  # fmt: skip
    if sim.tree.moving_names != names:
        sim = nominal_model(_with(sim.robot, joints=list(names)))
    kinds = {j.name: j.kind for j in robot.robot.joints}
    other = [f'{j.name} is {j.kind}' for j in sim.robot.joints if j.kind != kinds[j.name]]
    if other:
        raise ConfigError(
            f'simulation {Path(file).name} is of another machine: {", ".join(other)} there',
            'joints of the same kind as those of the robot', 'give a model of the same machine',
        )  # fmt: skip
    effects = tuple(e for e in sim.effects if e.is_complete and not e.effect.is_on_tree)
    return nominal_model(_bare(sim, robot.robot)), (*joint_friction(sim.tree), *effects)


def _bare(sim: Nominal, robot: Robot) -> Robot:
    """Return the simulated robot without physics beside its bodies, driven as the recorded one."""
    none = dict.fromkeys(sim.tree.joint_names, (0.0, 0.0))
    text = stated_urdf(sim.robot, sim.without_stated(sim.tree.parameters), none)
    if text is None:
        raise ConfigError(
            f'simulation {sim.robot.name} has bodies that a URDF cannot express',
            'physically possible bodies',
        )
    passive = [j.name for j in robot.joints if not j.is_actuated]
    gain = {j.name: j.effort_gain for j in robot.joints if j.effort_gain != 1.0}
    kept = [e for e in _effects(sim.robot) if _is_on_tree(e, sim)]
    said = {'passive': passive, 'effort_gain': gain, 'effects': kept}
    source = {k: x for k, x in sim.robot.source.items() if k not in _DROPPED}
    source = {**source, 'urdf': text, **{k: x for k, x in said.items() if x}}
    return _with(replace(sim.robot, source=source))


def _effects(robot: Robot) -> list[dict[str, object]]:
    found = robot.source.get('effects') or []
    assert isinstance(found, list)
    return found


def _is_on_tree(entry: dict[str, object], sim: Nominal) -> bool:
    return any(e.name == entry.get('effect') and e.effect.is_on_tree for e in sim.effects)


def _with(robot: Robot, **entries: object) -> Robot:
    """Return a robot from a URDF with other entries of its robot YAML."""
    problems: list[str] = []
    built = build_urdf_robot({**robot.source, **entries}, Path(), problems)
    if built is None or problems:
        raise ConfigError(f'robot {robot.name}: ' + ' | '.join(problems), 'a valid robot file')
    return built
