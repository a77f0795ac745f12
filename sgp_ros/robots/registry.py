"""Robots by name or file.

A robot YAML is one of three. It states a few lumped coefficients by formulas, see `lumped`. It
names a URDF, see `urdf_robot`. Or it names a robot that comes with the package and changes what
differs: joint names, and prior means and standard deviations of coefficients. `sgp replay` writes
its result in the same forms, so what was identified on one recording is the prior for the next.

    schema: 1
    robot: linear_axis
    joints: [slide]
    parameters:
      M: {value: 95.1, std: 0.2, unit: kg}

The robots that come with the package are the files of `config/robots`: one more file there is one
more robot.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from sgp_ros.errors import ConfigError
from sgp_ros.markup import load_yaml
from sgp_ros.robots.entries import Entries, is_positive
from sgp_ros.robots.lumped import LUMPED_KEYS, build_lumped_robot
from sgp_ros.robots.models.door import MODEL_ENDINGS, find_file, read_model
from sgp_ros.robots.robot import Robot
from sgp_ros.robots.shipped import shipped_folder
from sgp_ros.strangers import is_usable, read_text, readable, require_file

_KEYS = frozenset({'schema', 'robot', 'joints', 'parameters'})
_URDF_KEYS = frozenset({
    'schema', 'urdf', 'name', 'joints', 'locked', 'passive', 'effort_gain', 'payload', 'terms',
    'coulomb_width', 'stribeck_velocity', 'prior', 'residual_inputs', 'effects', 'parameters',
    'gains', 'remarks', 'model',
})  # fmt: skip


def robot_names() -> tuple[str, ...]:
    """Return the names of the robots that come with the package, sorted."""
    return tuple(sorted(path.stem for path in _folder().glob('*.yaml')))


def load_robot(name_or_path: str) -> Robot:
    """Return a robot that comes with the package, or one that a robot or model file describes.

    Args:
        name_or_path: a name, a file, or the text of a URDF or of a robot YAML.

    Raises:
        ConfigError: neither a known name nor a readable robot file; all problems of a file are
            listed in one error.
    """
    if name_or_path in robot_names():
        return _shipped(_folder() / f'{name_or_path}.yaml')
    if '\n' in name_or_path or name_or_path.lstrip().startswith('<'):
        return _from_text(name_or_path)
    path = find_file(name_or_path, Path())
    expected = f'one of {list(robot_names())} or a robot file (.yaml, {", ".join(MODEL_ENDINGS)})'
    if not path.is_file():
        raise ConfigError(
            f'robot {name_or_path!r} is neither a built-in robot nor a file', expected
        )
    require_file(path, 'TEXT_MB')
    with readable(path, ConfigError, 'a robot file'):
        return _from_file(path, expected)


def _from_file(path: Path, expected: str) -> Robot:
    if path.suffix.lower() in MODEL_ENDINGS:
        return _plain(path)
    if path.suffix not in ('.yaml', '.yml'):
        raise ConfigError(f'robot file {path} has the file type {path.suffix!r}', expected)
    return _build(path)


def _folder() -> Path:
    return shipped_folder() / 'robots'


@cache
def _shipped(path: Path) -> Robot:
    """Return a robot of the package; a lumped one is known by its name from then on."""
    robot = _build(path)
    return robot if 'urdf' in robot.source else replace(robot, source={})


def _plain(path: Path) -> Robot:
    return _of_document(read_model(path), path)


def _of_document(document: Mapping[str, Any], path: Path) -> Robot:
    problems: list[str] = []
    robot = _from_urdf(document, path, problems)
    if problems or robot is None:
        raise ConfigError(' | '.join(problems))
    return robot


def _from_text(text: str) -> Robot:
    """Return the robot of a URDF or robot YAML that is given as text, as on a ROS topic."""
    if text.lstrip().startswith('<'):
        return _of_document({'urdf': text}, Path())
    return _from_document(text, Path('(text)'))


def _build(path: Path) -> Robot:
    try:
        text = read_text(path)
    except UnicodeDecodeError as error:
        raise ConfigError(f'robot file {path} is not YAML ({error})', 'a robot YAML') from error
    return _from_document(text, path)


def _from_document(text: str, path: Path) -> Robot:
    try:
        document = load_yaml(text)
    except yaml.YAMLError as error:
        raise ConfigError(f'robot file {path} is not YAML ({error})', 'a robot YAML') from error
    if not isinstance(document, dict):
        raise ConfigError(f'robot file {path} contains {type(document).__name__}', 'a mapping')
    problems: list[str] = []
    if document.get('schema') != 1:
        problems.append(f'schema is {document.get("schema")!r}, not 1')
    read, keys = _form(document, path)
    robot = read(document, problems)
    prior = _read_parameters(document.get('parameters', {}), problems)
    if robot is not None:
        try:
            robot = robot.with_prior(prior)
        except ConfigError as error:
            problems.append(str(error))
    if problems or robot is None:
        text = ' | '.join(problems)
        known = f'the keys {sorted(keys)}' if not problems or 'unknown key' in text else ''
        raise ConfigError(f'robot file {path}: {text}', known)
    return robot


def _form(
    document: Mapping[str, Any], path: Path
) -> tuple[Callable[[Mapping[str, Any], list[str]], Robot | None], frozenset[str]]:
    """Return how a robot YAML of this form is read, and the keys that it may have."""
    if 'urdf' in document:
        return lambda entries, problems: _from_urdf(entries, path, problems), _URDF_KEYS
    if 'coefficients' in document:
        return build_lumped_robot, LUMPED_KEYS
    return _changed, _KEYS


def _from_urdf(document: Mapping[str, Any], path: Path, problems: list[str]) -> Robot | None:
    from sgp_ros.robots.urdf_robot import (  # noqa: PLC0415  # a lumped robot needs no Pinocchio
        build_urdf_robot,
    )

    Entries(document, problems).refuse_others(_URDF_KEYS)
    return build_urdf_robot(document, path.parent, problems)


def _changed(document: Mapping[str, Any], problems: list[str]) -> Robot | None:
    """Return a robot of the package with the joint names that the document states."""
    entries = Entries(document, problems)
    entries.refuse_others(_KEYS)
    base = document.get('robot')
    joints = entries.names('joints')
    if not isinstance(base, str) or base not in robot_names():
        problems.append(
            f'robot is {base!r}, not one of {list(robot_names())}, '
            'and there is neither urdf nor coefficients'
        )
        return None
    try:
        return load_robot(base) if joints is None else load_robot(base).renamed(joints)
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
            problems.append(f'parameter {name} is {entry!r}, not {{value, std, unit}}')
            continue
        value, std = entry['value'], entry.get('std')
        std = math.inf if std is None else std
        is_spread = std == math.inf or is_positive(std)
        if not is_usable(value) or not is_spread:
            problems.append(f'parameter {name}: {entry!r} has no finite value or no positive std')
            continue
        prior[str(name)] = (float(value), float(std))
    return prior
