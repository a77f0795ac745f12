"""The joints of a URDF, or of a part of one, as a simulation needs them.

What the file says comes from `rigid`; the dynamics do not.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from sgp_ros.rigid.locking import leader_of
from sgp_ros.rigid.urdf_model import MOVING, Urdf
from sgp_ros.rigid.urdf_text import parse_urdf
from sgp_ros.simulation.mechanism import SimulatedJoint


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
    """Moving part of a URDF, and its drives.

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


@dataclass(frozen=True, slots=True)
class Follower:
    """A joint without a motion of its own, `position = multiplier * leader + offset`.

    Attributes:
        name: of the joint.
        leader: joint with a motion of its own.
        multiplier: position per position of the leader.
        offset: position where the leader is at 0 [rad or m].
    """

    name: str
    leader: str
    multiplier: float
    offset: float


@dataclass(frozen=True, slots=True)
class TreeText:
    """Parts of a URDF that a simulation needs.

    Attributes:
        urdf: the file.
        part: what of it is simulated; None for all.
        joints: k that move on their own, in the order of the file or of the part.
        followers: joints that follow one of them.
        friction: (k,) dry friction of `<dynamics>`, with that of followers [N m or N].
        command_joints: those with an effort interface in `ros2_control`; where none has one, those
            with any; all without such a block; those of the part where there is one.
        last_joint: the joint nearest to `tool0`, or the last one that no other one hangs on.
        last_link: the link on it.
        tool_link: `tool0`, or the link on the last joint.
    """

    urdf: Urdf
    part: TreePart | None
    joints: tuple[SimulatedJoint, ...]
    followers: tuple[Follower, ...]
    friction: tuple[float, ...]
    command_joints: tuple[str, ...]
    last_joint: str
    last_link: str
    tool_link: str

    @property
    def name(self) -> str:
        """Name of the robot."""
        return self.urdf.name

    @property
    def stand_ins(self) -> tuple[str, ...]:
        """Moving links with a ball in place of a body: all, of a file that states no inertia.

        Such a file tells the kinematics alone. Each link becomes a solid ball halfway to its next
        joints, so that the robot can be moved; its efforts are those of no real machine.
        """
        if '<inertial' in self.urdf.plain:
            return ()
        return tuple(j.child for j in self.urdf.joints.values() if j.kind in MOVING)


def read_tree(text: str, part: TreePart | None = None) -> TreeText:
    """Return the joints of a URDF text.

    Args:
        text: the URDF.
        part: says what of it is simulated; None leaves it to the file.

    Raises:
        ConfigError: no URDF, or joints without exactly one degree of freedom.
    """
    urdf = parse_urdf(text)
    locked = {} if part is None else part.locked
    moving = [n for n, joint in urdf.joints.items() if joint.kind in MOVING and n not in locked]
    followers = {
        name: Follower(name, leader, multiplier, offset)
        for name in moving
        for leader, multiplier, offset in [leader_of(urdf, name)]
        if leader != name
    }
    own = [n for n in moving if n not in followers] if part is None else list(part.joints)
    tool, last = _ends(urdf, own)
    driven = urdf.commanded
    motors = tuple(n for n in own if driven is None or n in driven)
    return TreeText(
        urdf,
        part,
        tuple(_joint(urdf, name) for name in own),
        tuple(followers.values()),
        tuple(_dry(urdf, name, followers) for name in own),
        motors if part is None else part.motors,
        last,
        urdf.joints[last].child,
        tool,
    )


def _joint(urdf: Urdf, name: str) -> SimulatedJoint:
    joint = urdf.joints[name]
    return SimulatedJoint(
        name,
        is_prismatic=joint.kind == 'prismatic',
        is_continuous=joint.kind == 'continuous',
        lower=joint.lower,
        upper=joint.upper,
        effort=joint.effort or math.inf,
    )


def _ends(urdf: Urdf, own: list[str]) -> tuple[str, str]:
    """Return the link of the tool and the joint with a motion of its own that carries it."""
    carried = {joint.child: joint for joint in urdf.joints.values()}

    def inward(link: str) -> str:
        while link in carried and carried[link].name not in own:
            link = carried[link].parent
        return carried[link].name if link in carried else ''

    inner = {inward(urdf.joints[name].parent) for name in own}
    end = [name for name in own if name not in inner][-1]
    last = (inward('tool0') if 'tool0' in carried else '') or end
    return 'tool0' if 'tool0' in carried else urdf.joints[last].child, last


def _dry(urdf: Urdf, name: str, followers: Mapping[str, Follower]) -> float:
    """Return the dry friction of a joint and of those that follow it."""
    ratios = {f.name: abs(f.multiplier) for f in followers.values() if f.leader == name}
    return sum(
        ratio * urdf.joints[joint].friction for joint, ratio in {name: 1.0, **ratios}.items()
    )
