"""The simulator that a name, a URDF or a robot YAML asks for, with the effects that it states."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from sgp_ros.errors import ConfigError
from sgp_ros.robots.nominal import nominal_model
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.urdf_robot import urdf_text
from sgp_ros.simulation.assembly import find_simulator
from sgp_ros.simulation.effects import ChosenEffect
from sgp_ros.simulation.tree_simulator import tree_simulator

if TYPE_CHECKING:
    from sgp_ros.robots.nominal import Nominal
    from sgp_ros.robots.stated_effects import StatedEffect
    from sgp_ros.simulation.simulator import Simulator

_NOT_SIMULATED = ('joints', 'locked', 'passive', 'effort_gain', 'payload')
"""Keys of a robot YAML that make another mechanism of the URDF."""


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedRobot:
    """What is simulated.

    Attributes:
        simulator: of the robot without the effects.
        name: of its recording.
        effects: those that its robot YAML states.
    """

    simulator: Simulator
    name: str
    effects: tuple[ChosenEffect, ...] = ()


def find_robot(robot: str) -> SimulatedRobot:
    """Return what to simulate for a name, a URDF file or a robot YAML.

    Raises:
        ConfigError: nothing of the kind, or an effect that the simulation cannot have.
    """
    path = Path(robot)
    if path.suffix in {'.yaml', '.yml'}:
        return _of_yaml(path)
    if path.suffix != '.urdf':
        return SimulatedRobot(find_simulator(robot), robot)
    if not path.is_file():
        raise ConfigError(f'no file {path}', 'a URDF')
    return SimulatedRobot(_of_urdf(path), path.stem)


def _of_urdf(path: Path) -> Simulator:
    try:
        return tree_simulator(path.read_text(encoding='utf-8-sig'))
    except UnicodeDecodeError as error:
        raise ConfigError(f'URDF {path} is not UTF-8 ({error})', 'a URDF in UTF-8') from error


def _of_yaml(path: Path) -> SimulatedRobot:
    robot = load_robot(str(path))
    if 'urdf' not in robot.source:
        raise ConfigError(
            f'robot file {path} without the key urdf', 'a URDF with effects',
            f'simulate {robot.name} by its name, with --effect and --physical',
        )  # fmt: skip
    unsuited = [key for key in _NOT_SIMULATED if robot.source.get(key)]
    if unsuited:
        raise ConfigError(
            f'robot file {path} with the keys {unsuited}', 'all joints and motors of the URDF',
            'write a URDF that has what they say, and leave them out',
        )  # fmt: skip
    nominal = nominal_model(robot)
    effects = tuple(_chosen(effect, nominal) for effect in nominal.effects)
    return SimulatedRobot(tree_simulator(urdf_text(robot)), path.stem, effects)


def _chosen(stated: StatedEffect, nominal: Nominal) -> ChosenEffect:
    values: dict[str, float | str] = dict(stated.numbers)
    if stated.kind:
        values['kind'] = stated.kind
    if stated.place is not None and stated.place.source >= 0:
        values['source_joint'] = nominal.tree.joint_names[stated.place.source]
    if stated.place is not None and stated.place.side:
        _check_side(stated, nominal)
    return ChosenEffect(stated.name, stated.joint, values)


def _check_side(stated: StatedEffect, nominal: Nominal) -> None:
    """Refuse an effect beyond the middle of the range: the simulation puts it on the nearer end.

    Raises:
        ConfigError: the stated side is the farther one.
    """
    assert stated.place is not None
    edge = stated.numbers['onset' if stated.name == 'limit_friction' else 'position']
    lower, upper = (float(x[stated.place.joint]) for x in (nominal.tree.lower, nominal.tree.upper))
    middle = 0.5 * (lower + upper) if math.isfinite(lower + upper) else 0.0
    if (edge >= middle) != (stated.place.side > 0):
        raise ConfigError(
            f'{stated.name} of {stated.joint} from {edge:g} towards the farther end of the range',
            f'an edge on its side of {middle:g} for a simulation',
        )
