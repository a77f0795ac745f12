"""The text of a URDF, checked line by line before a kinematic tree is built from it.

Of the file, links with their inertia, joints and the command interfaces of `ros2_control` count;
geometry, meshes, sensors and simulator tags are left aside. Source: the URDF XML specification
of ROS. Entities and document types are refused: a robot file has no use for them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

from sgp_ros.errors import ConfigError
from sgp_ros.markup import parse_xml
from sgp_ros.rigid.urdf_model import (
    MOVING,
    Urdf,
    UrdfJoint,
    commanded_joints,
    mimic_parameters,
)
from sgp_ros.strangers import GREATEST, LEAST, is_usable, read_text, require_within

_KNOWN = (*MOVING, 'fixed')
_INERTIA = ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')
_SHORTEST_AXIS = 1e-6


def parse_urdf(path_or_text: str | Path) -> Urdf:
    """Return the checked content of a URDF file or text.

    Raises:
        ConfigError: no such file, no XML, or a robot that is no tree of joints of one degree of
            freedom; it names the joint or link.
    """
    place, text = _text(path_or_text)
    if '<!DOCTYPE' in text or '<!ENTITY' in text:
        raise ConfigError(
            f'{place} contains a document type declaration', 'a URDF', 'remove <!DOCTYPE ...>'
        )
    try:
        root = parse_xml(text)
    except (ET.ParseError, ValueError) as error:
        raise ConfigError(f'{place} is not XML ({error})', 'a URDF') from error
    if root.tag != 'robot':
        raise ConfigError(
            f'{place} has the root element <{root.tag}>', 'a URDF with <robot>',
            'expand xacro files first',
        )  # fmt: skip
    reading = _Reading(place, mimic_parameters(root))
    links = [reading.name(link) for link in root.findall('link')]
    require_within(len(links), 'LINKS', f'links of {place}')
    joints = [reading.joint(joint) for joint in root.findall('joint')]
    reading.check_tree(links, joints)
    by_name = {joint.name: joint for joint in joints}
    reading.check_mimics(by_name)
    return Urdf(
        root.get('name') or 'robot', place, by_name, tuple(links),
        commanded_joints(root), reading.plain(root, by_name),
    )  # fmt: skip


def _text(path_or_text: str | Path) -> tuple[str, str]:
    if isinstance(path_or_text, str) and path_or_text.lstrip('\ufeff \t\r\n').startswith('<'):
        return 'URDF text', path_or_text.lstrip('\ufeff \t\r\n')
    path = Path(path_or_text)
    if not path.exists():
        raise ConfigError(f'no file {path}', 'a URDF', 'check the path')
    try:
        text = read_text(path)
    except UnicodeDecodeError as error:
        raise ConfigError(f'URDF {path} is not UTF-8 ({error})', 'a URDF in UTF-8') from error
    return f'URDF {path}', text.lstrip()


@dataclass(frozen=True, slots=True)
class _Reading:
    """Reads elements of one file, naming it in every complaint."""

    place: str
    mimics: Mapping[str, ET.Element]

    def name(self, element: ET.Element) -> str:
        name = element.get('name')
        if not name:
            raise self._error(f'a <{element.tag}> without a name', 'a name for each')
        return name

    def joint(self, element: ET.Element) -> UrdfJoint:
        name, kind = self.name(element), element.get('type', '')
        where = f'joint {name}'
        if kind not in _KNOWN:
            raise self._error(
                f'{where} of type {kind!r}', f'one of {list(_KNOWN)}',
                'make it fixed, or replace it by joints of one degree of freedom',
            )  # fmt: skip
        limit, dynamics, mimic = (element.find(tag) for tag in ('limit', 'dynamics', 'mimic'))
        if mimic is None:
            mimic = self.mimics.get(name)
        is_bounded = kind in {'revolute', 'prismatic'}
        follows = None if mimic is None or kind == 'fixed' else mimic.get('joint', '')
        return UrdfJoint(
            name, kind, self._link(element, 'parent'), self._link(element, 'child'),
            self._axis(element, where),
            self._number(limit, 'lower', -math.inf, where) if is_bounded else -math.inf,
            self._number(limit, 'upper', math.inf, where) if is_bounded else math.inf,
            self._number(limit, 'velocity', math.inf, where),
            self._number(limit, 'effort', math.inf, where),
            self._number(dynamics, 'damping', 0.0, where),
            self._number(dynamics, 'friction', 0.0, where),
            follows,
            self._number(mimic, 'multiplier', 1.0, where),
            self._number(mimic, 'offset', 0.0, where),
        )  # fmt: skip

    def check_tree(self, links: list[str], joints: list[UrdfJoint]) -> None:
        for kind, names in (('link', links), ('joint', [joint.name for joint in joints])):
            twice = sorted({name for name in names if names.count(name) > 1})
            if twice:
                raise self._error(f'several {kind}s are named {twice}', 'different names')
        children = [joint.child for joint in joints]
        for joint in joints:
            unknown = [link for link in (joint.parent, joint.child) if link not in links]
            if unknown:
                raise self._error(
                    f'joint {joint.name} names the links {unknown}', f'some of {links}'
                )
            if children.count(joint.child) > 1:
                raise self._error(f'link {joint.child} is the child of several joints', 'a tree')
        roots = [link for link in links if link not in children]
        if len(roots) != 1:
            raise self._error(f'{len(roots)} links without a parent {roots}', 'one root link')
        reached = {roots[0]}
        for _ in joints:
            reached |= {joint.child for joint in joints if joint.parent in reached}
        if len(reached) != len(links):
            raise self._error(f'links {sorted(set(links) - reached)} form a loop', 'a tree')
        if not any(joint.kind in MOVING for joint in joints):
            raise self._error('no joint that moves', f'a joint of type {list(MOVING)}')

    def check_mimics(self, joints: dict[str, UrdfJoint]) -> None:
        for joint in joints.values():
            leader, seen = joint, [joint.name]
            while leader.follows is not None:
                target = joints.get(leader.follows)
                if target is None or target.kind not in MOVING or target.name in seen:
                    raise self._error(
                        f'joint {leader.name} mimics {leader.follows!r}', 'another moving joint'
                    )
                leader = target
                seen.append(leader.name)

    def plain(self, root: ET.Element, joints: dict[str, UrdfJoint]) -> str:
        plain = ET.Element('robot', {'name': 'robot'})
        for link in root.findall('link'):
            copy = ET.SubElement(plain, 'link', {'name': self.name(link)})
            inertial = link.find('inertial')
            if inertial is not None:
                self._copy_inertial(inertial, copy, f'link {self.name(link)}')
        for element in root.findall('joint'):
            joint = joints[self.name(element)]
            kind = 'revolute' if joint.kind == 'continuous' else joint.kind
            copy = ET.SubElement(plain, 'joint', {'name': joint.name, 'type': kind})
            self._copy_origin(element, copy, f'joint {joint.name}')
            ET.SubElement(copy, 'parent', {'link': joint.parent})
            ET.SubElement(copy, 'child', {'link': joint.child})
            ET.SubElement(copy, 'axis', {'xyz': ' '.join(map(repr, joint.axis))})
            bounds = {'lower': '-1', 'upper': '1', 'effort': '1', 'velocity': '1'}
            ET.SubElement(copy, 'limit', bounds)
        return ET.tostring(plain, encoding='unicode')

    def _copy_inertial(self, inertial: ET.Element, link: ET.Element, where: str) -> None:
        copy = ET.SubElement(link, 'inertial')
        self._copy_origin(inertial, copy, where)
        mass, inertia = inertial.find('mass'), inertial.find('inertia')
        value = self._number(mass, 'value', math.nan, where)
        if value < 0.0:
            raise self._error(f'{where} has the mass {value}', 'a mass of at least 0 kg')
        ET.SubElement(copy, 'mass', {'value': repr(value)})
        tensor = {key: repr(self._number(inertia, key, 0.0, where)) for key in _INERTIA}
        ET.SubElement(copy, 'inertia', tensor)

    def _copy_origin(self, source: ET.Element, target: ET.Element, where: str) -> None:
        origin = source.find('origin')
        attributes = {
            key: ' '.join(map(repr, self._vector(origin, key, '0 0 0', where)))
            for key in ('xyz', 'rpy')
        }
        ET.SubElement(target, 'origin', attributes)

    def _axis(self, element: ET.Element, where: str) -> tuple[float, float, float]:
        x, y, z = self._vector(element.find('axis'), 'xyz', '1 0 0', where)
        length = math.sqrt(x * x + y * y + z * z)
        if length < _SHORTEST_AXIS:
            if element.get('type') == 'fixed':
                return 1.0, 0.0, 0.0
            raise self._error(f'{where} has the axis ({x}, {y}, {z})', 'a direction')
        return x / length, y / length, z / length

    def _link(self, element: ET.Element, tag: str) -> str:
        found = element.find(tag)
        return '' if found is None else found.get('link', '')

    def _vector(
        self, element: ET.Element | None, key: str, default: str, where: str
    ) -> tuple[float, ...]:
        text = default if element is None else element.get(key, default)
        numbers = tuple(self._float(part, f'{where}: {key}') for part in text.split())
        if len(numbers) != 3:
            raise self._error(f'{where}: {key} is {text!r}', 'three numbers')
        return numbers

    def _number(self, element: ET.Element | None, key: str, default: float, where: str) -> float:
        text = None if element is None else element.get(key)
        if text is None:
            if math.isnan(default):
                raise self._error(f'{where} states no {key}', 'a number')
            return default
        return self._float(text, f'{where}: {key}', default)

    def _float(self, text: str, where: str, default: float = 0.0) -> float:
        """Return a number, 0 where it is too small; a limit that is too large is none."""
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if math.isinf(default) and GREATEST < abs(value) < math.inf:
            return default
        if not is_usable(value):
            raise self._error(f'{where} is {text!r}', f'a finite number up to {GREATEST:g}')
        return value if abs(value) >= LEAST else 0.0

    def _error(self, found: str, expected: str, remedy: str = '') -> ConfigError:
        return ConfigError(f'{self.place}: {found}', expected, remedy)
