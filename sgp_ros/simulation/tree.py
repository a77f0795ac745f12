"""A robot from a URDF as a mechanism: its rigid-body dynamics by MuJoCo.

MuJoCo gives the mass matrix (composite rigid bodies, Featherstone 2008, chapter 6) and the forces
of gravity, inertia and joint damping (Newton and Euler); contacts, limits and its own friction are
off. The package's own model of a tree shares nothing with it but the reading of the file.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from sgp_ros.errors import ConfigError
from sgp_ros.optional import optional_package
from sgp_ros.physics.catalogue import COULOMB_FRICTION
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.parts import Value
from sgp_ros.simulation.mechanism import Mechanism, TrueCoefficient, quantity
from sgp_ros.simulation.mount import MOUNT, Mount
from sgp_ros.simulation.tool_pull import ToolPull
from sgp_ros.simulation.tree_text import TreePart, TreeText, read_tree
from sgp_ros.simulation.tree_xml import plain_tree, tree_link

GRAVITY = 9.81
"""Acceleration of gravity [m/s^2]."""
LEAST_INERTIA = 1e-12
"""A joint that moves less is one that moves nothing [kg m^2 or kg]."""


@dataclass(frozen=True, slots=True, eq=False)
class Tree:
    """Equation of motion of the joints of a URDF, in the order of the file.

    Attributes:
        urdf: text of the file.
        part: what of it is simulated; None for all.
        mount: what its base stands on; None for the ground.
        base_roll: of the base in the world, whose orientation is `Ry(pitch) Rx(roll)` [rad].
        base_pitch: likewise [rad].
        payload_mass: point mass on the last link [kg].
        payload_x: where it is in the frame of that link [m]; `payload_y`, `payload_z` likewise.
        tip_fx: force at the origin of the tool in the axes of the root [N]; `tip_fy`, `tip_fz`
            likewise.
        pulls: other forces on the last link.
        text: joints of the URDF.
    """

    urdf: str
    part: TreePart | None = None
    mount: Mount | None = None
    base_roll: float = quantity(0.0, 'rad', 'roll of the base')
    base_pitch: float = quantity(0.0, 'rad', 'pitch of the base')
    payload_mass: float = quantity(0.0, 'kg', 'point mass on the last link')
    payload_x: float = quantity(0.0, 'm', 'where the payload is on the last link')
    payload_y: float = quantity(0.0, 'm', 'where the payload is on the last link')
    payload_z: float = quantity(0.0, 'm', 'where the payload is on the last link')
    tip_fx: float = quantity(0.0, 'N', 'force at the tool')
    tip_fy: float = quantity(0.0, 'N', 'force at the tool')
    tip_fz: float = quantity(0.0, 'N', 'force at the tool')
    pulls: tuple[ToolPull, ...] = ()
    text: TreeText = field(init=False)
    _library: Any = field(init=False, repr=False)
    _model: Any = field(init=False, repr=False)
    _data: Any = field(init=False, repr=False)
    _order: np.ndarray | slice = field(init=False, repr=False)
    _geared: np.ndarray = field(init=False, repr=False)
    _offset: np.ndarray = field(init=False, repr=False)
    _motors: np.ndarray = field(init=False, repr=False)
    _identity: np.ndarray = field(init=False, repr=False)
    _tool: int = field(init=False, repr=False)
    _last: int = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Compile the tree.

        Raises:
            ConfigError: a URDF that is not a tree of bodies with inertia, or MuJoCo is missing.
        """
        library = _library()
        text = read_tree(self.urdf, self.part)
        payload = (self.payload_mass, self.payload_x, self.payload_y, self.payload_z)
        try:
            model = library.MjModel.from_xml_string(plain_tree(text, payload, self.mount))
        except ValueError as error:
            raise _impossible(text.name, ' '.join(str(error).split())) from error
        off = library.mjtDisableBit
        for bit in (off.mjDSBL_CONSTRAINT, off.mjDSBL_CONTACT, off.mjDSBL_EQUALITY):
            model.opt.disableflags |= int(bit)
        model.opt.gravity[:] = _gravity(self.base_roll, self.base_pitch)
        names = [joint.name for joint in text.joints]
        if self.mount is not None:
            model.joint(MOUNT).stiffness[0] = self.mount.stiffness
            names.append(MOUNT)
        motors = np.zeros((len(names), len(text.command_joints)))
        gains = self.gains(text.command_joints)
        for column, name in enumerate(text.command_joints):
            motors[names.index(name), column] = gains[column]
        geared, offset = _gear(text, names, lambda name: int(model.joint(name).dofadr[0]))
        built = {
            'text': text,
            '_library': library,
            '_model': model,
            '_data': library.MjData(model),
            '_order': _order([int(model.joint(name).dofadr[0]) for name in names]),
            '_geared': geared,
            '_offset': offset,
            '_motors': motors,
            '_identity': np.eye(model.nv),
            '_tool': int(model.body(tree_link(text.tool_link)).id),
            '_last': int(model.body(tree_link(text.last_link)).id),
        }
        for name, value in built.items():
            object.__setattr__(self, name, value)
        still = np.zeros(len(names))
        if np.diag(self.dynamics(still, still)[0]).max() > 1.0 / LEAST_INERTIA:
            raise _impossible(text.name, 'a joint moves nothing that has mass and inertia')

    @property
    def hidden(self) -> tuple[float, ...]:
        """Where a base on a mount rests: where the spring carries all that it moves [m]."""
        if self.mount is None:
            return ()
        weight = self.mount.moved_mass * self._model.opt.gravity[self.mount.axis]
        return (float(weight / self.mount.stiffness),)

    def gains(self, joints: tuple[str, ...]) -> np.ndarray:
        """Return the force per unit of commanded and measured effort of joints, (n,)."""
        return np.ones(len(joints)) if self.part is None else self.part.gains(joints)

    def dynamics(
        self, position: np.ndarray, velocity: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the inverse mass matrix (k, k) and the forces of the tree (k,), O(k^3)."""
        library, model, data, order = self._library, self._model, self._data, self._order
        if self.text.followers:
            return self._geared_dynamics(position, velocity)
        data.qpos[order] = position
        data.qvel[order] = velocity
        force = self._force()
        inverse_mass = np.empty((model.nv, model.nv))
        library.mj_solveM(model, data, inverse_mass, self._identity)
        if isinstance(order, slice):
            return inverse_mass, force
        return inverse_mass[order[:, np.newaxis], order], force[order]

    def _geared_dynamics(
        self, position: np.ndarray, velocity: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the same with followers, all joints being at `G q + offset`.

        By the principle of virtual work M becomes `G^T M G`, the forces `G^T h`.
        """
        library, model, data, G = self._library, self._model, self._data, self._geared
        data.qpos[:] = G @ position + self._offset
        data.qvel[:] = G @ velocity
        force = self._force()
        carried = np.empty_like(G)  # M G
        for column, gear in zip(carried.T, G.T, strict=True):
            product = np.empty(model.nv)
            library.mj_mulM(model, data, product, gear.copy())
            column[:] = product
        return np.linalg.inv(G.T @ carried), G.T @ force

    def _force(self) -> np.ndarray:
        """Return the forces of the tree where it stands, in the library's order."""
        library, model, data = self._library, self._model, self._data
        library.mj_fwdPosition(model, data)
        library.mj_fwdVelocity(model, data)
        force: np.ndarray = data.qfrc_passive - data.qfrc_bias
        tip = (self.tip_fx, self.tip_fy, self.tip_fz)
        if any(tip):
            jacobian = np.empty((3, model.nv))
            library.mj_jac(model, data, jacobian, None, data.xpos[self._tool], self._tool)
            force = force + jacobian.T @ tip
        for pull in self.pulls:
            turn = data.xmat[self._last].reshape(3, 3)
            place, jacobian = data.xpos[self._last] + turn @ pull.at, np.empty((3, model.nv))
            library.mj_jac(model, data, jacobian, None, place, self._last)
            force = force + jacobian.T @ pull.force(place, jacobian @ data.qvel)
        return force

    def drive(self, command: np.ndarray, velocity: np.ndarray) -> np.ndarray:  # noqa: ARG002 - force sources
        """Return the forces of the motors, (k,); the command (m,) is in N m or N."""
        force: np.ndarray = self._motors @ command
        return force

    def built_in(self) -> tuple[EffectAt, ...]:
        """Return the dry friction that the URDF states."""
        return tuple(
            EffectAt.wanted(COULOMB_FRICTION, joint.name, {'level': level})
            for joint, level in zip(self.text.joints, self.text.friction, strict=True)
            if level > 0.0
        )

    def coefficients(self) -> tuple[TrueCoefficient, ...]:
        """Return nothing: the truth about a tree is its URDF."""
        return ()


def pulled(tree: Mechanism, pull: ToolPull) -> Mechanism:
    """Return the tree with a force on its last link.

    Raises:
        ConfigError: a robot with dynamics of its own, which has no such link.
    """
    if not isinstance(tree, Tree):
        raise ConfigError('a law of the tool', 'a robot from a URDF')
    return replace(tree, pulls=(*tree.pulls, pull))


def mounted(tree: Mechanism, values: Mapping[str, Value]) -> Mechanism:
    """Return the tree on a flexible mount."""
    return replace(tree, mount=Mount.of(values))


def _gear(
    text: TreeText, names: list[str], place: Callable[[str], int]
) -> tuple[np.ndarray, np.ndarray]:
    """Return G (b, k) and the offset (b,) of all joints, in the library's order."""
    G = np.zeros((len(names) + len(text.followers), len(names)))
    offset = np.zeros(len(G))
    for column, name in enumerate(names):
        G[place(name), column] = 1.0
    for follower in text.followers:
        G[place(follower.name), names.index(follower.leader)] = follower.multiplier
        offset[place(follower.name)] = follower.offset
    return G, offset


def _order(places: list[int]) -> np.ndarray | slice:
    """Return the index that puts the library's joints into the order of the file."""
    return slice(None) if places == sorted(places) else np.array(places)


def _gravity(roll: float, pitch: float) -> tuple[float, float, float]:
    """Return gravity in the axes of a base that stands as `Ry(pitch) Rx(roll)` [m/s^2]."""
    level = math.cos(pitch)
    return (
        GRAVITY * math.sin(pitch),
        -GRAVITY * level * math.sin(roll),
        -GRAVITY * level * math.cos(roll),
    )


def _impossible(robot: str, problem: str) -> ConfigError:
    return ConfigError(
        f'URDF of {robot!r}: {problem}', 'a tree whose moving links have mass and inertia'
    )


def _library() -> Any:
    library = optional_package('mujoco', 'to simulate URDF robots', 'simulate')
    # It would write warnings to MUJOCO_LOG.TXT where the user is; a motion that is not finite is
    # refused by `stepping`.
    library.set_mju_user_warning(_ignore)
    return library


def _ignore(_warning: str) -> None:
    pass
