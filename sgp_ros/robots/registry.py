"""Robots by name or file.

A robot YAML names a built-in robot and changes what differs: joint names, and prior means and
standard deviations of coefficients. Or it names a URDF, see `urdf_robot`. `sgp replay` writes its
result in the same form, so what was identified on one recording is the prior for the next.

    schema: 1
    robot: linear_axis
    joints: [slide]
    parameters:
      M: {value: 95.1, std: 0.2, unit: kg}
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from sgp_ros.errors import ConfigError
from sgp_ros.robots.double_pendulum import DOUBLE_PENDULUM
from sgp_ros.robots.entries import Entries, is_finite
from sgp_ros.robots.linear_axis import LINEAR_AXIS
from sgp_ros.robots.reaction_wheel import REACTION_WHEEL, REACTION_WHEEL_6
from sgp_ros.robots.robot import Robot
from sgp_ros.robots.simple_pendulum import SIMPLE_PENDULUM
from sgp_ros.robots.toy_pendulum import TOY_PENDULUM

ROBOTS: dict[str, Robot] = {
    robot.name: robot
    for robot in (
        REACTION_WHEEL,
        REACTION_WHEEL_6,
        TOY_PENDULUM,
        LINEAR_AXIS,
        SIMPLE_PENDULUM,
        DOUBLE_PENDULUM,
    )
}
_KEYS = {'schema', 'robot', 'joints', 'parameters'}
_URDF_KEYS = {
    'schema', 'urdf', 'name', 'joints', 'locked', 'passive', 'effort_gain', 'payload', 'terms',
    'coulomb_width', 'stribeck_velocity', 'prior', 'residual_inputs', 'effects', 'parameters',
}  # fmt: skip


def load_robot(name_or_path: str) -> Robot:
    """Return a built-in robot, or the robot that a robot YAML or a URDF describes.

    Raises:
        ConfigError: neither a built-in name nor a readable robot file; all problems of a file are
            listed in one error.
    """
    if name_or_path in ROBOTS:
        return ROBOTS[name_or_path]
    path = Path(name_or_path)
    expected = f'one of {sorted(ROBOTS)} or a robot file (.yaml, .urdf)'
    if not path.is_file():
        raise ConfigError(f'robot {name_or_path!r} is no built-in name and no file', expected)
    if path.suffix == '.urdf':
        return _plain(path)
    if path.suffix not in ('.yaml', '.yml'):
        raise ConfigError(f'robot file {path} with ending {path.suffix!r}', expected)
    try:
        document = yaml.safe_load(path.read_text(encoding='utf-8'))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigError(f'robot file {path} is not YAML ({error})', expected) from error
    return _build(document, path)


def _plain(path: Path) -> Robot:
    problems: list[str] = []
    robot = _from_urdf({'urdf': path.name}, path, problems)
    if problems or robot is None:
        raise ConfigError(' | '.join(problems))
    return robot


def _build(document: object, path: Path) -> Robot:
    if not isinstance(document, dict):
        raise ConfigError(f'robot file {path} holds {type(document).__name__}', 'a mapping')
    problems: list[str] = []
    if document.get('schema') != 1:
        problems.append(f'schema is {document.get("schema")!r}, not 1')
    is_tree = 'urdf' in document
    robot = _from_urdf(document, path, problems) if is_tree else _built_in(document, problems)
    prior = _read_parameters(document.get('parameters', {}), problems)
    if robot is not None:
        try:
            robot = robot.with_prior(prior)
        except ConfigError as error:
            problems.append(str(error))
    if problems or robot is None:
        raise ConfigError(
            f'robot file {path}: ' + ' | '.join(problems),
            f'the keys {sorted(_URDF_KEYS if is_tree else _KEYS)}',
        )
    return robot


def _from_urdf(document: Mapping[str, Any], path: Path, problems: list[str]) -> Robot | None:
    from sgp_ros.robots.urdf_robot import (  # noqa: PLC0415  # a built-in robot needs no Pinocchio
        build_urdf_robot,
    )

    Entries(document, problems).refuse_others(_URDF_KEYS)
    return build_urdf_robot(document, path.parent, problems)


def _built_in(document: Mapping[str, Any], problems: list[str]) -> Robot | None:
    entries = Entries(document, problems)
    entries.refuse_others(_KEYS)
    base = document.get('robot')
    joints = entries.names('joints')
    if not isinstance(base, str) or base not in ROBOTS:
        problems.append(f'robot is {base!r}, not one of {sorted(ROBOTS)}, and there is no urdf')
        return None
    if joints is None:
        return ROBOTS[base]
    try:
        return ROBOTS[base].renamed(joints)
    except ConfigError as error:
        problems.append(str(error))
        return None


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
        is_spread = std == math.inf or (is_finite(std) and std > 0)
        if not is_finite(value) or not is_spread:
            problems.append(f'parameter {name}: {entry!r} has no finite value or no positive std')
            continue
        prior[str(name)] = (float(value), float(std))
    return prior
