"""A kinematic tree of joints with one degree of freedom as plain arrays, read from a URDF.

Every body hangs on one joint; links fixed to one another are one body. Joints that move on their
own come first, in the order of the robot; joints that follow another (`mimic`) come after them.
Pinocchio reads frames and inertias, so that they are those of the tools around ROS.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pinocchio  # type: ignore[import-untyped]  # comes without types

from sgp_ros.errors import ConfigError
from sgp_ros.rigid.locking import Plan, plan_joints
from sgp_ros.rigid.urdf_model import Urdf
from sgp_ros.rigid.urdf_text import parse_urdf

GRAVITY = (0.0, 0.0, -9.81)
"""Acceleration of free fall in the frame of the root link [m/s^2]; its z axis points up (REP 103).
"""

_JOINT = 'joint of the file '
"""Before the names of joints, while links have their own."""


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """A named frame that is fixed to a body, such as a tool.

    Attributes:
        name: of the link it belongs to.
        body: index of the body, -1 for the root.
        rotation: (3, 3) from the frame to the frame of the body's joint.
        translation: (3,) of its origin there [m].
    """

    name: str
    body: int
    rotation: np.ndarray
    translation: np.ndarray


@dataclass(frozen=True, slots=True)
class Payload:
    """A known load that is fixed to a link.

    Attributes:
        link: name of the link.
        mass: [kg].
        com: its centre of mass in the frame of the link [m].
        inertia: xx, xy, yy, xz, yz, zz about that centre, axes of the link [kg m^2].
    """

    link: str
    mass: float
    com: tuple[float, ...] = (0.0, 0.0, 0.0)
    inertia: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Tree:
    """Geometry, nominal inertia and limits of b bodies, of which the first k move on their own.

    Attributes:
        name: of the robot.
        joint_names: (b,).
        link_names: (b,), the link each joint carries.
        parents: (b,) body that each joint starts from, -1 for the root.
        rotations: (b, 3, 3) from the frame of the joint at position 0 to that of its parent.
        translations: (b, 3) of its origin there [m].
        axes: (b, 3) unit vectors in the frame of the joint.
        is_prismatic: (b,) whether it slides.
        gravity: (3,) in the frame of the root [m/s^2].
        parameters: (b, 10) nominal inertial parameters in the order of `inertial.PARAMETERS`.
        lower: (b,) least position [rad or m].
        upper: (b,) greatest position [rad or m].
        velocity_limit: (b,) [rad/s or m/s].
        effort_limit: (b,) [N m or N].
        damping: (b,) nominal viscous coefficient [N m s/rad or N s/m].
        friction: (b,) nominal Coulomb friction [N m or N].
        is_actuated: (b,) whether an effort acts on it.
        follows: (b,) index of the joint it follows, below k; its own index for the first k.
        multipliers: (b,) its position per position of that joint.
        offsets: (b,) its position where that joint is at 0 [rad or m].
        frames: all links by name, also those that are fixed to another.
    """

    name: str
    joint_names: tuple[str, ...]
    link_names: tuple[str, ...]
    parents: np.ndarray
    rotations: np.ndarray
    translations: np.ndarray
    axes: np.ndarray
    is_prismatic: np.ndarray
    gravity: np.ndarray
    parameters: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    velocity_limit: np.ndarray
    effort_limit: np.ndarray
    damping: np.ndarray
    friction: np.ndarray
    is_actuated: np.ndarray
    follows: np.ndarray
    multipliers: np.ndarray
    offsets: np.ndarray
    frames: tuple[Frame, ...] = ()

    def __post_init__(self) -> None:
        """Make the arrays read-only; refuse parents that do not form a tree.

        Raises:
            ValueError: a joint that hangs on itself, directly or by others.
        """
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray):
                value = np.array(value, order='C')
                value.setflags(write=False)
                object.__setattr__(self, field.name, value)
        if len(self.outward_order()) != len(self.parents):
            raise ValueError(f'parents {self.parents.tolist()} do not form a tree')

    @property
    def size(self) -> int:
        """Number of joints that move on their own, k."""
        return sum(i == j for i, j in enumerate(self.follows.tolist()))

    @property
    def moving_names(self) -> tuple[str, ...]:
        """Names of the joints that move on their own, (k,)."""
        return self.joint_names[: self.size]

    @property
    def outermost(self) -> tuple[int, ...]:
        """Joints whose links carry loads: that of `tool0`, else all that no other one hangs on."""
        tools = (self._leader(f.body) for f in self.frames if f.name == 'tool0')
        inner = {self._leader(int(parent)) for parent in self.parents[: self.size]}
        ends = tuple(i for i in range(self.size) if i not in inner)
        return tuple(i for i in tools if i >= 0) or ends

    @property
    def tool(self) -> Frame | None:
        """Moving link called `tool0`."""
        return next((f for f in self.frames if f.name == 'tool0' and f.body >= 0), None)

    @property
    def tool_body(self) -> int:
        """Body that carries the tool: of `tool0`, else the only outermost one; -1 for none."""
        if self.tool is not None:
            return self.tool.body
        return self.outermost[0] if len(self.outermost) == 1 else -1

    def _leader(self, body: int) -> int:
        """Return a body, or the nearest one inward whose joint moves on its own; -1 for none."""
        while body >= self.size:
            body = int(self.parents[body])
        return body

    def outward_order(self) -> list[int]:
        """Return the bodies so that each comes after the one it hangs on."""
        order: list[int] = []
        reached = {-1}
        while True:
            ready = [
                i for i, parent in enumerate(self.parents)
                if int(parent) in reached and i not in reached
            ]  # fmt: skip
            if not ready:
                return order
            order += ready
            reached |= set(ready)


def read_urdf(
    path_or_text: str | Path,
    *,
    joints: Sequence[str] | None = None,
    locked: Mapping[str, float] | None = None,
    passive: Sequence[str] | None = None,
    payload: Payload | None = None,
) -> Tree:
    """Return the kinematic tree of a URDF.

    Actuated are the joints with an `effort` command interface in `ros2_control`; where none has
    one, those with any command interface; without `ros2_control`, all.

    Args:
        path_or_text: a file, or the XML itself.
        joints: those that move, in the order wanted; None for all that are not locked.
        locked: position of joints that do not move [rad or m]; others that `joints` leaves out
            stay at 0. A joint that mimics a locked one is locked where that one puts it.
        passive: joints without effort; None leaves it to the file.
        payload: a known load, added to the nominal inertia of the body that carries its link.

    Raises:
        ConfigError: the file is not a tree of revolute, continuous, prismatic and fixed joints, or
            a name is not in it.
    """
    urdf = parse_urdf(path_or_text)
    plan = plan_joints(urdf, joints, locked or {}, passive)
    try:
        model = _reduced(pinocchio.buildModelFromXML(_apart(urdf.plain)), plan)
    except (ValueError, RuntimeError) as error:
        raise ConfigError(f'{urdf.place}: {error}', 'a URDF that Pinocchio reads') from error
    return _tree(urdf, plan, model, payload)


def _apart(plain: str) -> str:
    """Return a plain URDF in which no joint has the name of a link, as MJCF and URDF allow."""
    root = ET.fromstring(plain)  # noqa: S314  # written by `rigid`
    for joint in root.findall('joint'):
        joint.set('name', _JOINT + joint.get('name', ''))
    return ET.tostring(root, encoding='unicode')


def _reduced(model: Any, plan: Plan) -> Any:
    """Return the model with locked joints made fixed and their bodies merged."""
    start = pinocchio.neutral(model)
    for name, position in plan.locked.items():
        start[model.joints[model.getJointId(_JOINT + name)].idx_q] = position
    indices = [model.getJointId(_JOINT + name) for name in plan.locked]
    return pinocchio.buildReducedModel(model, indices, start)


def _tree(urdf: Urdf, plan: Plan, model: Any, payload: Payload | None) -> Tree:
    names = plan.names
    ids = [model.getJointId(_JOINT + name) for name in names]
    body = {0: -1} | {joint: i for i, joint in enumerate(ids)}
    found = [urdf.joints[name] for name in names]
    frames = tuple(_frames(model, body))
    parameters = np.array([model.inertias[i].toDynamicParameters() for i in ids])
    if payload is not None:
        _add_payload(parameters, payload, frames, urdf.place)

    def column(attribute: str) -> np.ndarray:
        return np.array([getattr(joint, attribute) for joint in found])

    return Tree(
        name=urdf.name,
        joint_names=names,
        link_names=tuple(joint.child for joint in found),
        parents=np.array([body[model.parents[i]] for i in ids]),
        rotations=np.array([model.jointPlacements[i].rotation for i in ids]),
        translations=np.array([model.jointPlacements[i].translation for i in ids]),
        axes=column('axis'),
        is_prismatic=column('kind') == 'prismatic',
        gravity=np.array(GRAVITY),
        parameters=parameters,
        lower=column('lower'),
        upper=column('upper'),
        velocity_limit=column('velocity'),
        effort_limit=column('effort'),
        damping=column('damping'),
        friction=column('friction'),
        is_actuated=np.array([name in plan.actuated for name in names]),
        follows=np.array([names.index(plan.leaders[name]) for name in names]),
        multipliers=np.array([plan.multipliers[name] for name in names]),
        offsets=np.array([plan.offsets[name] for name in names]),
        frames=frames,
    )


def _frames(model: Any, body: Mapping[int, int]) -> Iterator[Frame]:
    for frame in model.frames:
        if frame.type == pinocchio.FrameType.BODY:
            place = frame.placement
            yield Frame(
                frame.name,
                body[frame.parentJoint],
                place.rotation.copy(),
                place.translation.copy(),
            )


def _add_payload(
    parameters: np.ndarray, payload: Payload, frames: Sequence[Frame], place: str
) -> None:
    frame = next((f for f in frames if f.name == payload.link), None)
    if frame is None or frame.body < 0:
        moving = [f.name for f in frames if f.body >= 0]
        raise ConfigError(f'{place}: payload on link {payload.link!r}', f'one of {moving}')
    xx, xy, yy, xz, yz, zz = payload.inertia
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    load = pinocchio.Inertia(payload.mass, np.array(payload.com), tensor)
    moved = pinocchio.SE3(frame.rotation, frame.translation).act(load)
    parameters[frame.body] += moved.toDynamicParameters()
