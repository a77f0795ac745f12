"""Forces that depend on positions, on other joints or on nothing."""

from __future__ import annotations

import math
from collections.abc import Mapping

from sgp_ros.errors import ConfigError
from sgp_ros.simulation.effects import (
    SIDE,
    Action,
    EffectKind,
    EffectParameter,
    Moment,
    ParameterValue,
    Place,
    side_of,
)
from sgp_ros.simulation.mechanism import SimulatedJoint

_STIFF_S = 1e-3


def _spring(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, ParameterValue]
) -> tuple[Action, ...]:
    stiffness, rest = float(values['stiffness']), float(values['rest'])
    return (Action(joint, force=lambda m: -stiffness * (float(m.position[joint]) - rest)),)


def _constant(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, ParameterValue]
) -> tuple[Action, ...]:
    force = float(values['force'])
    return (Action(joint, force=lambda _moment: force),)


def _cogging(
    joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, ParameterValue]
) -> tuple[Action, ...]:
    amplitude, phase = float(values['amplitude']), float(values['phase'])
    wave = joints[joint].turn * float(values['periods'])
    return (
        Action(
            joint, force=lambda m: amplitude * math.sin(wave * float(m.position[joint]) + phase)
        ),
    )


def _end_stop(
    joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, ParameterValue]
) -> tuple[Action, ...]:
    position = float(values['position'])
    stiffness, damping = float(values['stiffness']), float(values['damping'])
    side = side_of(joints[joint], position, values['side'])

    def force(moment: Moment) -> float:
        depth = side * (float(moment.position[joint]) - position)
        if depth <= 0.0:
            return 0.0
        push = stiffness * depth + damping * side * float(moment.velocity[joint])
        return -side * max(push, 0.0)

    return (Action(joint, force=force, substep_s=_STIFF_S),)


def _coupling(
    joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, ParameterValue]
) -> tuple[Action, ...]:
    names = [description.name for description in joints]
    if values['source_joint'] not in names or values['source_joint'] == names[joint]:
        raise ConfigError(
            f'joint_coupling of {names[joint]!r} with {values["source_joint"]!r}',
            f'another one of {names}',
        )
    source = names.index(str(values['source_joint']))
    if values['kind'] == 'torque':
        share = float(values['coefficient'])
        return (Action(joint, force=lambda moment: share * float(moment.drive[source])),)
    stiffness, ratio = float(values['stiffness']), float(values['ratio'])

    def tension(moment: Moment) -> float:
        stretch = float(moment.position[joint]) - ratio * float(moment.position[source])
        return stiffness * stretch

    return (
        Action(joint, force=lambda moment: -tension(moment)),
        Action(source, force=lambda moment: ratio * tension(moment)),
    )


SPRING = EffectKind(
    'spring',
    (EffectParameter('stiffness', 'N m/rad', low=0.0), EffectParameter('rest', 'rad')),
    _spring,
)
"""`tau_x = -stiffness (q - rest)`."""

CONSTANT_LOAD = EffectKind('constant_load', (EffectParameter('force', 'N m'),), _constant)
"""`tau_x = force`."""

COGGING = EffectKind(
    'cogging',
    (
        EffectParameter('amplitude', 'N m'),
        EffectParameter('periods', '1/revolution'),
        EffectParameter('phase', 'rad'),
    ),
    _cogging,
)
"""`tau_x = amplitude sin(periods q + phase)`, with `2 pi periods q` on a prismatic joint."""

END_STOP = EffectKind(
    'end_stop',
    (
        EffectParameter('position', 'rad'),
        EffectParameter('stiffness', 'N m/rad', low=0.0),
        EffectParameter('damping', 'N m s/rad', low=0.0),
        SIDE,
    ),
    _end_stop,
)
"""A contact beyond `position` towards the end `side` that pushes back, never pulls.

`|tau_x| = max(stiffness depth + damping d(depth)/dt, 0)`.
"""

JOINT_COUPLING = EffectKind(
    'joint_coupling',
    (
        EffectParameter('source_joint', is_joint=True),
        EffectParameter('kind', choices=('torque', 'spring')),
        EffectParameter('coefficient', only_kind='torque'),
        EffectParameter('stiffness', 'N m/rad', low=0.0, only_kind='spring'),
        EffectParameter('ratio', only_kind='spring'),
    ),
    _coupling,
)
"""`tau_x = coefficient` times the force of another motor, or a cable between two joints.

The cable has the energy `stiffness (q - ratio q_source)^2 / 2` and so acts on both.
"""

ARMATURE = EffectKind(
    'armature',
    (EffectParameter('inertia', 'kg m2', low=0.0),),
    lambda _joints, joint, values: (Action(joint, inertia=float(values['inertia'])),),
)
"""`tau_x = -inertia a`: the rotor of the motor."""

GRAVITY_TILT = EffectKind(
    'gravity_tilt',
    (EffectParameter('roll', 'rad'), EffectParameter('pitch', 'rad')),
    place=Place.BASE,
    physical={'roll': 'base_roll', 'pitch': 'base_pitch'},
)
"""The base stands in the world turned by `Ry(pitch) Rx(roll)`."""

PAYLOAD = EffectKind(
    'payload',
    (
        EffectParameter('mass', 'kg', low=0.0),
        EffectParameter('x', 'm'),
        EffectParameter('y', 'm'),
        EffectParameter('z', 'm'),
    ),
    place=Place.LAST,
    physical={
        'mass': 'payload_mass', 'x': 'payload_x', 'y': 'payload_y', 'z': 'payload_z',
    },
)  # fmt: skip
"""A point mass on the last link, in the frame of that link."""

TIP_FORCE = EffectKind(
    'tip_force',
    (EffectParameter('fx', 'N'), EffectParameter('fy', 'N'), EffectParameter('fz', 'N')),
    place=Place.TOOL,
    physical={'fx': 'tip_fx', 'fy': 'tip_fy', 'fz': 'tip_fz'},
)
"""A constant force in the axes of the root at the origin of `tool0`."""
