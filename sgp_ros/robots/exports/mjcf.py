"""A robot as MJCF: its own file with other numbers, or one made from its URDF.

Where the robot came from MJCF, that file is changed and all else in it stays: geoms, sensors,
cameras. Bodies and joints are found by their names.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from sgp_ros.errors import ConfigError
from sgp_ros.optional import optional_package
from sgp_ros.physics.catalogue import ARMATURE
from sgp_ros.rigid.tree import GRAVITY
from sgp_ros.rigid.urdf_text import parse_urdf
from sgp_ros.robots.exports.handover import Handover, JointNumbers

HELD = ('damping', 'friction', ARMATURE.name, 'stiffness', 'delay', 'gain', 'kp', 'kd', 'gravity')
_FAST = 'solref_friction', (0.004, 1.0)
"""Of dry friction: MuJoCo's default of 0.02 s lets a joint creep where it should stick."""
_HARD = 'solimp_friction', (0.99, 0.999, 0.001, 0.5, 2.0)
_STEP_S = 0.001
"""Of a simulation whose file is made here: gains of stiff drives stay stable."""
_MARGIN = 1e-4
"""Of the triangle inequality of principal moments, above the rounding of a file."""
_SMALLEST = '1e-9'


def write_mjcf(handed: Handover, origin: Path | None, out: Path) -> tuple[str, list[str]]:
    """Return the text of an MJCF file, and what it cannot say.

    Args:
        handed: the robot.
        origin: MJCF file that it came from; None for one made from the URDF.
        out: folder that the text is written to, from which it finds its meshes.

    Raises:
        ConfigError: MuJoCo is missing, or the file is no longer that of the robot.
    """
    library = optional_package('mujoco', 'to write MJCF', 'simulate')
    try:
        if origin is not None:
            spec = library.MjSpec.from_file(str(origin))
        else:
            spec = library.MjSpec.from_string(_compiled_urdf(handed))
            spec.option.timestep = _STEP_S
            spec.option.integrator = library.mjtIntegrator.mjINT_IMPLICITFAST
        _change_bodies(library, spec, handed, is_original=origin is not None)
        for name, numbers in handed.joints.items():
            _change_joint(library, spec, name, numbers)
        left = _change_actuators(library, spec, handed)
        if origin is None:
            _add_followers(library, spec, handed)
        spec.option.gravity = _gravity(handed, spec, is_original=origin is not None)
        spec.compile()
        if origin is not None and (spec.meshes or spec.textures or spec.hfields or spec.skins):
            spec.modelfiledir = str(out.resolve())
            for key in ('meshdir', 'texturedir'):
                place = (origin.parent / getattr(spec, key)).resolve()
                setattr(spec, key, _seen_from(out.resolve(), place))
        text: str = spec.to_xml()
    except (ValueError, KeyError) as error:
        where = 'the URDF' if origin is None else origin.name
        raise ConfigError(
            f'MJCF from {where}: {" ".join(str(error).split())}', 'an MJCF of the same robot',
            'name the MJCF of the robot, or omit --model to convert its URDF',
        ) from error  # fmt: skip
    held = [x for x in HELD if x != 'gain' or not handed.has_targets]
    lag = [] if handed.has_targets else ['lag']
    return text, [*left, *handed.left_out([*held, *lag])]


def _seen_from(folder: Path, place: Path) -> str:
    """Return a path that leads from one place to another; both are absolute."""
    above = [folder, *folder.parents]
    steps = next(i for i, x in enumerate(above) if place.is_relative_to(x))
    return str(Path(*('..',) * steps, place.relative_to(above[steps])))


