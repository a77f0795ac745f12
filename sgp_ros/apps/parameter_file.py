"""ROS 2 parameter files as the commands read them: the same files that configure the node."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

import sgp_ros
from sgp_ros.errors import ConfigError

NODE_ONLY = frozenset({
    'command.type', 'diagnostics.period', 'model.path', 'parameters.period', 'qos.depth',
    'record.path', 'robot', 'save.path', 'start_type_description_service', 'use_sim_time',
})  # fmt: skip
"""Parameters of the node that mean nothing to a command; a test holds them to the node's."""

_EXPECTED = 'a ROS 2 parameter file: /**: ros__parameters: name: value'


def load_parameters(path: str | Path) -> dict[str, object]:
    """Return the settings of a ROS 2 parameter file by dotted name.

    Raises:
        ConfigError: no such file, no YAML, or another structure; all problems in one error.
    """
    source = Path(path)
    if not source.is_file():
        raise ConfigError(f'no parameter file {source}', _EXPECTED)
    try:
        document = yaml.safe_load(source.read_text(encoding='utf-8'))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigError(f'{source} is not YAML ({error})', _EXPECTED) from error
    if not isinstance(document, dict):
        raise ConfigError(f'{source} holds {type(document).__name__}', _EXPECTED)
    settings: dict[str, object] = {}
    problems: list[str] = []
    for section, body in document.items():
        if not isinstance(body, dict) or not isinstance(body.get('ros__parameters'), dict):
            problems.append(f'section {section!r} has no ros__parameters')
            continue
        _flatten('', body['ros__parameters'], settings)
    if problems:
        raise ConfigError(f'{source}: ' + ' | '.join(problems), _EXPECTED)
    return {
        name: value
        for name, value in settings.items()
        if name not in NODE_ONLY and not name.startswith('qos_overrides.')
    }


def find_shipped(name: str) -> Path | None:
    """Return a file of `config/`, from the source tree or from where it was installed."""
    package = Path(sgp_ros.__file__).parent
    folders = [package.parent / 'config']
    # <prefix>/lib/python3.X/site-packages/sgp_ros with share/ beside lib/, for pip and colcon.
    folders += [parent / 'share' / 'sgp_ros' / 'config' for parent in package.parents[2:5]]
    return next((folder / name for folder in folders if (folder / name).is_file()), None)


def _flatten(prefix: str, entries: dict[Any, Any], settings: dict[str, object]) -> None:
    for key, value in entries.items():
        name = f'{prefix}{key}'
        if isinstance(value, dict):
            _flatten(f'{name}.', value, settings)
        else:
            settings[name] = value
