"""The part of a URDF that is simulated, as a URDF of its own.

Joints that stand still become fixed where they stand, the others take the order wanted, and a
load becomes one more link.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from xml.etree import ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from sgp_ros.simulation.urdf_elements import root_of, vector_of

_ENTRIES = ('ixx', 'ixy', 'iyy', 'ixz', 'iyz', 'izz')


@dataclass(frozen=True, slots=True)
class Load:
    """A body that is fixed to a link.

    Attributes:
        link: name of the link.
        mass: [kg].
        centre: (3,) its centre of mass in the frame of the link [m].
        inertia: xx, xy, yy, xz, yz, zz about that centre, axes of the link [kg m^2].
    """

    link: str
    mass: float
    centre: tuple[float, ...]
    inertia: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class TreePart:
    """What moves of a URDF, and how it is driven.

    Attributes:
        joints: that move on their own, in this order; the link of the last one carries payloads.
        locked: position of those that stand still [rad or m].
        motors: joints that are commanded, in the order of the commands.
        effort_gain: force per unit of commands and measured efforts, by joint; 1 where none
            stands [N m or N per unit].
        loads: known ones.
    """

    joints: tuple[str, ...]
    locked: Mapping[str, float] = field(default_factory=dict)
    motors: tuple[str, ...] = ()
    effort_gain: Mapping[str, float] = field(default_factory=dict)
    loads: tuple[Load, ...] = ()

    def gains(self, joints: tuple[str, ...]) -> np.ndarray:
        """Return the force per unit of the effort of some joints, (n,) [N m or N per unit]."""
        return np.array([self.effort_gain.get(name, 1.0) for name in joints])


def part_of_urdf(urdf: str, part: TreePart) -> str:
    """Return the URDF of a part.

    Raises:
        ConfigError: a text that is no URDF.
    """
    root = root_of(urdf)
    joints = {joint.get('name', ''): joint for joint in root.findall('joint')}
    for name, position in part.locked.items():
        _lock(joints[name], position)
    for joint in joints.values():
        root.remove(joint)
    root.extend(joints[name] for name in part.joints)
    root.extend(joint for name, joint in joints.items() if name not in part.joints)
    for number, load in enumerate(part.loads):
        _add(root, f'load {number} of {load.link}', load)
    return ET.tostring(root, encoding='unicode')


def _lock(joint: ET.Element, position: float) -> None:
    """Fix a joint where it stands: `R Rot(axis, position)` or `p + R axis position`."""
    origin = joint.find('origin')
    place = np.array(vector_of(origin, 'xyz', '0 0 0'))
    turn = Rotation.from_euler('xyz', vector_of(origin, 'rpy', '0 0 0'))
    axis = np.array(vector_of(joint.find('axis'), 'xyz', '1 0 0'))
    way = position * axis / np.linalg.norm(axis)
    if joint.get('type') == 'prismatic':
        place = place + turn.apply(way)
    else:
        turn = turn * Rotation.from_rotvec(way)
    for element in list(joint):
        if element.tag not in {'parent', 'child'}:
            joint.remove(element)
    joint.set('type', 'fixed')
    ET.SubElement(joint, 'origin', xyz=_words(place), rpy=_words(_rpy(turn.as_matrix())))


def _rpy(R: np.ndarray) -> tuple[float, float, float]:
    """Return roll, pitch and yaw of `R = Rz(yaw) Ry(pitch) Rx(roll)`.

    Pitch and yaw are read from `R Rx(-roll)`, so they suit any roll that rounding leaves where
    the pitch is a right angle.
    """
    roll = math.atan2(R[2, 1], R[2, 2])
    c, s = math.cos(roll), math.sin(roll)
    across, up = c * R[:, 1] - s * R[:, 2], s * R[:, 1] + c * R[:, 2]
    return roll, math.atan2(-R[2, 0], up[2]), math.atan2(-across[0], across[1])


def _add(root: ET.Element, name: str, load: Load) -> None:
    inertial = ET.SubElement(ET.SubElement(root, 'link', name=name), 'inertial')
    ET.SubElement(inertial, 'origin', xyz=_words(load.centre))
    ET.SubElement(inertial, 'mass', value=repr(float(load.mass)))
    entries = {key: repr(float(x)) for key, x in zip(_ENTRIES, load.inertia, strict=True)}
    ET.SubElement(inertial, 'inertia', entries)
    joint = ET.SubElement(root, 'joint', name=name, type='fixed')
    ET.SubElement(joint, 'parent', link=load.link)
    ET.SubElement(joint, 'child', link=name)


def _words(numbers: tuple[float, ...] | np.ndarray) -> str:
    return ' '.join(repr(float(x)) for x in numbers)
