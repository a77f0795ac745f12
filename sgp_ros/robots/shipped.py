"""Files that come with the package: robots, settings of the node, maps for imported tables."""

from __future__ import annotations

from pathlib import Path

import sgp_ros


def shipped_folder() -> Path:
    """Return `config/`, of the source tree or where it was installed.

    pip and colcon install it in `<prefix>/share/sgp_ros/config`, beside the package in
    `<prefix>/lib/python3.X/site-packages`. Where there is none, that of the source tree is named.
    """
    package = Path(sgp_ros.__file__).parent
    source = package.parent / 'config'
    shared = [parent / 'share' / 'sgp_ros' / 'config' for parent in package.parents[2:5]]
    return next((folder for folder in (source, *shared) if (folder / 'robots').is_dir()), source)


def find_shipped(name: str) -> Path | None:
    """Return a file of `config/`; None where it has no such file."""
    path = shipped_folder() / name
    return path if path.is_file() else None