def _compiled_urdf(handed: Handover) -> str:
    """Return the URDF with what MuJoCo's reader needs to know."""
    root = ET.fromstring(parse_urdf(handed.urdf).plain)  # noqa: S314  # written by `rigid`
    joints = parse_urdf(handed.urdf).joints
    for element in root.findall('joint'):
        joint = joints[element.get('name', '')]
        limit = element.find('limit')
        if element.get('type') == 'revolute' and not math.isfinite(joint.lower):
            element.set('type', 'continuous')
            if limit is not None:
                element.remove(limit)
        elif limit is not None and math.isfinite(joint.lower):
            limit.set('lower', repr(joint.lower))
            limit.set('upper', repr(joint.upper))
            limit.set('effort', '0')
    options = {
        'fusestatic': 'false', 'balanceinertia': 'true', 'discardvisual': 'false',
        'boundmass': _SMALLEST, 'boundinertia': _SMALLEST,
    }  # fmt: skip
    ET.SubElement(ET.SubElement(root, 'mujoco'), 'compiler', options)
    return ET.tostring(root, encoding='unicode')


def _change_bodies(library: Any, spec: Any, handed: Handover, *, is_original: bool) -> None:
    """Write mass, centre and inertia of the links that are not as they were."""
    if not is_original:
        return
    links = {x.get('name', ''): x.find('inertial') for x in ET.fromstring(handed.urdf)  # noqa: S314  # written by `rigid`
             if x.tag == 'link'}  # fmt: skip
    model = spec.compile()
    shifts = _shifts(library, model)
    for b, body in enumerate(spec.bodies):
        name = body.name or f'body_{b}'
        if name not in links or b == 0:
            continue
        mass, centre, inertia = _numbers(links[name])
        centre = centre + shifts[b]
        turn = np.empty(9)
        library.mju_quat2Mat(turn, model.body_iquat[b])
        R = turn.reshape(3, 3)
        now = R @ np.diag(model.body_inertia[b]) @ R.T
        same = np.allclose(now, inertia, rtol=1e-6, atol=1e-9 * max(mass, 1e-9))
        if same and np.allclose([model.body_mass[b], *model.body_ipos[b]], [mass, *centre]):
            continue
        inertia = _rounded_safely(inertia)
        body.explicitinertial = True
        body.mass, body.ipos = mass, centre
        body.inertia, body.iquat = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])  # instead of them
        body.fullinertia = [inertia[i, j] for i, j in
                            ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]  # fmt: skip


def _rounded_safely(inertia: np.ndarray) -> np.ndarray:
    """Return an inertia whose principal moments obey A + B >= C also after rounding, (3, 3).

    A flat body lies on the boundary, and the file holds six digits.
    """
    moments, axes = np.linalg.eigh(inertia)
    lack = moments[2] * (1.0 + _MARGIN) - moments[0] - moments[1]
    if lack <= 0.0:
        return inertia
    moments[:2] += 0.5 * lack
    raised: np.ndarray = axes @ np.diag(moments) @ axes.T
    return raised


def _shifts(library: Any, model: Any) -> list[np.ndarray]:
    """Return where the frame of each body's link lies in it: at the anchor of its last hinge."""
    shifts = [np.zeros(3) for _ in range(model.nbody)]
    for j in range(model.njnt):
        if int(model.jnt_type[j]) == int(library.mjtJoint.mjJNT_HINGE):
            shifts[int(model.jnt_bodyid[j])] = model.jnt_pos[j].copy()
    return shifts


def _numbers(inertial: ET.Element | None) -> tuple[float, np.ndarray, np.ndarray]:
    if inertial is None:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    mass, tensor, origin = (inertial.find(tag) for tag in ('mass', 'inertia', 'origin'))
    assert mass is not None
    assert tensor is not None
    xyz = '0 0 0' if origin is None else origin.get('xyz', '0 0 0')
    xx, xy, xz, yy, yz, zz = (
        float(tensor.get(key, '0')) for key in ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')
    )
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return float(mass.get('value', '0')), np.array([float(x) for x in xyz.split()]), inertia


def _change_joint(library: Any, spec: Any, name: str, numbers: JointNumbers) -> None:
    joint = _joint(spec, name)
    for attribute, value in (('damping', numbers.damping), ('stiffness', numbers.stiffness)):
        before = np.array(getattr(joint, attribute), dtype=np.float64)
        linear = np.zeros_like(before)
        linear.flat[0] = max(value, 0.0)
        setattr(joint, attribute, linear if before.ndim else float(linear))
    joint.armature = max(numbers.armature, 0.0)
    joint.frictionloss = max(numbers.friction, 0.0)
    if numbers.stiffness:
        turns = joint.type == library.mjtJoint.mjJNT_HINGE
        degrees = turns and spec.compiler.degree
        joint.springref = math.degrees(numbers.rest) if degrees else numbers.rest
    if numbers.friction > 0.0:
        for attribute, values in (_FAST, _HARD):
            setattr(joint, attribute, values)


