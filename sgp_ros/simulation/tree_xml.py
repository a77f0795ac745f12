"""The part of a URDF that is simulated, as a text that the rigid-body library reads.

Joints that stand still become fixed where they stand, the others take the order wanted, and a
load becomes one more link.
"""

from __future__ import annotations

from xml.etree import ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from sgp_ros.errors import ConfigError
from sgp_ros.rigid.rotations import rpy_of
from sgp_ros.rigid.urdf_model import Urdf
from sgp_ros.simulation.mount import MOUNT, Mount
from sgp_ros.simulation.tree_text import TreePart, TreeText

_PREFIX = 'link:'
_PAYLOAD = 'payload'
STAND_IN_MASS, STAND_IN_RADIUS = 1.0, 0.1
"""Of the balls that stand in for the links of a URDF without masses [kg, m]."""
_SMALLEST = 1e-14
"""Mass [kg] and principal inertia [kg m^2] of links without: the library asks for some."""
_ENTRIES = ('ixx', 'ixy', 'iyy', 'ixz', 'iyz', 'izz')


def plain_tree(
    tree: TreeText, payload: tuple[float, float, float, float], mount: Mount | None = None
) -> str:
    """Return links, inertias and joints alone, with a payload `(mass, x, y, z)` on the last link.

    On a mount the whole slides, and the last joint is that of the base.

    Links are renamed `link:NAME`: a name such as `world` means something to the library.
    """
    root = ET.fromstring(tree.urdf.plain)  # noqa: S314  # written by `rigid`
    plain = ET.Element('robot', name='tree')
    options = {
        'fusestatic': 'false', 'balanceinertia': 'false', 'discardvisual': 'true',
        'boundmass': repr(_SMALLEST), 'boundinertia': repr(_SMALLEST),
    }  # fmt: skip
    ET.SubElement(ET.SubElement(plain, 'mujoco'), 'compiler', options)
    for link in root.findall('link'):
        name = link.get('name', '')
        copy = ET.SubElement(plain, 'link', name=_PREFIX + name)
        copy.extend(link.findall('inertial'))
        if name in tree.stand_ins:
            centre = _halfway(root, name)
            _add_body(copy, STAND_IN_MASS, centre, _ball(STAND_IN_MASS, STAND_IN_RADIUS))
    part = TreePart(()) if tree.part is None else tree.part
    elements = {joint.get('name', ''): joint for joint in root.findall('joint')}
    for name in (*part.joints, *(name for name in elements if name not in part.joints)):
        if name in part.locked:
            _lock(elements[name], part.locked[name])
        _add_joint(plain, elements[name], tree.urdf)
    for number, load in enumerate(part.loads):
        name = f'load {number} of {load.link}'
        _add_fixed(plain, name, _PREFIX + load.link, (0.0, 0.0, 0.0))
        _add_body(ET.SubElement(plain, 'link', name=name), load.mass, load.centre, load.inertia)
    if payload[0] > 0.0:
        _add_fixed(plain, _PAYLOAD, _PREFIX + tree.last_link, payload[1:])
        _add_body(ET.SubElement(plain, 'link', name=_PAYLOAD), payload[0], (0.0, 0.0, 0.0))
    if mount is not None:
        _add_mount(plain, mount)
    return ET.tostring(plain, encoding='unicode')


def tree_link(name: str) -> str:
    """Return the name that a link has in `plain_tree`."""
    return _PREFIX + name


def _add_joint(plain: ET.Element, joint: ET.Element, urdf: Urdf) -> None:
    name, kind = joint.get('name', ''), joint.get('type', '')
    kind = 'continuous' if kind == 'revolute' else kind
    copy = ET.SubElement(plain, 'joint', name=name, type=kind)
    for end, link in (('parent', urdf.joints[name].parent), ('child', urdf.joints[name].child)):
        ET.SubElement(copy, end, link=_PREFIX + link)
    copy.extend(x for tag in ('origin', 'axis') for x in joint.findall(tag))
    ET.SubElement(copy, 'dynamics', damping=repr(urdf.joints[name].damping))
    if kind == 'prismatic':
        ET.SubElement(copy, 'limit', lower='-1e9', upper='1e9', effort='0', velocity='0')


