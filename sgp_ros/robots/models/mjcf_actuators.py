"""The actuators of a compiled MJCF: which joints are driven, by which gains, up to which effort.

An actuator exerts `gear (g ctrl + b0 + b1 l + b2 l')` on its joint with `l = gear q` (MuJoCo,
computation, actuation model). A motor has no b; a servo of position has `g = -b1 = kp` and
`b2 = -kd`, one of velocity `g = -b2 = kd`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from sgp_ros.physics.catalogue import ACTUATOR_LAG, COMMAND_DELAY
from sgp_ros.robots.models.model import ModelJoint, stated

LEFT = {
    'mixed': 'Gains are ignored, as other joints are driven by efforts',
    'transmission': 'Actuators that do not act on a single joint are ignored',
    'gain': 'The effort is the control times a gain (state it as `effort_gain` in a robot YAML if '
    'a recording contains controls)',
    'gear': 'The target is the position times a gear',
    'law': 'Actuators of this type are ignored',
    'activation': 'The activation dynamics of these actuators are ignored',
}
"""Remarks on what has no place here."""

Dropped = dict[str, list[str]]
"""Remark to the names of what it is about."""


@dataclass(slots=True)
class Drives:
    """Drives that the actuators of a model make, by joint.

    Attributes:
        mimics: joint to the one that it follows, the multiplier and the offset.
        motors: joints driven by a force.
        kp, kd: of joints driven to a target [N m/rad, N m s/rad].
        effort: limits [N m or N].
        armature: of motors, at the joint [kg m^2 or kg].
        damping: of motors, at the joint [N m s/rad or N s/m].
        effects: as a robot YAML states them.
    """

    mimics: Mapping[str, tuple[str, float, float]]
    motors: set[str] = field(default_factory=set)
    kp: dict[str, float] = field(default_factory=dict)
    kd: dict[str, float] = field(default_factory=dict)
    effort: dict[str, float] = field(default_factory=dict)
    armature: dict[str, float] = field(default_factory=dict)
    damping: dict[str, float] = field(default_factory=dict)
    effects: list[dict[str, Any]] = field(default_factory=list)

    def applied(self, joint: ModelJoint) -> ModelJoint:
        """Return a joint with what its motor adds."""
        name = joint.name
        return replace(
            joint,
            damping=joint.damping + self.damping.get(name, 0.0),
            effort=min(joint.effort, self.effort.get(name, math.inf)),
            is_driven=name in self.motors or name in self.kp,
        )

    def gains(self, dropped: Dropped, *, holds_gravity: bool) -> dict[str, Any]:
        """Return the entry `gains` of a robot YAML; empty where no drive has any."""
        if not self.kp:
            return {}
        if self.motors:
            dropped[LEFT['mixed']] += list(self.kp)
            return {}
        found: dict[str, Any] = {'kp': dict(self.kp), 'kd': dict(self.kd)}
        return found | ({'feedforward': 'gravity'} if holds_gravity else {})


def read_drives(
    library: Any, model: Any, names: list[str], mimics: Mapping[str, tuple[str, float, float]],
    dropped: Dropped,
) -> Drives:  # fmt: skip
    """Return what the actuators of a compiled model do.

    Args:
        library: MuJoCo.
        model: compiled.
        names: of its joints, in its order.
        mimics: joint to the one that it follows, the multiplier and the offset.
        dropped: what has no place is appended here.
    """
    drives = Drives(mimics)
    for a in range(model.nu):
        name = library.mj_id2name(model, library.mjtObj.mjOBJ_ACTUATOR, a) or f'actuator {a}'
        found = _transmission(library, model, a, names, mimics)
        if found is None:
            dropped[LEFT['transmission']].append(name)
            continue
        joint, gear = found
        if _add_law(library, model, a, joint, gear, drives, name, dropped):
            _add_motor(library, model, a, joint, gear, drives, dropped)
    return drives


def _transmission(
    library: Any, m: Any, a: int, names: list[str],
    mimics: Mapping[str, tuple[str, float, float]],
) -> tuple[str, float] | None:  # fmt: skip
    """Return the joint that an actuator acts on, and its length per position of that joint."""
    kind = library.mjtTrn(int(m.actuator_trntype[a])).name
    gear, target = float(m.actuator_gear[a][0]), int(m.actuator_trnid[a][0])
    if kind in {'mjTRN_JOINT', 'mjTRN_JOINTINPARENT'}:
        parts = [(names[target], gear)]
    elif kind == 'mjTRN_TENDON':
        wraps = range(int(m.tendon_adr[target]), int(m.tendon_adr[target] + m.tendon_num[target]))
        if any(int(m.wrap_type[w]) != int(library.mjtWrap.mjWRAP_JOINT) for w in wraps):
            return None
        parts = [(names[int(m.wrap_objid[w])], gear * float(m.wrap_prm[w])) for w in wraps]
    else:
        return None
    total: dict[str, float] = {}
    for joint, ratio in parts:
        while joint in mimics:
            joint, multiplier, _ = mimics[joint]  # noqa: PLW2901 - up to the joint that leads
            ratio *= multiplier  # noqa: PLW2901 - as above
        total[joint] = total.get(joint, 0.0) + ratio
    return next(iter(total.items())) if len(total) == 1 and any(total.values()) else None


def _add_law(
    library: Any, m: Any, a: int, joint: str, gear: float, drives: Drives, name: str,
    dropped: Dropped,
) -> bool:  # fmt: skip
    """Enter what an actuator does with its control; return whether it has a place here."""
    gain, bias = float(m.actuator_gainprm[a][0]), [float(x) for x in m.actuator_biasprm[a][:3]]
    gain_kind = library.mjtGain(int(m.actuator_gaintype[a])).name
    bias_kind = library.mjtBias(int(m.actuator_biastype[a])).name
    if bias_kind == 'mjBIAS_NONE':
        bias = [0.0, 0.0, 0.0]
    is_linear = gain_kind == 'mjGAIN_FIXED' and bias_kind in {'mjBIAS_NONE', 'mjBIAS_AFFINE'}
    square = gear * gear
    if is_linear and not any(bias):
        drives.motors.add(joint)
        if not math.isclose(gain * gear, 1.0):
            dropped[LEFT['gain']].append(f'{joint} {gain * gear:g}')
    elif is_linear and bias[0] == 0.0 and gain > 0.0 and math.isclose(bias[1], -gain):
        drives.kp[joint] = drives.kp.get(joint, 0.0) + square * gain
        drives.kd[joint] = drives.kd.get(joint, 0.0) - square * bias[2]
        if not math.isclose(gear, 1.0):
            dropped[LEFT['gear']].append(f'{joint} {gear:g}')
    elif is_linear and not any(bias[:2]) and gain > 0.0 and math.isclose(bias[2], -gain):
        drives.kp.setdefault(joint, 0.0)
        drives.kd[joint] = drives.kd.get(joint, 0.0) + square * gain
    else:
        dropped[LEFT['law']].append(name)
        return False
    return True


def _add_motor(
    library: Any, m: Any, a: int, joint: str, gear: float, drives: Drives, dropped: Dropped
) -> None:
    """Enter range, delay, lag, rotor inertia and damping of an actuator."""
    square = gear * gear
    none = np.zeros(m.nu)
    drives.armature[joint] = drives.armature.get(joint, 0.0) + square * float(
        getattr(m, 'actuator_armature', none)[a]
    )
    drives.damping[joint] = drives.damping.get(joint, 0.0) + square * float(
        np.ravel(getattr(m, 'actuator_damping', none)[a])[0]
    )
    if m.actuator_forcelimited[a]:
        limit = abs(gear) * float(np.abs(m.actuator_forcerange[a]).max())
        drives.effort[joint] = drives.effort.get(joint, 0.0) + limit
    elif joint in drives.motors and m.actuator_ctrllimited[a]:
        gain = float(m.actuator_gainprm[a][0])
        limit = abs(gear * gain) * float(np.abs(m.actuator_ctrlrange[a]).max())
        drives.effort[joint] = drives.effort.get(joint, 0.0) + limit
    delay = float(getattr(m, 'actuator_delay', none)[a])
    if delay > 0.0:
        drives.effects.append(stated(COMMAND_DELAY, joint, delay=delay))
    kind = library.mjtDyn(int(m.actuator_dyntype[a])).name
    if kind in {'mjDYN_FILTER', 'mjDYN_FILTEREXACT'} and joint in drives.motors:
        constant = float(m.actuator_dynprm[a][0])
        drives.effects.append(stated(ACTUATOR_LAG, joint, time_constant=constant))
    elif kind != 'mjDYN_NONE':
        dropped[LEFT['activation']].append(joint)
