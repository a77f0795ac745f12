"""The simulator that a name, a URDF or a robot YAML asks for, with the effects that it states."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from sgp_ros.errors import ConfigError
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.parts import Value
from sgp_ros.robots.nominal import Nominal, nominal_model
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.stated_values import stated_urdf, values_of
from sgp_ros.robots.urdf_robot import stated_part, urdf_text
from sgp_ros.simulation.registry import SIMULATORS
from sgp_ros.simulation.simulator import Simulator
from sgp_ros.simulation.tree_simulator import tree_simulator
from sgp_ros.simulation.tree_text import Load, TreePart
from sgp_ros.strangers import read_text


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedRobot:
    """Robot to simulate, with its stated effects.

    Attributes:
        simulator: of the robot without the effects.
        name: of its recording.
        effects: those that its robot YAML states.
    """

    simulator: Simulator
    name: str
    effects: tuple[EffectAt, ...] = ()


def find_robot(robot: str) -> SimulatedRobot:
    """Return what to simulate for a name, a URDF file or a robot YAML.

    Three robots have dynamics of their own, written apart from their model. Every other one is
    simulated by its nominal bodies and the effects that it states.

    Raises:
        ConfigError: nothing of the kind, or an effect that the simulation cannot have.
    """
    path = Path(robot)
    if robot in SIMULATORS:
        return SimulatedRobot(SIMULATORS[robot], robot)
    if path.suffix == '.urdf' and path.is_file():
        return SimulatedRobot(_of_urdf(path), path.stem)
    return _of_nominal(nominal_model(load_robot(robot)), path.stem)


def _of_urdf(path: Path) -> Simulator:
    try:
        return tree_simulator(read_text(path))
    except UnicodeDecodeError as error:
        raise ConfigError(f'URDF {path} is not UTF-8 ({error})', 'a URDF in UTF-8') from error


def _of_nominal(nominal: Nominal, name: str) -> SimulatedRobot:
    last = {e.name: e for e in nominal.effects if e.effect.is_on_tree}
    before = [e for e in nominal.effects if last.get(e.name, e) is not e]
    simulator = tree_simulator(_urdf(nominal), _part(nominal, before))
    effects = tuple(_chosen(e, nominal) for e in nominal.effects if e not in before)
    return SimulatedRobot(simulator, name, effects)


def _urdf(nominal: Nominal) -> str:
    """Return the URDF with the bodies, damping and friction that the robot YAML states by value.

    Raises:
        ConfigError: no URDF can hold them.
    """
    if not values_of(nominal.robot):
        return urdf_text(nominal.robot)
    tree = nominal.tree
    sizes = zip(tree.joint_names, tree.damping, tree.friction, strict=True)
    bodies = nominal.without_stated(tree.parameters)
    text = stated_urdf(nominal.robot, bodies, {j: (float(b), float(c)) for j, b, c in sizes})
    if text is None:
        raise ConfigError(
            f'robot {nominal.robot.name} states bodies that a URDF cannot express',
            'bodies under `parameters` that leave each link a positive mass',
        )
    return text


def _part(nominal: Nominal, before: Iterable[EffectAt]) -> TreePart:
    """Return what moves, is driven and carried as a robot from a URDF states it.

    Args:
        nominal: the robot.
        before: payloads below the last one, and tilts of the base that a later one replaces.
    """
    robot = nominal.robot
    plan, payload = stated_part(robot)
    links = nominal.plain.link_names
    loads = [] if payload is None else [
        Load(payload.link, payload.mass, payload.com, payload.inertia)
    ]  # fmt: skip
    loads += [
        Load(links[e.place.joint], e.numbers['mass'], tuple(e.numbers[axis] for axis in 'xyz'))
        for e in before if e.effect.is_body
    ]  # fmt: skip
    return TreePart(
        robot.joint_names,
        plan.locked,
        tuple(joint.name for joint in robot.joints if joint.is_actuated),
        {joint.name: joint.effort_gain for joint in robot.joints},
        tuple(loads),
    )


def _chosen(stated: EffectAt, nominal: Nominal) -> EffectAt:
    """Return a stated effect in the words of the simulation.

    A diagnosis may leave one level just below zero; it is then taken as zero.
    """
    quantities = stated.effect.stated_quantities(stated.kind)
    lowest = {q.name: min(0.0, q.low) for q in quantities}
    values: dict[str, Value] = {
        name: max(number, lowest[name]) for name, number in stated.numbers.items()
    }
    values |= stated.effect.stated_words(stated.place, nominal.tree)
    return EffectAt.wanted(stated.effect, stated.joint, values)
