"""The joints and links of a URDF as values, which of them are driven, and which follow.

Source: the URDF XML specification of ROS; documentation of ros2_control, hardware components and
mimic joints.
"""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree import ElementTree as ET

MOVING = ('revolute', 'continuous', 'prismatic')
"""Types of joints that move."""


@dataclass(frozen=True, slots=True)
class UrdfJoint:
    """A `<joint>` as it stands in the file.

    Attributes:
        name: of the joint.
        kind: `revolute`, `continuous`, `prismatic` or `fixed`.
        parent: link it starts from.
        child: link it carries.
        axis: unit vector in the frame of the joint.
        lower: least position [rad or m], -inf where none is stated.
        upper: greatest position [rad or m], inf where none is stated.
        velocity: limit [rad/s or m/s], inf where none is stated.
        effort: limit [N m or N], inf where none is stated.
        damping: viscous coefficient of `<dynamics>` [N m s/rad or N s/m].
        friction: Coulomb friction of `<dynamics>` [N m or N].
        follows: joint that it mimics; None where it moves on its own.
        multiplier: position per position of that joint.
        offset: position where that joint is at 0 [rad or m].
    """

    name: str
    kind: str
    parent: str
    child: str
    axis: tuple[float, float, float]
    lower: float
    upper: float
    velocity: float
    effort: float
    damping: float
    friction: float
    follows: str | None
    multiplier: float
    offset: float


@dataclass(frozen=True, slots=True)
class Urdf:
    """Dynamics stated by a URDF.

    Attributes:
        name: of the robot.
        place: file it was read from, for messages.
        joints: all joints by name, in the order of the file.
        links: names of all links.
        commanded: joints that `ros2_control` drives; None where it names none.
        plain: the same tree as XML of links, inertias and joints alone. Every moving joint is
            revolute or prismatic there, and none follows another.
    """

    name: str
    place: str
    joints: dict[str, UrdfJoint]
    links: tuple[str, ...]
    commanded: frozenset[str] | None
    plain: str


def commanded_joints(root: ET.Element) -> frozenset[str] | None:
    """Return the joints with an effort interface; where none has one, those with any."""
    interfaces = [
        (joint.get('name', ''), interface.get('name', ''))
        for block in root.iter('ros2_control')
        for joint in block.iter('joint')
        for interface in joint.iter('command_interface')
    ]
    effort = frozenset(joint for joint, interface in interfaces if interface == 'effort')
    return effort or frozenset(joint for joint, _ in interfaces) or None


def mimic_parameters(root: ET.Element) -> dict[str, ET.Element]:
    """Return by joint what its parameters in `ros2_control` say, as a `<mimic>` would.

    These are `mimic`, the joint that is followed, `multiplier` and `offset`.
    """
    found = {}
    for block in root.iter('ros2_control'):
        for joint in block.iter('joint'):
            said: dict[str, str] = {
                p.get('name', ''): (p.text or '').strip() for p in joint.findall('param')
            }
            if 'mimic' in said:
                mimic = ET.Element('mimic', {'joint': said['mimic']})
                for key in {'multiplier', 'offset'} & set(said):
                    mimic.set(key, said[key])
                found[joint.get('name', '')] = mimic
    return found
