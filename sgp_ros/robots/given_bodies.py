"""Bodies that a user states beside a URDF which lacks them, such as those of a data sheet.

A YAML file names links that move, and of each the whole that moves with it, what is fixed to it
included:

    link_6: {mass: 0.2, com: [0.0, 0.0, 0.042], inertia: [1e-4, 0, 1e-4, 0, 0, 1e-4]}

`com` is the centre of mass in the frame of the link [m], `inertia` holds xx, xy, yy, xz, yz, zz
about that centre in the axes of the link [kg m^2].
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from sgp_ros.errors import ConfigError
from sgp_ros.markup import load_yaml
from sgp_ros.rigid.pseudo_inertia import is_consistent
from sgp_ros.rigid.urdf_writer import write_urdf
from sgp_ros.robots.entries import Entries
from sgp_ros.robots.robot import Robot
from sgp_ros.robots.urdf_robot import nominal_tree, urdf_text
from sgp_ros.strangers import read_text

_EXAMPLE = 'such as link: {mass: 0.2, com: [0, 0, 0.04], inertia: [xx, xy, yy, xz, yz, zz]}'


def with_bodies(robot: Robot, path: str | Path) -> Robot:
    """Return a robot from a URDF with the bodies of a file in it.

    Args:
        robot: from a URDF.
        path: YAML file, see above.

    Raises:
        ConfigError: a robot without URDF, no such file, or everything that is wrong with it.
    """
    path = Path(path)
    known = nominal_tree(robot).link_names
    if not path.is_file():
        raise ConfigError(f'no file of bodies at {path}', f'YAML, {_EXAMPLE}', 'check the path')
    try:
        document = load_yaml(read_text(path))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigError(f'bodies {path} are not YAML ({error})', 'a YAML file') from error
    if not isinstance(document, dict) or not document:
        raise ConfigError(f'bodies {path} name no link', f'a mapping, {_EXAMPLE}')
    problems: list[str] = []
    bodies = {
        str(link): _parameters(str(link), given, known, problems)
        for link, given in document.items()
    }
    if problems:
        raise ConfigError(f'bodies {path}: ' + ' | '.join(problems), _EXAMPLE)
    text = write_urdf(urdf_text(robot), bodies, {})
    return replace(robot, source={**robot.source, 'urdf': text})


def _parameters(
    link: str, given: object, known: tuple[str, ...], problems: list[str]
) -> np.ndarray:
    """Return mass, first moment, and inertia about the origin of the link, (10,)."""
    before = len(problems)
    if link not in known:
        problems.append(f'link {link!r} is not one of the moving links {list(known)}')
    document: Mapping[Any, Any] = given if isinstance(given, dict) else {}
    entries = Entries(document, problems, f'{link}.')
    entries.refuse_others({'mass', 'com', 'inertia'})
    mass = entries.positive('mass', None)
    c = np.array(entries.vector('com', 3))
    about = np.array(entries.vector('inertia', 6))
    x, y, z = c
    shift = mass * np.array([y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y])
    found = np.concatenate([[mass], mass * c, about + shift])
    if len(problems) == before and not is_consistent(found):
        problems.append(f'{link}: no body can have the inertia {about.tolist()} about its centre')
    return found
