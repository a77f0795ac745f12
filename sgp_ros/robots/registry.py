"""Robots by name or file.

A robot YAML names a built-in robot and changes what differs: joint names, and prior means and
standard deviations of coefficients. `sgp replay` writes its result in the same form, so what was
identified on one recording is the prior for the next.

    schema: 1
    robot: linear_axis
    joints: [slide]
    parameters:
      M: {value: 95.1, std: 0.2, unit: kg}
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from sgp_ros.errors import ConfigError
from sgp_ros.robots.linear_axis import LINEAR_AXIS
from sgp_ros.robots.reaction_wheel import REACTION_WHEEL, REACTION_WHEEL_6
from sgp_ros.robots.toy_pendulum import TOY_PENDULUM

if TYPE_CHECKING:
    from sgp_ros.robots.robot import Robot

ROBOTS: dict[str, Robot] = {
    robot.name: robot for robot in (REACTION_WHEEL, REACTION_WHEEL_6, TOY_PENDULUM, LINEAR_AXIS)
}
_KEYS = {'schema', 'robot', 'joints', 'parameters'}


def load_robot(name_or_path: str) -> Robot:
    """Return a built-in robot, or the robot that a YAML file describes.

    Raises:
        ConfigError: neither a built-in name nor a readable robot file; all problems of a file are
            listed in one error.
    """
    if name_or_path in ROBOTS:
        return ROBOTS[name_or_path]
    path = Path(name_or_path)
    expected = f'one of {sorted(ROBOTS)} or a robot YAML file'
    if not path.is_file():
        raise ConfigError(f'robot {name_or_path!r} is no built-in name and no file', expected)
    if path.suffix not in ('.yaml', '.yml'):
        raise ConfigError(f'robot file {path} with ending {path.suffix!r}', expected)
    try:
        document = yaml.safe_load(path.read_text(encoding='utf-8'))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigError(f'robot file {path} is not YAML ({error})', expected) from error
    return _build(document, path)


def _build(document: object, path: Path) -> Robot:
    if not isinstance(document, dict):
        raise ConfigError(f'robot file {path} holds {type(document).__name__}', 'a mapping')
    problems = [f'unknown key {key!r}' for key in document if key not in _KEYS]
    if document.get('schema') != 1:
        problems.append(f'schema is {document.get("schema")!r}, not 1')
    base = document.get('robot')
    if base not in ROBOTS:
        problems.append(f'robot is {base!r}, not one of {sorted(ROBOTS)}')
    joints = document.get('joints')
    if joints is not None and not (
        isinstance(joints, list) and all(isinstance(joint, str) for joint in joints)
    ):
        problems.append(f'joints is {joints!r}, not a list of names')
    prior = _read_parameters(document.get('parameters', {}), problems)
    if problems:
        raise ConfigError(
            f'robot file {path}: ' + ' | '.join(problems), f'the keys {sorted(_KEYS)}'
        )
    robot = ROBOTS[str(base)]
    if joints is not None:
        robot = robot.renamed(joints)
    return robot.with_prior(prior)


def _read_parameters(entries: Any, problems: list[str]) -> dict[str, tuple[float, float]]:
    if not isinstance(entries, dict):
        problems.append(f'parameters is {entries!r}, not a mapping from names')
        return {}
    prior = {}
    for name, entry in entries.items():
        if not isinstance(entry, dict) or not {'value'} <= set(entry) <= {'value', 'std', 'unit'}:
            problems.append(f'parameter {name}: {entry!r} is no {{value, std, unit}}')
            continue
        value, std = entry['value'], entry.get('std')
        std = math.inf if std is None else std
        numbers = all(
            isinstance(x, (int, float)) and not isinstance(x, bool) for x in (value, std)
        )
        if not numbers or not math.isfinite(value) or math.isnan(std) or std <= 0:
            problems.append(f'parameter {name}: {entry!r} has no finite value or no positive std')
            continue
        prior[str(name)] = (float(value), float(std))
    return prior
