"""Laws of drives, between the command and the force on the joint, and of encoders."""

from __future__ import annotations

import math
from collections.abc import Mapping

from sgp_ros.physics.parts import Value
from sgp_ros.simulation.effects import Action, Moment
from sgp_ros.simulation.mechanism import SimulatedJoint

_CONTACT_DAMPING = 0.7


def delay(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, Value]
) -> tuple[Action, ...]:
    """Return a command that arrives later by exactly `delay`, also between two samples."""
    return (Action(joint, delay_s=float(values['delay'])),)


def dead_zone(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, Value]
) -> tuple[Action, ...]:
    """Return a motor that gives `u - clip(u, -width, width)`."""
    width = float(values['width'])

    def current(moment: Moment) -> float:
        u = float(moment.drive[joint])
        return u - min(max(u, -width), width)

    return (Action(joint, current=current),)


def lag(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, Value]
) -> tuple[Action, ...]:
    """Return a first-order lag between the force wanted of a motor and the one it gives."""
    time_constant = float(values['time_constant'])

    def rate(moment: Moment) -> tuple[float]:
        return ((float(moment.drive[joint]) - float(moment.state[0])) / time_constant,)

    return (
        Action(
            joint,
            current=lambda moment: float(moment.state[0]),
            start=lambda _q, _v: (0.0,),
            state_rate=rate,
            substep_s=0.5 * time_constant,
        ),
    )


def saturation(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, Value]
) -> tuple[Action, ...]:
    """Return a motor that gives `clip(u, -limit, limit)`."""
    limit = float(values['limit'])
    return (Action(joint, current=lambda m: min(max(float(m.drive[joint]), -limit), limit)),)


def speed_limit(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, Value]
) -> tuple[Action, ...]:
    """Return a motor that drives with at most `stall_torque (1 - |v| / no_load_speed)`.

    A force against the motion is at most `stall_torque`.
    """
    stall, fastest = float(values['stall_torque']), float(values['no_load_speed'])

    def current(moment: Moment) -> float:
        u, v = float(moment.drive[joint]), float(moment.velocity[joint])
        most = stall if u * v <= 0.0 else max(stall - stall / fastest * abs(v), 0.0)
        return math.copysign(min(abs(u), most), u)

    return (Action(joint, current=current),)


def gain(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, Value]
) -> tuple[Action, ...]:
    """Return a motor that gives `gain u`; its current does not show that."""
    gain = float(values['gain'])
    return (Action(joint, drive=lambda moment: gain * float(moment.drive[joint])),)


def backlash(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, Value]
) -> tuple[Action, ...]:
    """Return play between motor and link, both with their own motion; the encoder is on the motor.

    `motor_inertia` is part of the robot's own inertia, so the link keeps the rest. Where motor and
    link touch, a spring and a damper act that never pull; the motor alone would swing on that
    spring at `contact_hz`, with 0.7 of critical damping.
    """
    half, inertia = 0.5 * float(values['gap']), float(values['motor_inertia'])
    rate = 2.0 * math.pi * float(values['contact_hz'])
    stiffness, damping = inertia * rate**2, 2.0 * _CONTACT_DAMPING * inertia * rate

    def contact(moment: Moment) -> float:
        twist = float(moment.state[0]) - float(moment.position[joint])
        spin = float(moment.state[1]) - float(moment.velocity[joint])
        if twist > half:
            return max(stiffness * (twist - half) + damping * spin, 0.0)
        if twist < -half:
            return min(stiffness * (twist + half) + damping * spin, 0.0)
        return 0.0

    def motor(moment: Moment) -> tuple[float, float]:
        force = float(moment.drive[joint]) - contact(moment)
        return float(moment.state[1]), force / inertia

    return (
        Action(
            joint,
            drive=contact,
            inertia=-inertia,
            sense=lambda moment: (float(moment.state[0]), float(moment.state[1])),
            start=lambda q, v: (q, v),
            state_rate=motor,
            substep_s=0.1 / rate,
        ),
    )


def elasticity(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, Value]
) -> tuple[Action, ...]:
    """Return a spring and a damper between motor and link, both with their own motion.

    `motor_inertia` is part of the robot's own inertia, so the link keeps the rest. What else acts
    on the joint acts on the link.
    """
    stiffness, damping = float(values['stiffness']), float(values['damping'])
    inertia = float(values['motor_inertia'])

    def spring(moment: Moment) -> float:
        twist = float(moment.state[0]) - float(moment.position[joint])
        return stiffness * twist + damping * (
            float(moment.state[1]) - float(moment.velocity[joint])
        )

    def motor(moment: Moment) -> tuple[float, float]:
        force = float(moment.drive[joint]) - spring(moment)
        return float(moment.state[1]), force / inertia

    def shown(moment: Moment) -> tuple[float, float]:
        return float(moment.state[0]), float(moment.state[1])

    rate = max(math.sqrt(stiffness / inertia), damping / inertia)
    return (
        Action(
            joint,
            drive=spring,
            inertia=-inertia,
            sense=shown if values['encoder'] == 'motor' else None,
            start=lambda q, v: (q, v),
            state_rate=motor,
            substep_s=0.3 / rate,
        ),
    )


def eccentricity(
    joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, Value]
) -> tuple[Action, ...]:
    """Return an encoder that shows `q + amplitude sin(periods q + phase)`."""
    amplitude, phase = float(values['amplitude']), float(values['phase'])
    wave = joints[joint].turn * float(values['periods'])

    def sense(moment: Moment) -> tuple[float, float]:
        q, v = float(moment.position[joint]), float(moment.velocity[joint])
        angle = wave * q + phase
        return q + amplitude * math.sin(angle), v * (1.0 + amplitude * wave * math.cos(angle))

    return (Action(joint, sense=sense),)


def velocity_lag(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, Value]
) -> tuple[Action, ...]:
    """Return a measured velocity behind a first-order low-pass; the position is right."""
    time_constant = float(values['time_constant'])

    def rate(moment: Moment) -> tuple[float]:
        return ((float(moment.velocity[joint]) - float(moment.state[0])) / time_constant,)

    return (
        Action(
            joint,
            sense_velocity=lambda moment: float(moment.state[0]),
            start=lambda _q, v: (v,),
            state_rate=rate,
            substep_s=0.5 * time_constant,
        ),
    )
