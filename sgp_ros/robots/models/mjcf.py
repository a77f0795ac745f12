"""MJCF, read by MuJoCo's own compiler.

The compiler resolves defaults, includes, angles and inertias of geoms; what it built is turned
into links and joints here. MuJoCo turns a joint by `q - ref` about an anchor in the body, in the
order of the joints of the body; a URDF joint turns by q about the origin of its child. So the
frame of a link is that of its body, moved to the anchor of its last joint.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from sgp_ros.errors import ConfigError
from sgp_ros.optional import optional_package
from sgp_ros.physics.catalogue import ARMATURE, SPRING
from sgp_ros.rigid.rotations import about, between, of_quaternion
from sgp_ros.rigid.tree import GRAVITY
from sgp_ros.robots.models.mjcf_actuators import Drives, read_drives
from sgp_ros.robots.models.model import Body, Model, ModelJoint, Pose, counted, stated

READ = (
    ('body', 'link with mass, centre and inertia, also from geoms and meshes'),
    ('joint hinge, slide; pos, axis, ref, range, actuatorfrcrange', 'joint with its range'),
    ('joint damping, frictionloss', 'damping and dry friction of the joint'),
    ('joint armature, actuator armature and damping', 'rotor inertia, damping'),
    ('joint stiffness, springref', 'spring of the joint'),
    ('motor, general; gear, forcerange, ctrlrange', 'driven joint with its effort limit'),
    ('position, velocity; kp, kv, gear', 'gains of drives that hold targets'),
    ('actuator dyntype filter', 'lag of the effort'),
    ('actuator delay', 'delay of the command'),
    ('gravcomp 1 on all bodies, with position drives', 'drives that hold gravity'),
    ('equality joint, linear', 'joint that follows another, or is locked'),
    ('fixed tendon under an actuator, on one joint and its followers', 'its transmission'),
    ('option gravity', 'orientation of the base'),
)
"""Elements that are read, and their meaning here."""
LEFT = {
    'contact': 'Contacts are not modelled, and none acts in the start pose; solid bodies',
    'off': 'Constraints that are not active in the file are ignored',
    'constraint': 'Constraints of this kind are ignored',
    'motors': 'No actuator: all of these joints are assumed to be driven',
    'follower': 'Rotor inertia and springs of joints that follow others or are fixed are ignored',
    'gravcomp': 'Gravity compensation (gravcomp) is ignored',
    'damping': 'The nonlinear part of the damping is ignored',
    'stiffness': 'The nonlinear part of the stiffness is ignored',
    'gravity': 'Gravity is 9.81 m/s2 here, not that of the file, in m/s2',
    'fluid': 'Fluid forces are ignored',
    'tendon': 'Tendon forces are ignored',
    'other': 'Unsupported elements are ignored',
}
"""Remarks on what has no place here."""
REFUSED = (
    'free and ball joints',
    'connect and weld constraints',
    'equality of joints on a curve',
    'links that touch where the robot starts',
)
_KINDS = {'mjJNT_HINGE': 'revolute', 'mjJNT_SLIDE': 'prismatic'}
_NEAR = 1e-3
"""Relative difference of two gravities, and depth of a contact [m], that are taken as zero."""


def read_mjcf(path: Path) -> Model:
    """Return the content of an MJCF file.

    Raises:
        ConfigError: MuJoCo is missing or refuses the file, or the file holds free or ball joints,
            loops of links, or links that touch where it starts.
    """
    library = optional_package('mujoco', 'to read MJCF', 'simulate')
    try:
        model = library.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise ConfigError(
            f'MJCF {path.name}: {" ".join(str(error).split())}', 'a file that MuJoCo compiles',
            'keep meshes and included files where the file looks for them',
        ) from error  # fmt: skip
    return _Reading(path.name, library, model).result()


@dataclass(slots=True)
class _Reading:
    """One compiled model."""

    file: str
    library: Any
    model: Any
    dropped: dict[str, list[str]] = field(default_factory=lambda: defaultdict(list))
    locked: dict[str, float] = field(default_factory=dict)

    def result(self) -> Model:
        m, lib = self.model, self.library
        self._check_joints()
        self._check_contacts()
        mimics = self._mimics()
        root = self.body(0)
        links: dict[str, Body | None] = {root: None}
        joints: list[ModelJoint] = []
        shift = {0: np.zeros(3)}
        for b in range(1, m.nbody):
            joints += self._joints_of(b, links, shift, mimics)
        followed = {self.joint(j): x for j, x in mimics.items()}
        names = [self.joint(j) for j in range(m.njnt)]
        drives = read_drives(lib, m, names, followed, self.dropped)
        joints = [drives.applied(j) for j in joints]
        if not any(j.is_driven for j in joints):
            self.dropped[LEFT['motors']] += names
        gains = drives.gains(self.dropped, holds_gravity=self._holds_gravity(drives))
        self._drop_rest()
        return Model(
            bytes(m.names).split(b'\0', 1)[0].decode() or Path(self.file).stem, links,
            tuple(joints), tuple(self._effects(drives)), self.locked, gains,
            tuple(counted(self.dropped)),
        )  # fmt: skip

    def _effects(self, drives: Drives) -> Iterator[dict[str, Any]]:
        """Yield the physics of joints and motors that no URDF holds."""
        m = self.model
        for j in range(m.njnt):
            name, dof = self.joint(j), int(m.jnt_dofadr[j])
            armature = float(m.dof_armature[dof]) + drives.armature.get(name, 0.0)
            found = []
            if armature > 0.0:
                found.append(stated(ARMATURE, name, inertia=armature))
            if m.jnt_stiffness[j] > 0.0:
                rest = float(m.qpos_spring[m.jnt_qposadr[j]])
                found.append(stated(SPRING, name, stiffness=m.jnt_stiffness[j], rest=rest))
            if found and (name in drives.mimics or name in self.locked):
                self.dropped[LEFT['follower']].append(name)
            else:
                yield from found
        yield from drives.effects

    def _holds_gravity(self, drives: Drives) -> bool:
        """Return whether drives hold the whole gravity; a part of it is left out."""
        m = self.model
        moving = (m.body_weldid != 0) & (m.body_mass > 0.0)
        if drives.kp and np.allclose(m.body_gravcomp[moving], 1.0):
            return True
        for b in np.flatnonzero(m.body_gravcomp):
            self.dropped[LEFT['gravcomp']].append(self.body(int(b)))
        return False

    def name(self, kind: Any, i: int) -> str:
        return self.library.mj_id2name(self.model, kind, int(i)) or ''

    def body(self, b: int) -> str:
        return self.name(self.library.mjtObj.mjOBJ_BODY, b) or f'body_{b}'

    def joint(self, j: int) -> str:
        name = self.name(self.library.mjtObj.mjOBJ_JOINT, j)
        return name or f'joint_{j}_of_{self.body(self.model.jnt_bodyid[j])}'

    def error(self, found: str, expected: str, remedy: str = '') -> ConfigError:
        return ConfigError(f'MJCF {self.file}: {found}', expected, remedy)

    def _check_joints(self) -> None:
        kinds = self.library.mjtJoint
        for j in range(self.model.njnt):
            kind = kinds(int(self.model.jnt_type[j])).name
            if kind not in _KINDS:
                word = {'mjJNT_FREE': 'free', 'mjJNT_BALL': 'ball'}.get(kind, kind)
                raise self.error(
                    f'body {self.body(self.model.jnt_bodyid[j])} has a {word} joint',
                    'a base that is fixed to the ground and joints of one degree of freedom',
                    'fix it, or remove it from the file',
                )  # fmt: skip
        if not self.model.njnt:
            raise self.error('no joint', 'a robot with joints that move')

    def _check_contacts(self) -> None:
        """Refuse links that press on something where the file starts."""
        m = self.model
        data = self.library.MjData(m)
        if m.nkey:
            self.library.mj_resetDataKeyframe(m, data, 0)
        self.library.mj_forward(m, data)
        for contact in data.contact:
            if contact.exclude == 0 and contact.dist < -_NEAR:
                pair = [self.body(m.geom_bodyid[g]) for g in contact.geom]
                raise self.error(
                    f'bodies {pair[0]} and {pair[1]} touch where the robot starts',
                    'motion without contacts',
                    'exclude the pair (<contact><exclude .../>), or start elsewhere',
                )  # fmt: skip

    def _mimics(self) -> dict[int, tuple[str, float, float]]:
        """Return the linear equations between two positions, by joint."""
        m, kinds, found = self.model, self.library.mjtEq, {}
        for e in range(m.neq):
            kind = kinds(int(m.eq_type[e])).name
            if not m.eq_active0[e]:
                self.dropped[LEFT['off']].append(f'{e}')
            elif kind == 'mjEQ_JOINT':
                j, leader = int(m.eq_obj1id[e]), int(m.eq_obj2id[e])
                c = m.eq_data[e][:5]
                start = float(m.qpos0[m.jnt_qposadr[j]])
                if np.any(c[2:]):
                    said = f'joint {self.joint(j)} follows another joint nonlinearly'
                    raise self.error(said, 'a linear equality')
                if leader < 0:
                    self.locked[self.joint(j)] = start + float(c[0])
                else:
                    other = float(m.qpos0[m.jnt_qposadr[leader]])
                    offset = float(c[0]) + start - float(c[1]) * other
                    found[j] = self.joint(leader), float(c[1]), offset
            elif kind in {'mjEQ_CONNECT', 'mjEQ_WELD'}:
                said = 'a connect or weld constraint closes a loop of links'
                raise self.error(said, 'a tree of links', 'remove it, and the bodies below it')
            else:
                self.dropped[LEFT['constraint']].append(kind[5:].lower())
        return found

    def _joints_of(
        self, b: int, links: dict[str, Body | None], shift: dict[int, np.ndarray],
        mimics: dict[int, tuple[str, float, float]],
    ) -> Iterator[ModelJoint]:  # fmt: skip
        """Yield the joints that carry a body, and enter it in `links`."""
        m = self.model
        up = int(m.body_parentid[b])
        parent, before = self.body(up), shift[up]
        frame = Pose(place=-before) @ Pose(of_quaternion(m.body_quat[b]), m.body_pos[b].copy())
        if up == 0:
            frame = Pose(self._upright()) @ frame
        numbers = range(int(m.body_jntadr[b]), int(m.body_jntadr[b]) + int(m.body_jntnum[b]))
        anchor = np.zeros(3)
        for j in numbers:
            axis, start = m.jnt_axis[j], float(m.qpos0[m.jnt_qposadr[j]])
            is_hinge = self.library.mjtJoint(int(m.jnt_type[j])).name == 'mjJNT_HINGE'
            place = m.jnt_pos[j].copy() if is_hinge else anchor
            turned = about(axis, -start) if is_hinge else np.eye(3)
            moved = place - anchor if is_hinge else -start * axis
            child = self.body(b) if j == numbers[-1] else f'{self.body(b)}/{self.joint(j)}'
            links[child] = None
            yield self._joint(j, parent, child, frame @ Pose(turned, moved), mimics.get(j))
            parent, frame, anchor = child, Pose(), place
        name = self.body(b)
        if not numbers:
            yield ModelJoint(f'{name}_fixed', 'fixed', parent, name, frame)
        shift[b] = anchor
        turn = of_quaternion(m.body_iquat[b])
        inertia = turn @ np.diag(m.body_inertia[b]) @ turn.T
        links[name] = Body(float(m.body_mass[b]), m.body_ipos[b] - anchor, inertia)

    def _joint(
        self, j: int, parent: str, child: str, origin: Pose,
        mimic: tuple[str, float, float] | None,
    ) -> ModelJoint:  # fmt: skip
        m, name = self.model, self.joint(j)
        dof = int(m.jnt_dofadr[j])
        kind = _KINDS[self.library.mjtJoint(int(m.jnt_type[j])).name]
        is_limited = bool(m.jnt_limited[j])
        if not is_limited and kind == 'revolute':
            kind = 'continuous'
        for what, size in (('damping', 'dof_dampingpoly'), ('stiffness', 'jnt_stiffnesspoly')):
            at = dof if size.startswith('dof') else j
            if np.any(np.asarray(getattr(m, size, np.zeros((m.nv + m.njnt, 1))))[at]):
                self.dropped[LEFT[what]].append(name)
        low, high = m.jnt_range[j] if is_limited else (-math.inf, math.inf)
        limit = m.jnt_actfrcrange[j] if m.jnt_actfrclimited[j] else (-math.inf, math.inf)
        return ModelJoint(
            name, kind, parent, child, origin, tuple(m.jnt_axis[j]), float(low), float(high),
            effort=float(max(abs(x) for x in limit)), damping=float(m.dof_damping[dof]),
            friction=float(m.dof_frictionloss[dof]), mimic=mimic,
        )  # fmt: skip

    def _upright(self) -> np.ndarray:
        """Return how the base stands in a world whose gravity points along -z."""
        gravity = self.model.opt.gravity
        size, usual = float(np.linalg.norm(gravity)), float(np.linalg.norm(GRAVITY))
        if abs(size - usual) > _NEAR * usual:
            self.dropped[LEFT['gravity']].append(f'{size:g}')
        if size == 0.0:
            return np.eye(3)
        return between(gravity / size, np.array(GRAVITY[:3]) / usual)

    def _drop_rest(self) -> None:
        m = self.model
        if m.opt.density or m.opt.viscosity or np.any(m.opt.wind):
            self.dropped[LEFT['fluid']].append('option')
        for t in range(m.ntendon):
            acts = m.tendon_stiffness[t] or m.tendon_damping[t] or m.tendon_frictionloss[t]
            if acts or m.tendon_limited[t]:
                name = self.name(self.library.mjtObj.mjOBJ_TENDON, t) or f'tendon {t}'
                self.dropped[LEFT['tendon']].append(name)
        for kind, number in (('flexible bodies', m.nflex), ('plugins', m.nplugin)):
            if number:
                self.dropped[LEFT['other']].append(f'{number} {kind}')
        moving = m.body_weldid[m.geom_bodyid] != 0
        solid = (m.geom_contype != 0) | (m.geom_conaffinity != 0)
        if np.any(moving & solid):
            touching = np.flatnonzero(moving & solid)
            self.dropped[LEFT['contact']] += [self.body(m.geom_bodyid[g]) for g in touching]
