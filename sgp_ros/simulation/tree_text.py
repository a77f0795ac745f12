"""The joints of a URDF text, with the same tree as the rigid-body library reads it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from xml.etree import ElementTree as ET

from sgp_ros.errors import ConfigError
from sgp_ros.simulation.mechanism import SimulatedJoint

_MOVING = ('revolute', 'continuous', 'prismatic')
_PREFIX = 'link:'
_PAYLOAD = 'payload'
_SMALLEST_INERTIA = 1e-12


@dataclass(frozen=True, slots=True)
class TreeText:
    """What a simulation needs of a URDF.

    Attributes:
        name: of the robot.
        joints: k moving ones, in the order of the file.
        friction: (k,) dry friction of `<dynamics>` [N m or N].
        command_joints: those with an effort interface in `ros2_control`; all without such a block.
        last_joint: the moving joint nearest to `tool0`, or the last one of the file.
        last_link: the link on it.
        tool_link: `tool0`, or the last link.
    """

    name: str
    joints: tuple[SimulatedJoint, ...]
    friction: tuple[float, ...]
    command_joints: tuple[str, ...]
    last_joint: str
    last_link: str
    tool_link: str


def read_tree(urdf: str) -> TreeText:
    """Return the joints of a URDF text.

    Raises:
        ConfigError: no URDF, or joints that are no single degree of freedom.
    """
    root = _root(urdf)
    elements = [j for j in root.findall('joint') if j.get('type') != 'fixed']
    for joint in elements:
        if joint.get('type') not in _MOVING or joint.find('mimic') is not None:
            kind = joint.get('type') if joint.find('mimic') is None else 'mimic'
            raise ConfigError(
                f'joint {joint.get("name")!r} of type {kind}', f'one of {[*_MOVING, "fixed"]}'
            )
    if not elements:
        raise ConfigError(f'robot {root.get("name")!r} without a moving joint', 'one at least')
    carried = {_link(joint, 'child'): joint for joint in root.findall('joint')}
    tool = 'tool0' if 'tool0' in carried else _link(elements[-1], 'child')
    last = carried[tool]
    while last.get('type') == 'fixed' and _link(last, 'parent') in carried:
        last = carried[_link(last, 'parent')]
    last = elements[-1] if last.get('type') == 'fixed' else last
    driven = {
        joint.get('name')
        for block in root.iter('ros2_control')
        for joint in block.iter('joint')
        if any(x.get('name') == 'effort' for x in joint.iter('command_interface'))
    }
    names = [joint.get('name', '') for joint in elements]
    return TreeText(
        root.get('name') or 'robot',
        tuple(_joint(joint) for joint in elements),
        tuple(_number(joint.find('dynamics'), 'friction', 0.0) for joint in elements),
        tuple(name for name in names if name in driven or not driven),
        last.get('name', ''),
        _link(last, 'child'),
        tool,
    )


def plain_tree(urdf: str, tree: TreeText, payload: tuple[float, float, float, float]) -> str:
    """Return links, inertias and joints alone, with a payload `(mass, x, y, z)` on the last link.

    Links are renamed `link:NAME`: a name such as `world` means something to the library.
    """
    root = _root(urdf)
    plain = ET.Element('robot', name='tree')
    options = {'fusestatic': 'false', 'balanceinertia': 'false', 'discardvisual': 'true'}
    ET.SubElement(ET.SubElement(plain, 'mujoco'), 'compiler', options)
    for link in root.findall('link'):
        copy = ET.SubElement(plain, 'link', name=_PREFIX + link.get('name', ''))
        copy.extend(link.findall('inertial'))
    for joint in root.findall('joint'):
        kind = 'continuous' if joint.get('type') == 'revolute' else joint.get('type', '')
        copy = ET.SubElement(plain, 'joint', name=joint.get('name', ''), type=kind)
        for end in ('parent', 'child'):
            ET.SubElement(copy, end, link=_PREFIX + _link(joint, end))
        copy.extend(x for tag in ('origin', 'axis') for x in joint.findall(tag))
        damping = _number(joint.find('dynamics'), 'damping', 0.0)
        ET.SubElement(copy, 'dynamics', damping=repr(damping))
        if kind == 'prismatic':
            ET.SubElement(copy, 'limit', lower='-1e9', upper='1e9', effort='0', velocity='0')
    if payload[0] > 0.0:
        _add_payload(plain, _PREFIX + tree.last_link, payload)
    return ET.tostring(plain, encoding='unicode')


def tree_link(name: str) -> str:
    """Return the name that a link has in `plain_tree`."""
    return _PREFIX + name


def _add_payload(plain: ET.Element, link: str, payload: tuple[float, float, float, float]) -> None:
    body = ET.SubElement(ET.SubElement(plain, 'link', name=_PAYLOAD), 'inertial')
    ET.SubElement(body, 'mass', value=repr(payload[0]))
    tensor = {name: repr(_SMALLEST_INERTIA) for name in ('ixx', 'iyy', 'izz')}
    ET.SubElement(body, 'inertia', {**tensor, 'ixy': '0', 'ixz': '0', 'iyz': '0'})
    joint = ET.SubElement(plain, 'joint', name=_PAYLOAD, type='fixed')
    ET.SubElement(joint, 'parent', link=link)
    ET.SubElement(joint, 'child', link=_PAYLOAD)
    ET.SubElement(joint, 'origin', xyz=' '.join(map(repr, payload[1:])))


def _root(urdf: str) -> ET.Element:
    if '<!DOCTYPE' in urdf or '<!ENTITY' in urdf:
        raise ConfigError('a URDF with a document type', 'one without', 'remove <!DOCTYPE ...>')
    try:
        root = ET.fromstring(urdf)  # noqa: S314  # no document type, so no entity to expand
    except ET.ParseError as error:
        raise ConfigError(f'the URDF is no XML ({error})', '<robot> ... </robot>') from error
    if root.tag != 'robot':
        raise ConfigError(f'<{root.tag}>', 'a URDF with <robot>', 'expand xacro files first')
    return root


def _joint(joint: ET.Element) -> SimulatedJoint:
    limit, kind = joint.find('limit'), joint.get('type')
    is_free = kind == 'continuous'
    return SimulatedJoint(
        joint.get('name', ''),
        is_prismatic=kind == 'prismatic',
        is_continuous=is_free,
        lower=-math.inf if is_free else _number(limit, 'lower', -math.inf),
        upper=math.inf if is_free else _number(limit, 'upper', math.inf),
        effort=_number(limit, 'effort', math.inf),
    )


def _link(joint: ET.Element, end: str) -> str:
    element = joint.find(end)
    name = None if element is None else element.get('link')
    if not name:
        raise ConfigError(f'joint {joint.get("name")!r} without <{end}>', 'a link at both ends')
    return name


def _number(element: ET.Element | None, key: str, absent: float) -> float:
    text = None if element is None else element.get(key)
    if text is None:
        return absent
    try:
        return float(text)
    except ValueError as error:
        raise ConfigError(f'{key}="{text}" in the URDF', 'a number') from error
