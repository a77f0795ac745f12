"""Files of saved models and of settings: written whole or not at all, read with every check.

Settings stand in ROS 2 parameter files, the same for the node and for the commands, and in models.
"""

from __future__ import annotations

import hashlib
import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from sgp_ros.errors import ConfigError, SgpError
from sgp_ros.markup import load_yaml
from sgp_ros.strangers import read_text, readable, replace_file, require_file, require_within

NODE_ONLY = frozenset({
    'command.type', 'diagnosis.window', 'diagnostics.period', 'joints', 'model.path',
    'monitor.duration', 'monitor.false_alarms', 'parameters.period', 'qos.depth', 'record.path',
    'record.split.age', 'record.split.size', 'robot', 'robot_description', 'save.path',
    'save.name', 'save.period', 'save.restore', 'start_type_description_service', 'use_sim_time',
})  # fmt: skip
"""Parameters of the node that mean nothing to a command; a test holds them to the node's."""

_HASH = 'sha256'
_EXPECTED = 'a ROS 2 parameter file: /**: ros__parameters: name: value'


def save_model(path: Path, snapshot: Mapping[str, np.ndarray]) -> None:
    """Write the snapshot (.npz) as the one file that it is, settings within.

    Args:
        path: of the .npz; missing folders are made.
        snapshot: arrays without objects.

    Raises:
        OSError: the folder cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    arrays: dict[str, Any] = {**snapshot, _HASH: np.array(_hash(snapshot))}
    replace_file(path, lambda file: np.savez(file, **arrays))


def is_model(path: Path) -> bool:
    """Whether a file has the entries that `save_model` writes, of which none is read."""
    try:
        require_file(path)
        with zipfile.ZipFile(path) as archive:
            return {f'{_HASH}.npy', 'json.npy'} <= set(archive.namelist())
    except (SgpError, OSError, ValueError, zipfile.BadZipFile):
        return False


def load_model(path: Path) -> dict[str, np.ndarray]:
    """Read a saved snapshot.

    Raises:
        ConfigError: no such file, none that `save_model` wrote, or one that was changed since.
    """
    expected = 'a model.npz of `sgp replay` or ~/save'
    if not path.exists():
        raise ConfigError(f'no model file {path}', expected)
    require_file(path, 'TABLE_MB')
    with readable(path, ConfigError, expected):
        try:
            require_unpacked(path)
            with np.load(path, allow_pickle=False) as file:
                arrays = {name: file[name] for name in file.files}
        except (ValueError, EOFError, AttributeError, OSError, zipfile.BadZipFile) as error:
            raise ConfigError(f'{path} is not a saved model', expected) from error
    kept = arrays.pop(_HASH, None)
    if kept is None or str(kept) != _hash(arrays):
        raise ConfigError(
            f'{path} is damaged or was edited: its hash does not match', expected, 'save it again'
        )
    wrong = [n for n, x in arrays.items() if x.dtype.kind == 'f' and not np.isfinite(x).all()]
    if wrong:
        raise ConfigError(f'{path}: numbers in {wrong} are not finite', expected)
    return arrays


def require_unpacked(path: Path) -> None:
    """Refuse an archive that unpacks to more than `UNPACKED_MB`.

    Raises:
        TooMuchError: it does.
        zipfile.BadZipFile: it is not an archive.
    """
    with zipfile.ZipFile(path) as archive:
        size = sum(entry.file_size for entry in archive.infolist())
    require_within(size / (1 << 20), 'UNPACKED_MB', f'unpacked size of {path} in MB')


def _hash(arrays: Mapping[str, np.ndarray]) -> str:
    """Return the SHA-256 of names, types, shapes and bytes of all arrays."""
    found = hashlib.sha256()
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        found.update(f'{name} {array.dtype.str} {array.shape} '.encode())
        found.update(array.tobytes())
    return found.hexdigest()


def load_parameters(path: str | Path) -> dict[str, object]:
    """Return the settings of a ROS 2 parameter file, or of a saved model, by dotted name.

    Raises:
        ConfigError: no such file, no YAML, or another structure; all problems in one error.
    """
    source = Path(path)
    if not source.is_file():
        raise ConfigError(f'no parameter file {source}', _EXPECTED)
    if source.suffix == '.npz':
        arrays = load_model(source)
        with readable(source, ConfigError, 'a saved model'):
            return dict(json.loads(str(arrays['json']))['settings'])
    with readable(source, ConfigError, _EXPECTED):
        return _parameters_of(source)


def _parameters_of(source: Path) -> dict[str, object]:
    try:
        document = load_yaml(read_text(source))
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


def _flatten(prefix: str, entries: dict[Any, Any], settings: dict[str, object]) -> None:
    for key, value in entries.items():
        name = f'{prefix}{key}'
        if isinstance(value, dict):
            _flatten(f'{name}.', value, settings)
        else:
            settings[name] = value
