"""A chain of bodies with parallel axes as a URDF."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from xml.sax.saxutils import quoteattr

from sgp_ros.physics.term import Joint


@dataclass(frozen=True, slots=True)
class ChainBody:
    """A link on a joint about y or, where it slides, along x; its frame lies in the joint.

    Attributes:
        mass: [kg].
        centre: z of the centre of mass [m].
        inertia: about the centre [kg m^2].
        damping: of the joint [N m s/rad or N s/m].
        place: z of the joint on the link before [m].
        slides: whether the joint is prismatic.
    """

    mass: float
    centre: float
    inertia: float
    damping: float
    place: float = 0.0
    slides: bool = False

    @property
    def can_exist(self) -> bool:
        """Whether mass and inertia are those of a body."""
        numbers = (self.mass, self.centre, self.inertia, self.damping, self.place)
        return all(map(math.isfinite, numbers)) and self.mass > 0.0 and self.inertia >= 0.0


def chain_urdf(name: str, joints: Sequence[Joint], bodies: Sequence[ChainBody]) -> str:
    """Return the URDF of a chain.

    Args:
        name: of the robot.
        joints: from the base on; links are named after them.
        bodies: on these joints.
    """
    lines = [f'<robot name={quoteattr(name)}>', '<link name="ground"/>']
    parent = 'ground'
    for body, joint in zip(bodies, joints, strict=True):
        link = f'{joint.name}_link'
        lines += [_link(link, body), _joint(joint.name, parent, link, body)]
        parent = link
    lines += [_control(joint.name) for joint in joints if joint.is_actuated]
    return '\n'.join([*lines, '</robot>', ''])


def _link(name: str, body: ChainBody) -> str:
    tensor = ' '.join(
        f'{key}="{body.inertia if key[1] == key[2] else 0.0!r}"'
        for key in ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')
    )
    return (
        f'<link name={quoteattr(name)}><inertial><origin xyz="0 0 {body.centre!r}"/>'
        f'<mass value="{body.mass!r}"/><inertia {tensor}/></inertial></link>'
    )


def _joint(name: str, parent: str, child: str, body: ChainBody) -> str:
    kind, axis = ('prismatic', '1 0 0') if body.slides else ('continuous', '0 1 0')
    return (
        f'<joint name={quoteattr(name)} type="{kind}"><parent link={quoteattr(parent)}/>'
        f'<child link={quoteattr(child)}/><origin xyz="0 0 {body.place!r}"/>'
        f'<axis xyz="{axis}"/><dynamics damping="{body.damping!r}"/></joint>'
    )


def _control(name: str) -> str:
    return (
        f'<ros2_control name={quoteattr(name)} type="joint"><joint name={quoteattr(name)}>'
        '<command_interface name="effort"/></joint></ros2_control>'
    )
