"""Packages that only some files or commands need, asked for when they are needed."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from sgp_ros.errors import ConfigError


def optional_package(name: str, purpose: str, extra: str) -> Any:
    """Return an imported package.

    Args:
        name: of the module.
        purpose: what it is needed for, as in `to read MJCF`.
        extra: of `sgp_ros` that installs it.

    Raises:
        ConfigError: it is not installed.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise ConfigError(
            f'the package {name}, needed {purpose}, is missing ({error})', name,
            f"pip install 'sgp_ros[{extra}]'",
        ) from error  # fmt: skip
