"""The joints of a URDF text, with the same tree as the rigid-body library reads it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from xml.etree import ElementTree as ET

from sgp_ros.errors import ConfigError
from sgp_ros.simulation.followers import Follower, read_followers
from sgp_ros.simulation.mechanism import SimulatedJoint
from sgp_ros.simulation.tree_part import TreePart
from sgp_ros.simulation.urdf_elements import MOVING, link_of, number_of, root_of, vector_of

_PREFIX = 'link:'
_PAYLOAD = 'payload'
STAND_IN_MASS, STAND_IN_RADIUS = 1.0, 0.1
"""Of the balls that stand in for the links of a URDF without masses [kg, m]."""
_SMALLEST = 1e-14
"""Mass [kg] and principal inertia [kg m^2] of links without: the library asks for some."""


@dataclass(frozen=True, slots=True)
class TreeText:
    """What a simulation needs of a URDF.

    Attributes:
        name: of the robot.
        joints: k that move on their own, in the order of the file.
        followers: joints that follow one of them.
        friction: (k,) dry friction of `<dynamics>`, with that of followers [N m or N].
        command_joints: those with an effort interface in `ros2_control`; where none has one, those
            with any; all without such a block.
        last_joint: the joint nearest to `tool0`, or the last one of the file.
        last_link: the link on it.
        tool_link: `tool0`, or the last link.
        stand_ins: links with a ball in place of a body, see `stand_in_bodies`.
    """

    name: str
    joints: tuple[SimulatedJoint, ...]
    followers: tuple[Follower, ...]
    friction: tuple[float, ...]
    command_joints: tuple[str, ...]
    last_joint: str
    last_link: str
    tool_link: str
    stand_ins: tuple[str, ...] = ()


def read_tree(urdf: str, part: TreePart | None = None) -> TreeText:
    """Return the joints of a URDF text.

    Args:
        urdf: the text, of the part where there is one.
        part: says which joints have motors and which one is the last; None leaves it to the file.

    Raises:
        ConfigError: no URDF, or joints that are no single degree of freedom.
    """
    root = root_of(urdf)
    moving = {j.get('name', ''): j for j in root.findall('joint') if j.get('type') != 'fixed'}
    for name, joint in moving.items():
        if joint.get('type') not in MOVING:
            raise ConfigError(
                f'joint {name!r} of type {joint.get("type")}', f'one of {[*MOVING, "fixed"]}'
            )
    followers = read_followers(root)
    own = {name: joint for name, joint in moving.items() if name not in followers}
    if not own:
        raise ConfigError(f'robot {root.get("name")!r} without a moving joint', 'one at least')
    tool, last = _ends(root, own)
    last = last if part is None else own[part.joints[-1]]
    return TreeText(
        root.get('name') or 'robot',
        tuple(_joint(joint) for joint in own.values()),
        tuple(followers.values()),
        tuple(_dry(name, moving, followers) for name in own),
        _driven(root, tuple(own)) if part is None else part.motors,
        last.get('name', ''),
        link_of(last, 'child'),
        tool,
        tuple(stand_in_bodies(root)),
    )


def _ends(root: ET.Element, own: Mapping[str, ET.Element]) -> tuple[str, ET.Element]:
    """Return the link of the tool and the joint with a motion of its own that carries it."""
    carried = {link_of(joint, 'child'): joint for joint in root.findall('joint')}
    final = list(own.values())[-1]
    tool = 'tool0' if 'tool0' in carried else link_of(final, 'child')
    last = carried[tool]
    while last.get('name') not in own and link_of(last, 'parent') in carried:
        last = carried[link_of(last, 'parent')]
    return tool, last if last.get('name') in own else final


def _dry(name: str, moving: Mapping[str, ET.Element], followers: Mapping[str, Follower]) -> float:
    """Return the dry friction of a joint and of those that follow it."""
    ratios = {f.name: abs(f.multiplier) for f in followers.values() if f.leader == name}
    return sum(
        ratio * number_of(moving[joint].find('dynamics'), 'friction', 0.0)
        for joint, ratio in {name: 1.0, **ratios}.items()
    )


def _driven(root: ET.Element, names: tuple[str, ...]) -> tuple[str, ...]:
    interfaces = [
        (joint.get('name', ''), interface.get('name'))
        for block in root.iter('ros2_control')
        for joint in block.iter('joint')
        for interface in joint.iter('command_interface')
    ]
    driven = {joint for joint, kind in interfaces if kind == 'effort'}
    driven = driven or {joint for joint, _ in interfaces}
    return tuple(name for name in names if name in driven or not driven)


def plain_tree(urdf: str, tree: TreeText, payload: tuple[float, float, float, float]) -> str:
    """Return links, inertias and joints alone, with a payload `(mass, x, y, z)` on the last link.

    Links are renamed `link:NAME`: a name such as `world` means something to the library.
    """
    root = root_of(urdf)
    plain = ET.Element('robot', name='tree')
    options = {
        'fusestatic': 'false', 'balanceinertia': 'false', 'discardvisual': 'true',
        'boundmass': repr(_SMALLEST), 'boundinertia': repr(_SMALLEST),
    }  # fmt: skip
    ET.SubElement(ET.SubElement(plain, 'mujoco'), 'compiler', options)
    stand_ins = stand_in_bodies(root)
    for link in root.findall('link'):
        name = link.get('name', '')
        copy = ET.SubElement(plain, 'link', name=_PREFIX + name)
        copy.extend([stand_ins[name]] if name in stand_ins else link.findall('inertial'))
    for joint in root.findall('joint'):
        kind = 'continuous' if joint.get('type') == 'revolute' else joint.get('type', '')
        copy = ET.SubElement(plain, 'joint', name=joint.get('name', ''), type=kind)
        for end in ('parent', 'child'):
            ET.SubElement(copy, end, link=_PREFIX + link_of(joint, end))
        copy.extend(x for tag in ('origin', 'axis') for x in joint.findall(tag))
        damping = number_of(joint.find('dynamics'), 'damping', 0.0)
        ET.SubElement(copy, 'dynamics', damping=repr(damping))
        if kind == 'prismatic':
            ET.SubElement(copy, 'limit', lower='-1e9', upper='1e9', effort='0', velocity='0')
    if payload[0] > 0.0:
        _add_payload(plain, _PREFIX + tree.last_link, payload)
    return ET.tostring(plain, encoding='unicode')


def stand_in_bodies(root: ET.Element) -> dict[str, ET.Element]:
    """Return a body for each moving link of a URDF that states no inertia at all, by link.

    Such a file tells the kinematics alone. Each link becomes a solid ball halfway to its next
    joints, so that the robot can be moved; its efforts are those of no real machine.
    """
    if root.find('.//inertial') is not None:
        return {}
    joints = root.findall('joint')
    bodies = {}
    for link in [link_of(joint, 'child') for joint in joints if joint.get('type') in MOVING]:
        following = [
            vector_of(joint.find('origin'), 'xyz', '0 0 0')
            for joint in joints if link_of(joint, 'parent') == link
        ]  # fmt: skip
        middle = [sum(x) / (2.0 * len(following)) for x in zip(*following, strict=True)]
        body = ET.Element('inertial')
        ET.SubElement(body, 'origin', xyz=' '.join(map(repr, middle or (0.0, 0.0, 0.0))))
        ET.SubElement(body, 'mass', value=repr(STAND_IN_MASS))
        about = 0.4 * STAND_IN_MASS * STAND_IN_RADIUS**2
        tensor = dict.fromkeys(('ixx', 'iyy', 'izz'), repr(about))
        ET.SubElement(body, 'inertia', dict.fromkeys(('ixy', 'ixz', 'iyz'), '0') | tensor)
        bodies[link] = body
    return bodies


def tree_link(name: str) -> str:
    """Return the name that a link has in `plain_tree`."""
    return _PREFIX + name


def _add_payload(plain: ET.Element, link: str, payload: tuple[float, float, float, float]) -> None:
    body = ET.SubElement(ET.SubElement(plain, 'link', name=_PAYLOAD), 'inertial')
    ET.SubElement(body, 'mass', value=repr(payload[0]))
    tensor = dict.fromkeys(('ixx', 'iyy', 'izz', 'ixy', 'ixz', 'iyz'), '0')
    ET.SubElement(body, 'inertia', tensor)
    joint = ET.SubElement(plain, 'joint', name=_PAYLOAD, type='fixed')
    ET.SubElement(joint, 'parent', link=link)
    ET.SubElement(joint, 'child', link=_PAYLOAD)
    ET.SubElement(joint, 'origin', xyz=' '.join(map(repr, payload[1:])))


def _joint(joint: ET.Element) -> SimulatedJoint:
    limit, kind = joint.find('limit'), joint.get('type')
    is_free = kind == 'continuous'
    return SimulatedJoint(
        joint.get('name', ''),
        is_prismatic=kind == 'prismatic',
        is_continuous=is_free,
        lower=-math.inf if is_free else number_of(limit, 'lower', -math.inf),
        upper=math.inf if is_free else number_of(limit, 'upper', math.inf),
        effort=number_of(limit, 'effort', math.inf) or math.inf,
    )
