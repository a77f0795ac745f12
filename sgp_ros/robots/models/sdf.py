"""SDF (SDFormat) of Gazebo: links, joints, damping, friction, springs, gains of its controllers.

Poses are resolved as the format says: of a link in the model, of a joint in its child link, of a
frame in what it is attached to, or each in what `relative_to` names. Source: SDFormat 1.12,
specification and "Pose frame semantics".
"""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from sgp_ros.errors import ConfigError
from sgp_ros.markup import parse_xml
from sgp_ros.physics.catalogue import SPRING
from sgp_ros.rigid.rotations import of_quaternion, of_rpy
from sgp_ros.rigid.tree import GRAVITY
from sgp_ros.robots.models.model import Body, Model, ModelJoint, Pose, counted, stated
from sgp_ros.strangers import read_text, require_within

READ = (
    ('link; inertial mass, inertia, pose', 'link with mass, centre and inertia'),
    ('pose; relative_to, degrees, rotation_format; frame', 'where links and joints lie'),
    ('joint revolute, continuous, prismatic, fixed; axis xyz, expressed_in', 'joint'),
    ('axis limit', 'range, limits of velocity and effort'),
    ('axis dynamics damping, friction', 'damping and dry friction of the joint'),
    ('axis dynamics spring_stiffness, spring_reference', 'spring of the joint'),
    ('axis mimic', 'joint that follows another'),
    ('plugin joint-position-controller; p_gain, d_gain', 'gains of drives that hold targets'),
)
"""Elements that are read, and their meaning here."""
LEFT = {
    'root': 'The root is assumed to be fixed to the ground',
    'mass': 'Links without <inertial>, 1 kg by default in SDF, are assumed to have no mass',
    'axis': 'A second axis is ignored',
    'plugin': 'Plugins are ignored',
    'integral': 'The integral gain of the controller is ignored',
    'gains': 'Gains are ignored, as some joints have none',
    'gravity': 'Gravity is 9.81 m/s2 along -z here, not that of the file',
}
"""Remarks on what has no place here."""
REFUSED = (
    'ball, universal, screw, gearbox and revolute2 joints',
    'models within models',
    'several models that move',
    'loops of links',
)
_KINDS = ('revolute', 'continuous', 'prismatic', 'fixed')
_WORLD, _MODEL = 'world', '__model__'
_ENDLESS = 1e15
"""Limits from here on mean no limit: the format writes 1e16 for it."""
_ENTRIES = (('ixx', 'ixy', 'ixz'), ('ixy', 'iyy', 'iyz'), ('ixz', 'iyz', 'izz'))
_SERVO = 'joint-position-controller'
"""Part of the file name of the plugin that drives a joint to a position."""


def read_sdf(path: Path) -> Model:
    """Return the content of an SDF file with one model that moves.

    Raises:
        ConfigError: no SDF, several models that move or none, models within models, joints of
            several degrees of freedom, or links that form no tree.
    """
    try:
        root = parse_xml(_text(path))
    except (ET.ParseError, ValueError) as error:
        raise ConfigError(f'{path.name} is not XML ({error})', 'SDF') from error
    if root.tag != 'sdf':
        raise ConfigError(f'{path.name} holds <{root.tag}>', 'SDF with <sdf>')
    world = root.find('world')
    models = (root if world is None else world).findall('model')
    moving = [m for m in models if any(j.get('type') != 'fixed' for j in m.findall('joint'))]
    if len(moving) != 1:
        names = [m.get('name') for m in moving]
        raise ConfigError(
            f'SDF {path.name}: {len(moving)} models with moving joints {names}', 'one robot',
            'keep one model in the file; expand <include> with: gz sdf -p',
        )  # fmt: skip
    require_within(len(moving[0].findall('link')), 'LINKS', f'links of {path.name}')
    return _Reading(path.name, moving[0], root.get('version', '1.12')).result(world)


def _text(path: Path) -> str:
    text = read_text(path).lstrip()
    if '<!DOCTYPE' in text or '<!ENTITY' in text:
        raise ConfigError(
            f'{path.name} contains a document type declaration', 'SDF', 'remove <!DOCTYPE ...>'
        )
    return text


