"""Forces that depend on positions, on other joints or on nothing."""

from __future__ import annotations

import math
from collections.abc import Mapping

from sgp_ros.physics.parts import Value
from sgp_ros.simulation.effects import Action, Moment, side_of, source_of
from sgp_ros.simulation.mechanism import SimulatedJoint

_STIFF_S = 1e-3


def spring(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, Value]
) -> tuple[Action, ...]:
    """Return `tau_x = -stiffness (q - rest)`."""
    stiffness, rest = float(values['stiffness']), float(values['rest'])
    return (Action(joint, force=lambda m: -stiffness * (float(m.position[joint]) - rest)),)


def constant(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, Value]
) -> tuple[Action, ...]:
    """Return `tau_x = force`."""
    force = float(values['force'])
    return (Action(joint, force=lambda _moment: force),)


def cogging(
    joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, Value]
) -> tuple[Action, ...]:
    """Return `amplitude sin(periods q + phase)`, `2 pi periods q` on a prismatic joint."""
    amplitude, phase = float(values['amplitude']), float(values['phase'])
    wave = joints[joint].turn * float(values['periods'])
    return (
        Action(
            joint, force=lambda m: amplitude * math.sin(wave * float(m.position[joint]) + phase)
        ),
    )


def end_stop(
    joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, Value]
) -> tuple[Action, ...]:
    """Return a contact beyond `position` that pushes back, never pulls."""
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


def coupling(
    joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, Value]
) -> tuple[Action, ...]:
    """Return a share of the force of another motor, or a cable between two joints."""
    source = source_of(joints, joint, values, 'joint_coupling')
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


def armature(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, Value]
) -> tuple[Action, ...]:
    """Return `tau_x = -inertia a`: the rotor of the motor."""
    return (Action(joint, inertia=float(values['inertia'])),)