def _change_actuators(library: Any, spec: Any, handed: Handover) -> list[str]:
    """Write what drives do; return what could not be written."""
    joints = {a.target for a in spec.actuators}
    left = []
    for name, numbers in handed.joints.items():
        if not numbers.is_driven:
            continue
        own = [a for a in spec.actuators if a.target == name]
        if not own and joints and any(a.trntype == library.mjtTrn.mjTRN_TENDON
                                      for a in spec.actuators):  # fmt: skip
            left.append(f'{name}: the actuator of its tendon was not changed')
            continue
        if len(own) > 1:
            left.append(f'{name}: its {len(own)} actuators were not changed')
            continue
        actuator = own[0] if own else spec.add_actuator(
            name=name, target=name, trntype=library.mjtTrn.mjTRN_JOINT
        )  # fmt: skip
        if not own and math.isfinite(numbers.effort):
            actuator.forcerange = (-numbers.effort, numbers.effort)
        gear = float(actuator.gear[0]) or 1.0
        gain, bias = np.array(actuator.gainprm), np.array(actuator.biasprm)
        if handed.has_targets:
            kp = numbers.gain * numbers.kp / gear**2
            kd = numbers.gain * numbers.kd / gear**2
            gain[0], bias[:3] = kp or kd, (0.0, -kp, -kd)
            actuator.biastype = library.mjtBias.mjBIAS_AFFINE
        elif not own or actuator.biastype == library.mjtBias.mjBIAS_NONE:
            gain[0] = numbers.gain * (gain[0] if own else 1.0)
            if numbers.lag:
                actuator.dyntype = library.mjtDyn.mjDYN_FILTEREXACT
                actuator.dynprm[0] = numbers.lag
        actuator.gainprm, actuator.biasprm = gain, bias
        left += _delayed(spec, actuator, name, numbers)
    return left


def _delayed(spec: Any, actuator: Any, name: str, numbers: JointNumbers) -> list[str]:
    if not hasattr(actuator, 'delay'):
        said = f'{name}: delay {numbers.delay:.4g} s, not supported by this version of MuJoCo'
        return [said] if numbers.delay else []
    if numbers.delay > 0.0:
        actuator.delay = numbers.delay
        actuator.nsample = max(2, math.ceil(numbers.delay / float(spec.option.timestep)) + 1)
    return []


def _add_followers(library: Any, spec: Any, handed: Handover) -> None:
    """Add an equality for each joint that follows another one."""
    for joint in parse_urdf(handed.urdf).joints.values():
        if joint.follows is not None:
            spec.add_equality(
                type=library.mjtEq.mjEQ_JOINT, name1=joint.name, name2=joint.follows,
                objtype=library.mjtObj.mjOBJ_JOINT,
                data=[joint.offset, joint.multiplier, *[0.0] * 9],
            )  # fmt: skip


def _gravity(handed: Handover, spec: Any, *, is_original: bool) -> np.ndarray:
    """Return gravity in the world of the file, whose base stands as the diagnosis says."""
    found = np.array(handed.nominal.tree.gravity, dtype=np.float64)[:3]
    if np.allclose(found, GRAVITY[:3]) or (is_original and not np.allclose(
        np.array(spec.option.gravity), GRAVITY[:3]
    )):  # fmt: skip
        return np.array(spec.option.gravity)
    return found


def _joint(spec: Any, name: str) -> Any:
    """Return a joint by its name, or by the one that the reader gave it."""
    bodies = {body.name or f'body_{b}' for b, body in enumerate(spec.bodies)}
    for j, joint in enumerate(spec.joints):
        if joint.name == name or (not joint.name and name in {
            f'joint_{j}_of_{body}' for body in bodies
        }):  # fmt: skip
            joint.name = name
            return joint
    raise KeyError(f'no joint named {name}')