def _add_mount(plain: ET.Element, mount: Mount) -> None:
    """Let the root slide along an axis, with the mass that moves beside the arm."""
    children = {x.get('link') for x in plain.iter('child')}
    links = plain.findall('link')
    root = next(x.get('name', '') for x in links if x.get('name') not in children)
    arm = sum(float(x.get('value', '0')) for x in plain.iter('mass'))
    if not mount.moved_mass > arm:
        raise ConfigError(
            f'moved_mass = {mount.moved_mass:g} kg on the mount',
            f'more than the {arm:g} kg of the robot',
        )
    ET.SubElement(plain, 'link', name='mount:ground')
    _add_body(ET.SubElement(plain, 'link', name='mount:base'), mount.moved_mass - arm, (0.0,) * 3)
    slide = ET.SubElement(plain, 'joint', name=MOUNT, type='prismatic')
    ET.SubElement(slide, 'parent', link='mount:ground')
    ET.SubElement(slide, 'child', link='mount:base')
    ET.SubElement(slide, 'axis', xyz=_words(mount.direction))
    ET.SubElement(slide, 'dynamics', damping=repr(mount.damping))
    ET.SubElement(slide, 'limit', lower='-1e9', upper='1e9', effort='0', velocity='0')
    _add_fixed(plain, root, 'mount:base', (0.0, 0.0, 0.0))


def _add_fixed(plain: ET.Element, name: str, parent: str, place: tuple[float, ...]) -> None:
    joint = ET.SubElement(plain, 'joint', name=name, type='fixed')
    ET.SubElement(joint, 'parent', link=parent)
    ET.SubElement(joint, 'child', link=name)
    ET.SubElement(joint, 'origin', xyz=_words(place))


def _add_body(
    link: ET.Element, mass: float, centre: tuple[float, ...],
    inertia: tuple[float, ...] = (0.0,) * 6,
) -> None:  # fmt: skip
    """Give a link a body: mass, centre, and xx, xy, yy, xz, yz, zz about it."""
    body = ET.SubElement(link, 'inertial')
    ET.SubElement(body, 'origin', xyz=_words(centre))
    ET.SubElement(body, 'mass', value=repr(float(mass)))
    entries = {key: repr(float(x)) for key, x in zip(_ENTRIES, inertia, strict=True)}
    ET.SubElement(body, 'inertia', entries)


def _ball(mass: float, radius: float) -> tuple[float, ...]:
    about = 0.4 * mass * radius**2
    return about, 0.0, about, 0.0, 0.0, about


def _halfway(root: ET.Element, link: str) -> tuple[float, ...]:
    """Return half the mean place of the joints that start from a link; its origin without."""
    places = [
        _vector(joint, 'xyz')
        for joint in root.findall('joint')
        if joint.find(f"parent[@link='{link}']") is not None
    ]
    return tuple(sum(x) / (2.0 * len(places)) for x in zip(*places, strict=True)) or (0.0,) * 3


def _vector(joint: ET.Element, key: str, tag: str = 'origin') -> list[float]:
    """Return numbers of an element that `rigid` wrote."""
    found = joint.find(tag)
    assert found is not None
    return [float(word) for word in found.get(key, '').split()]


def _lock(joint: ET.Element, position: float) -> None:
    """Fix a joint where it stands: `R Rot(axis, position)` or `p + R axis position`."""
    place = np.array(_vector(joint, 'xyz'))
    turn = Rotation.from_euler('xyz', _vector(joint, 'rpy'))
    axis = np.array(_vector(joint, 'xyz', 'axis'))
    way = position * axis / np.linalg.norm(axis)
    if joint.get('type') == 'prismatic':
        place = place + turn.apply(way)
    else:
        turn = turn * Rotation.from_rotvec(way)
    for element in list(joint):
        if element.tag not in {'parent', 'child'}:
            joint.remove(element)
    joint.set('type', 'fixed')
    ET.SubElement(joint, 'origin', xyz=_words(place), rpy=_words(rpy_of(turn.as_matrix())))


def _words(numbers: tuple[float, ...] | np.ndarray) -> str:
    return ' '.join(repr(float(x)) for x in numbers)
