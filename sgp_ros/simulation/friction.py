"""Kinds of friction that are the same everywhere and at all times."""

from __future__ import annotations

import math
from collections.abc import Mapping

from sgp_ros.simulation.effects import (
    Action,
    EffectKind,
    EffectParameter,
    Moment,
    ParameterValue,
    Place,
)
from sgp_ros.simulation.mechanism import SimulatedJoint


def _viscous(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, ParameterValue]
) -> tuple[Action, ...]:
    b = float(values['b'])
    return (Action(joint, force=lambda moment: -b * float(moment.velocity[joint])),)


def _coulomb(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, ParameterValue]
) -> tuple[Action, ...]:
    level = float(values['level'])
    return (Action(joint, dry_level=lambda _moment, _direction: level),)


def _stribeck(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, ParameterValue]
) -> tuple[Action, ...]:
    coulomb, static = float(values['coulomb']), float(values['static'])
    scale = float(values['stribeck_velocity'])

    def level(moment: Moment, _direction: int) -> float:
        slowness = math.exp(-((float(moment.velocity[joint]) / scale) ** 2))
        return coulomb + (static - coulomb) * slowness

    return (Action(joint, dry_level=level),)


def _quadratic(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, ParameterValue]
) -> tuple[Action, ...]:
    c = float(values['c'])

    def force(moment: Moment) -> float:
        v = float(moment.velocity[joint])
        return -c * abs(v) * v

    return (Action(joint, force=force),)


def _asymmetric(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, ParameterValue]
) -> tuple[Action, ...]:
    up, down = float(values['level_pos']), float(values['level_neg'])
    return (Action(joint, dry_level=lambda _moment, direction: up if direction > 0 else down),)


def _load(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, ParameterValue]
) -> tuple[Action, ...]:
    level, mu = float(values['level']), float(values['mu'])
    return (
        Action(joint, dry_level=lambda m, _direction: level + mu * abs(float(m.drive[joint]))),
    )


VISCOUS_FRICTION = EffectKind(
    'viscous_friction', (EffectParameter('b', 'N m s/rad', low=0.0),), _viscous
)
"""`tau_x = -b v`."""

COULOMB_FRICTION = EffectKind(
    'coulomb_friction', (EffectParameter('level', 'N m', low=0.0),), _coulomb
)
"""`tau_x = -level sign(v)`, holding up to `level` at rest."""

STRIBECK_FRICTION = EffectKind(
    'stribeck_friction',
    (
        EffectParameter('coulomb', 'N m', low=0.0),
        EffectParameter('static', 'N m', low=0.0),
        EffectParameter('stribeck_velocity', 'rad/s', low=1e-9),
    ),
    _stribeck,
    ordered=('coulomb', 'static'),
)
"""`tau_x = -(coulomb + (static - coulomb) exp(-(v / stribeck_velocity)^2)) sign(v)`."""

QUADRATIC_DRAG = EffectKind(
    'quadratic_drag', (EffectParameter('c', 'N m s2/rad2', low=0.0),), _quadratic
)
"""`tau_x = -c |v| v`."""

ASYMMETRIC_COULOMB = EffectKind(
    'asymmetric_coulomb',
    (
        EffectParameter('level_pos', 'N m', low=0.0),
        EffectParameter('level_neg', 'N m', low=0.0),
    ),
    _asymmetric,
)
"""`tau_x = -level_pos` for `v > 0`, `level_neg` for `v < 0`."""

LOAD_FRICTION = EffectKind(
    'load_friction',
    (EffectParameter('level', 'N m', low=0.0), EffectParameter('mu', '', low=0.0)),
    _load,
    Place.MOTOR,
)
"""`tau_x = -(level + mu |force of the motor|) sign(v)`."""
