"""Numbers of joints as settings of other programs: Isaac Lab, ros2_control, plain JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any

import yaml

from sgp_ros.physics.catalogue import ARMATURE
from sgp_ros.robots.exports.handover import UNITS, Handover, numbers_of

ISAACLAB_HELD = ('damping', 'friction', ARMATURE.name, 'delay', 'kp', 'kd')
CONTROL_HELD = ('kp', 'kd')


def write_isaaclab(handed: Handover) -> tuple[str, list[str]]:
    """Return a Python module with the actuators of an Isaac Lab articulation.

    Friction stands in N m (`friction`, `dynamic_friction`, `viscous_friction` of Isaac Lab 2.3 on
    Isaac Sim 5; before, `friction` was a coefficient without unit). A delay counts physics steps.
    """
    driven = {name: j for name, j in handed.joints.items() if j.is_driven}

    def table(number: Callable[[Any], float]) -> str:
        return '{' + ', '.join(f'{n!r}: {number(j):.9g}' for n, j in driven.items()) + '}'

    limited = {n: j.effort for n, j in driven.items() if math.isfinite(j.effort)}
    latest = max((j.delay for j in driven.values()), default=0.0)
    kind = 'DelayedPDActuatorCfg' if latest > 0.0 else 'IdealPDActuatorCfg'
    lines = [
        '"""Actuators of an articulation, written by `sgp export --to isaaclab`."""',
        '',
        f'from isaaclab.actuators import {kind}',
        '',
        'PHYSICS_DT = 0.005  # [s] of your simulation: a delay counts its steps',
        f'DELAY_S = {latest!r}  # [s]',
        '',
        'ACTUATORS = {',
        f'    {handed.nominal.robot.name!r}: {kind}(',
        f'        joint_names_expr={list(driven)!r},',
        f'        stiffness={table(lambda j: j.gain * j.kp)},  # N m/rad',
        f'        damping={table(lambda j: j.gain * j.kd)},  # N m s/rad',
        f'        armature={table(lambda j: j.armature)},  # kg m2',
        f'        friction={table(lambda j: j.friction)},  # N m',
        f'        dynamic_friction={table(lambda j: j.friction)},  # N m',
        f'        viscous_friction={table(lambda j: j.damping)},  # N m s/rad',
    ]
    if limited:
        lines.append(f'        effort_limit={limited!r},  # N m')
    if latest > 0.0:
        lines += [f'        {end}_delay=round(DELAY_S / PHYSICS_DT),' for end in ('min', 'max')]
    lines += ['    ),', '}', '']
    held = [*ISAACLAB_HELD, *(['gain'] if handed.has_targets else [])]
    left = handed.left_out(held)
    passive = [
        f'{n}: the joint has no motor, so damping {j.damping:.4g}, friction {j.friction:.4g} and '
        f'rotor inertia {j.armature:.4g} come from the robot file'
        for n, j in handed.joints.items() if not j.is_driven
    ]  # fmt: skip
    apart = {j.delay for j in driven.values()}
    if len(apart) > 1:
        left.append(f'different delays {sorted(apart)}: the largest is written for all joints')
    return '\n'.join(lines), [*left, *passive]


def write_control(handed: Handover) -> tuple[str, list[str]]:
    """Return the parameters of a `pid_controller` and of limits, as ros2_control reads them."""
    driven = {name: j for name, j in handed.joints.items() if j.is_driven}
    pid = {
        'dof_names': list(driven), 'command_interface': 'effort',
        'reference_and_state_interfaces': ['position', 'velocity'],
        'gains': {n: {'p': j.kp, 'i': 0.0, 'd': j.kd} for n, j in driven.items()},
    }  # fmt: skip
    limits = {
        n: {'has_effort_limits': True, 'max_effort': j.effort}
        for n, j in driven.items() if math.isfinite(j.effort)
    }  # fmt: skip
    content: dict[str, Any] = {}
    if handed.has_targets:
        content['pid_controller'] = {'ros__parameters': pid}
    content['joint_limits'] = {'ros__parameters': {'joint_limits': limits}}
    text = yaml.safe_dump(content, sort_keys=False)
    return text, handed.left_out(CONTROL_HELD)


def write_json(handed: Handover) -> tuple[str, list[str]]:
    """Return all numbers of joints with their units and ranges, and the rest in words."""
    content = {
        'schema': 1,
        'robot': handed.nominal.robot.name,
        'units': UNITS,
        'joints': {
            name: {
                'is_driven': j.is_driven, **numbers_of(j),
                **({'effort': j.effort} if math.isfinite(j.effort) else {}),
                **({'ranges': {k: list(x) for k, x in j.ranges.items()}} if j.ranges else {}),
            }
            for name, j in handed.joints.items()
        },
        'holds_gravity': handed.holds_gravity,
        'others': handed.others,
    }  # fmt: skip
    return json.dumps(content, indent=1, allow_nan=False) + '\n', []
