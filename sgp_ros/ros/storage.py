"""Saves and loads what an engine has learned, each file under its name only when complete."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import yaml

from sgp_ros.engine.samples import SettingValue
from sgp_ros.errors import ConfigError


def save_model(
    path: Path, snapshot: Mapping[str, np.ndarray], settings: Mapping[str, SettingValue]
) -> None:
    """Write the snapshot (.npz) and, beside it, the settings as a parameter file (.yaml).

    Args:
        path: of the .npz; missing folders are made.
        snapshot: arrays without objects.
        settings: by dotted name.

    Raises:
        OSError: the folder cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    text = yaml.safe_dump(_parameter_file(settings), sort_keys=False)
    _replace(path.with_suffix('.yaml'), lambda file: file.write(text.encode()))
    arrays: dict[str, Any] = dict(snapshot)
    _replace(path, lambda file: np.savez(file, **arrays))


def load_model(path: Path) -> dict[str, np.ndarray]:
    """Read a saved snapshot.

    Raises:
        ConfigError: no such file, or none that `save_model` wrote.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except FileNotFoundError as error:
        raise ConfigError(f'no file {path}', 'a saved model (.npz)') from error
    except (ValueError, EOFError, AttributeError, zipfile.BadZipFile) as error:
        raise ConfigError(f'{path} is no saved model', 'an .npz that ~/save wrote') from error


def _parameter_file(settings: Mapping[str, SettingValue]) -> dict[str, object]:
    tree: dict[str, object] = {}
    for name, value in settings.items():
        *parents, last = name.split('.')
        branch = tree
        for parent in parents:
            child = branch.setdefault(parent, {})
            assert isinstance(child, dict)
            branch = child
        branch[last] = list(value) if isinstance(value, tuple) else value
    return {'/**': {'ros__parameters': tree}}


def _replace(path: Path, write: Callable[[BinaryIO], object]) -> None:
    part = path.with_name(f'{path.name}.{os.getpid()}.part')
    try:
        with part.open('wb') as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