@dataclass(slots=True)
class _Reading:
    """One model."""

    file: str
    model: ET.Element
    version: str
    poses: dict[str, Pose] = field(default_factory=dict)
    dropped: dict[str, list[str]] = field(default_factory=lambda: defaultdict(list))
    effects: list[dict[str, Any]] = field(default_factory=list)

    def result(self, world: ET.Element | None) -> Model:
        for tag in ('model', 'include'):
            if self.model.find(tag) is not None:
                raise self.error(f'a <{tag}> within the model', 'one model',
                                 'expand it with: gz sdf -p')  # fmt: skip
        links = {self._name(x): x for x in self.model.findall('link')}
        joints = [self._joint(x, links) for x in self.model.findall('joint')]
        held = {j.child for j in joints}
        roots = [name for name in links if name not in held]
        if len(roots) + len({j.child for j in joints}) != len(links) or len(roots) > 1:
            raise self.error(f'links {roots} without a joint to a parent', 'a tree of links')
        for name in roots:
            self.dropped[LEFT['root']].append(name)
            joints.insert(0, ModelJoint(f'{_WORLD}_{name}', 'fixed', _WORLD, name))
        frames = {j.child: self._frame(j) for j in joints} | {_WORLD: Pose()}
        joints = [replace(j, origin=frames[j.parent].inverse @ frames[j.child]) for j in joints]
        bodies = {name: self._body(x, frames[name], self._pose_in_world(name))
                  for name, x in links.items()}  # fmt: skip
        gains = self._gains({j.name for j in joints if j.kind != 'fixed'})
        self._check_gravity(world)
        return Model(
            self.model.get('name') or 'robot', {_WORLD: None, **bodies}, tuple(joints),
            tuple(self.effects), gains=gains, remarks=tuple(counted(self.dropped)),
        )  # fmt: skip

    def error(self, found: str, expected: str, remedy: str = '') -> ConfigError:
        return ConfigError(f'SDF {self.file}: {found}', expected, remedy)

    def _name(self, element: ET.Element) -> str:
        name = element.get('name')
        if not name:
            raise self.error(f'a <{element.tag}> without a name', 'a name for each')
        return name

    def _joint(self, element: ET.Element, links: dict[str, ET.Element]) -> ModelJoint:
        name, kind = self._name(element), element.get('type', '')
        if kind not in _KINDS:
            raise self.error(f'joint {name} of type {kind!r}', f'one of {list(_KINDS)}')
        ends = [(element.findtext(end) or '').strip() for end in ('parent', 'child')]
        unknown = [x for x in ends if x not in links and x != _WORLD]
        if unknown:
            raise self.error(f'joint {name} names the links {unknown}', str(list(links)))
        joint = ModelJoint(name, kind, ends[0], ends[1])
        return joint if kind == 'fixed' else self._moving(joint, element)

    def _moving(self, joint: ModelJoint, element: ET.Element) -> ModelJoint:
        name = joint.name
        axis = element.find('axis')
        axis = ET.Element('axis') if axis is None else axis
        if element.find('axis2') is not None:
            self.dropped[LEFT['axis']].append(name)
        stiffness = self._number(axis, 'dynamics/spring_stiffness', 0.0, name)
        if stiffness:
            rest = self._number(axis, 'dynamics/spring_reference', 0.0, name)
            self.effects.append(stated(SPRING, name, stiffness=stiffness, rest=rest))
        limits = [self._number(axis, f'limit/{key}', math.inf, name)
                  for key in ('lower', 'upper', 'velocity', 'effort')]  # fmt: skip
        lower, upper, velocity, effort = (x if abs(x) < _ENDLESS else math.inf for x in limits)
        is_bounded = math.isfinite(lower) and math.isfinite(upper)
        kind = 'continuous' if joint.kind == 'revolute' and not is_bounded else joint.kind
        return replace(
            joint, kind=kind, axis=tuple(self._axis(axis, element)),
            lower=lower if is_bounded else -math.inf, upper=upper if is_bounded else math.inf,
            velocity=velocity if velocity >= 0.0 else math.inf,
            effort=effort if effort >= 0.0 else math.inf,
            damping=self._number(axis, 'dynamics/damping', 0.0, name),
            friction=self._number(axis, 'dynamics/friction', 0.0, name),
            mimic=self._mimic(axis, name),
        )  # fmt: skip

    def _mimic(self, axis: ET.Element, name: str) -> tuple[str, float, float] | None:
        mimic = axis.find('mimic')
        if mimic is None:
            return None
        multiplier, offset, reference = (
            self._number(mimic, key, default, name)
            for key, default in (('multiplier', 1.0), ('offset', 0.0), ('reference', 0.0))
        )
        return mimic.get('joint', ''), multiplier, offset - multiplier * reference

    def _axis(self, axis: ET.Element, joint: ET.Element) -> np.ndarray:
        """Return the axis in the frame of the joint."""
        xyz = axis.find('xyz')
        x = np.array(self._numbers(xyz, (0.0, 0.0, 1.0), self._name(joint)))
        size = float(np.linalg.norm(x))
        if len(x) != 3 or size < 1e-9:
            raise self.error(f'joint {self._name(joint)} has the axis {x.tolist()}', 'a direction')
        x = x / size
        named = '' if xyz is None else xyz.get('expressed_in', '')
        old = (axis.findtext('use_parent_model_frame') or '').strip().lower() in {'1', 'true'}
        if named or old or self._before(1, 5):
            frame = self.pose(named or _MODEL, ())
            x = self.pose(self._name(joint), ()).rotation.T @ frame.rotation @ x
        return x

    def _before(self, major: int, minor: int) -> bool:
        parts = [int(p) if p.isdigit() else 0 for p in self.version.split('.')[:2]]
        return tuple(parts) < (major, minor)

    def pose(self, name: str, seen: tuple[str, ...]) -> Pose:
        """Return a link, joint or frame in the model."""
        if name in {_MODEL, ''}:
            return Pose()
        if name in self.poses:
            return self.poses[name]
        found = next((x for tag in ('link', 'joint', 'frame') for x in self.model.findall(tag)
                      if x.get('name') == name), None)  # fmt: skip
        if found is None or name in seen:
            raise self.error(f'frame {name!r} is unknown or defined by itself', 'a link or frame')
        element = found.find('pose')
        base = '' if element is None else element.get('relative_to', '')
        if not base and found.tag == 'joint':
            base = (found.findtext('child') or '').strip()
        elif not base and found.tag == 'frame':
            base = found.get('attached_to', '')
        pose = self.pose(base, (*seen, name)) @ self._pose(element, name)
        self.poses[name] = pose
        return pose

    def _frame(self, joint: ModelJoint) -> Pose:
        """Return in the world where the frame of a joint's child lies here."""
        at = self.pose(joint.child if joint.kind == 'fixed' else joint.name, ())
        return self._base() @ at

    def _pose_in_world(self, link: str) -> Pose:
        return self._base() @ self.pose(link, ())

    def _base(self) -> Pose:
        return self._pose(self.model.find('pose'), 'model')

    def _pose(self, element: ET.Element | None, where: str) -> Pose:
        x = self._numbers(element, (0.0,) * 6, where)
        if element is not None and element.get('rotation_format') == 'quat_xyzw':
            return Pose(of_quaternion((x[6], *x[3:6])), np.array(x[:3]))
        if len(x) != 6:
            raise self.error(f'{where}: pose {list(x)}', 'six numbers')
        is_degrees = element is not None and element.get('degrees') in {'1', 'true'}
        turn = np.radians(x[3:]) if is_degrees else np.array(x[3:])
        return Pose(of_rpy(turn.tolist()), np.array(x[:3]))

    def _body(self, link: ET.Element, frame: Pose, at: Pose) -> Body | None:
        inertial = link.find('inertial')
        if inertial is None:
            self.dropped[LEFT['mass']].append(self._name(link))
            return None
        name = self._name(link)
        mass = self._number(inertial, 'mass', 1.0, name)
        tensor = np.array([
            [self._number(inertial, f'inertia/{key}', float(i == j), name)
             for j, key in enumerate(row)]
            for i, row in enumerate(_ENTRIES)
        ])  # fmt: skip
        pose = frame.inverse @ at @ self._pose(inertial.find('pose'), name)
        return Body(mass, pose.place, pose.rotation @ tensor @ pose.rotation.T)

    def _gains(self, joints: set[str]) -> dict[str, Any]:
        kp, kd = dict[str, float](), dict[str, float]()
        for plugin in self.model.findall('plugin'):
            file = plugin.get('filename', 'plugin')
            joint = (plugin.findtext('joint_name') or '').strip()
            if _SERVO not in file or joint not in joints:
                self.dropped[LEFT['plugin']].append(file)
                continue
            kp[joint] = self._number(plugin, 'p_gain', 1.0, joint)
            kd[joint] = self._number(plugin, 'd_gain', 0.01, joint)
            if self._number(plugin, 'i_gain', 0.1, joint):
                self.dropped[LEFT['integral']].append(joint)
        if kp and set(kp) != joints:
            self.dropped[LEFT['gains']] += list(kp)
            return {}
        return {'kp': kp, 'kd': kd} if kp else {}

    def _check_gravity(self, world: ET.Element | None) -> None:
        found = self._numbers(None if world is None else world.find('gravity'), GRAVITY, 'gravity')
        if not np.allclose(found, GRAVITY, atol=0.02):
            self.dropped[LEFT['gravity']].append(' '.join(f'{x:g}' for x in found))

    def _number(self, element: ET.Element, path: str, default: float, where: str) -> float:
        return self._numbers(element.find(path), (default,), where)[0]

    def _numbers(
        self, element: ET.Element | None, default: tuple[float, ...], where: str
    ) -> tuple[float, ...]:
        words = [] if element is None else (element.text or '').split()
        try:
            numbers = tuple(map(float, words))
        except ValueError:
            raise self.error(f'{where}: {" ".join(words)!r}', 'numbers') from None
        bounded = np.isfinite(default).all()  # a limit may be infinite
        if any(math.isnan(x) or (bounded and math.isinf(x)) for x in numbers):
            raise self.error(f'{where}: {" ".join(words)!r}', 'finite numbers')
        return numbers or default
