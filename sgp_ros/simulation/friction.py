"""Kinds of friction that are the same everywhere and at all times."""

from __future__ import annotations

import math
from collections.abc import Mapping

from sgp_ros.simulation.effects import (
    Action,
    Moment,
    ParameterValue,
)
from sgp_ros.simulation.mechanism import SimulatedJoint


def viscous(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, ParameterValue]
) -> tuple[Action, ...]:
    """Return `tau_x = -b v`."""
    b = float(values['b'])
    return (Action(joint, force=lambda moment: -b * float(moment.velocity[joint])),)


def coulomb(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, ParameterValue]
) -> tuple[Action, ...]:
    """Return `tau_x = -level sign(v)`, holding up to `level` at rest."""
    level = float(values['level'])
    return (Action(joint, dry_level=lambda _moment, _direction: level),)


def stribeck(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, ParameterValue]
) -> tuple[Action, ...]:
    """Return `tau_x = -(coulomb + (static - coulomb) exp(-(v / stribeck_velocity)^2)) sign(v)`."""
    coulomb, static = float(values['coulomb']), float(values['static'])
    scale = float(values['stribeck_velocity'])

    def level(moment: Moment, _direction: int) -> float:
        slowness = math.exp(-((float(moment.velocity[joint]) / scale) ** 2))
        return coulomb + (static - coulomb) * slowness

    return (Action(joint, dry_level=level),)


def quadratic(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, ParameterValue]
) -> tuple[Action, ...]:
    """Return `tau_x = -c |v| v`."""
    c = float(values['c'])

    def force(moment: Moment) -> float:
        v = float(moment.velocity[joint])
        return -c * abs(v) * v

    return (Action(joint, force=force),)


def asymmetric(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, ParameterValue]
) -> tuple[Action, ...]:
    """Return `-level_pos` for `v > 0`, `level_neg` for `v < 0`."""
    up, down = float(values['level_pos']), float(values['level_neg'])
    return (Action(joint, dry_level=lambda _moment, direction: up if direction > 0 else down),)


def load(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, ParameterValue]
) -> tuple[Action, ...]:
    """Return `tau_x = -(level + mu |force of the motor|) sign(v)`."""
    level, mu = float(values['level']), float(values['mu'])
    return (
        Action(joint, dry_level=lambda m, _direction: level + mu * abs(float(m.drive[joint]))),
    )
