"""Model files of other programs, as the content of a robot YAML.

Every format comes down to a tree of links and joints, the physics stated of them, the gains of
drives, and remarks on all that has no place here. The tree is written as a URDF, so that what
follows knows one format alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from sgp_ros.physics.effect import Effect
from sgp_ros.rigid.rotations import rpy_of

_ENTRIES = (('ixx', 0, 0), ('ixy', 0, 1), ('ixz', 0, 2), ('iyy', 1, 1), ('iyz', 1, 2),
            ('izz', 2, 2))  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """A frame in another one.

    Attributes:
        rotation: (3, 3).
        place: (3,) [m].
    """

    rotation: np.ndarray = field(default_factory=lambda: np.eye(3))
    place: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def __matmul__(self, other: Pose) -> Pose:
        """Return the frame that `other` is in this one."""
        return Pose(self.rotation @ other.rotation, self.rotation @ other.place + self.place)

    @property
    def inverse(self) -> Pose:
        """The other frame in this one."""
        return Pose(self.rotation.T, -self.rotation.T @ self.place)


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """Mass of a link.

    Attributes:
        mass: [kg].
        centre: (3,) in the frame of the link [m].
        inertia: (3, 3) about the centre, in the axes of the link [kg m^2].
    """

    mass: float
    centre: np.ndarray
    inertia: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class ModelJoint:
    """A joint between two links; the frame of the child lies in it.

    Attributes:
        name: of the joint.
        kind: `revolute`, `continuous`, `prismatic` or `fixed`.
        parent, child: links.
        origin: of the child in the parent, at position 0.
        axis: (3,) in the frame of the child.
        lower, upper: range [rad or m], infinite for none.
        velocity, effort: limits, infinite for none.
        damping: [N m s/rad or N s/m].
        friction: dry friction [N m or N].
        mimic: joint that it follows, multiplier and offset; None where it moves on its own.
        is_driven: whether a motor acts on it.
    """

    name: str
    kind: str
    parent: str
    child: str
    origin: Pose = field(default_factory=Pose)
    axis: Sequence[float] = (0.0, 0.0, 1.0)
    lower: float = -math.inf
    upper: float = math.inf
    velocity: float = math.inf
    effort: float = math.inf
    damping: float = 0.0
    friction: float = 0.0
    mimic: tuple[str, float, float] | None = None
    is_driven: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """Content of a model file.

    Attributes:
        name: of the robot.
        links: by name; None for one without mass.
        joints: of the tree, fixed ones too.
        effects: as a robot YAML states them.
        locked: joints that the file holds, and where [rad or m].
        gains: `kp`, `kd` by joint and `feedforward`, as `gains` of a robot YAML; empty without.
        remarks: what the file says that has no place here.
    """

    name: str
    links: Mapping[str, Body | None]
    joints: tuple[ModelJoint, ...]
    effects: tuple[Mapping[str, Any], ...] = ()
    locked: Mapping[str, float] = field(default_factory=dict)
    gains: Mapping[str, Any] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()

    def document(self) -> dict[str, Any]:
        """Return the content of a robot YAML, with the URDF in it."""
        said = {
            'effects': [dict(e) for e in self.effects], 'locked': dict(self.locked),
            'gains': dict(self.gains), 'remarks': list(self.remarks),
        }  # fmt: skip
        return {
            'schema': 1, 'name': self.name, 'urdf': self._urdf(),
            **{key: x for key, x in said.items() if x},
        }  # fmt: skip

    def _urdf(self) -> str:
        root = ET.Element('robot', name=self.name)
        for name, body in self.links.items():
            link = ET.SubElement(root, 'link', name=name)
            if body is not None and body.mass > 0.0:
                _add_body(link, body)
        for joint in self.joints:
            _add_joint(root, joint)
        for joint in self.joints:
            if joint.is_driven:
                block = ET.SubElement(root, 'ros2_control', name=joint.name, type='actuator')
                driven = ET.SubElement(block, 'joint', name=joint.name)
                ET.SubElement(driven, 'command_interface', name='effort')
        ET.indent(root)
        return ET.tostring(root, encoding='unicode') + '\n'


def stated(effect: Effect, joint: str, **values: float) -> dict[str, Any]:
    """Return an entry of `effects` of a robot YAML."""
    parameters = {name: {'value': float(x)} for name, x in values.items()}
    return {'effect': effect.name, 'joint': joint, 'parameters': parameters}


def counted(what: Mapping[str, Iterable[str]]) -> list[str]:
    """Return one remark per kind of thing that is left out, with the names of the things."""
    found = []
    for kind, names in what.items():
        listed = list(dict.fromkeys(names))
        if listed:
            more = f' and {len(listed) - 5} more' if len(listed) > 5 else ''
            found.append(f'{kind}: {", ".join(listed[:5])}{more}.')
    return found


def _add_body(link: ET.Element, body: Body) -> None:
    inertial = ET.SubElement(link, 'inertial')
    ET.SubElement(inertial, 'origin', xyz=_words(body.centre))
    ET.SubElement(inertial, 'mass', value=repr(float(body.mass)))
    tensor = {key: repr(float(body.inertia[i, j])) for key, i, j in _ENTRIES}
    ET.SubElement(inertial, 'inertia', tensor)


def _add_joint(root: ET.Element, joint: ModelJoint) -> None:
    element = ET.SubElement(root, 'joint', name=joint.name, type=joint.kind)
    ET.SubElement(element, 'parent', link=joint.parent)
    ET.SubElement(element, 'child', link=joint.child)
    rpy = _words(rpy_of(joint.origin.rotation))
    ET.SubElement(element, 'origin', xyz=_words(joint.origin.place), rpy=rpy)
    if joint.kind == 'fixed':
        return
    ET.SubElement(element, 'axis', xyz=_words(joint.axis))
    limits = {
        key: repr(float(getattr(joint, key))) for key in ('lower', 'upper', 'velocity', 'effort')
        if math.isfinite(getattr(joint, key))
    }  # fmt: skip
    if limits:
        ET.SubElement(element, 'limit', limits)
    ET.SubElement(element, 'dynamics', damping=repr(float(joint.damping)),
                  friction=repr(float(joint.friction)))  # fmt: skip
    if joint.mimic is not None:
        leader, multiplier, offset = joint.mimic
        ET.SubElement(element, 'mimic', joint=leader, multiplier=repr(float(multiplier)),
                      offset=repr(float(offset)))  # fmt: skip


def _words(numbers: Iterable[float]) -> str:
    return ' '.join(repr(float(x)) for x in numbers)
