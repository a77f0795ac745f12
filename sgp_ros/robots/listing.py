"""Names of the robots that come with the package, read without what computes.

To build a robot takes the numerical packages; a list of names, joints and one line each does not.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import yaml

from sgp_ros.robots.shipped import shipped_folder

_MOVING = ('revolute', 'continuous', 'prismatic')
_LOADER = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)


@dataclass(frozen=True, slots=True)
class ListedRobot:
    """A built-in robot.

    Attributes:
        name: that commands take.
        description: one line.
        joints: names.
    """

    name: str
    description: str
    joints: tuple[str, ...]


def listed_robots() -> Iterator[ListedRobot]:
    """Yield the built-in robots by name, in the order of `registry.robot_names`."""
    for path in sorted((shipped_folder() / 'robots').glob('*.yaml')):
        document = yaml.load(path.read_text(encoding='utf-8'), _LOADER)  # noqa: S506 - a safe one
        joints = tuple(
            joint['name'] if isinstance(joint, dict) else joint
            for joint in document.get('joints') or _moving(document, path.parent)
        )
        yield ListedRobot(path.stem, _description(document), joints)


def _description(document: Mapping[str, Any]) -> str:
    if 'description' in document:
        return str(document['description'])
    own = dict.fromkeys(entry['effect'].replace('_', ' ') for entry in document.get('effects', ()))
    return f'Rigid bodies of {document["urdf"]}' + (f' with {", ".join(own)}' if own else '')


def _moving(document: Mapping[str, Any], folder: Path) -> list[str]:
    """Return the joints of a URDF that move, but those that the document locks."""
    root = ET.parse(folder / document['urdf']).getroot()  # noqa: S314 - a file of the package
    return [
        str(joint.get('name'))
        for joint in root.findall('joint')
        if joint.get('type') in _MOVING
        and joint.find('mimic') is None
        and joint.get('name') not in document.get('locked', {})
    ]
