"""Kinds of friction that can be added to a joint."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from sgp_ros.simulation.effects import Action, EffectKind, EffectParameter

if TYPE_CHECKING:
    from collections.abc import Mapping

    from sgp_ros.simulation.effects import Moment, ParameterValue
    from sgp_ros.simulation.mechanism import SimulatedJoint


def _viscous(
    joint: int, _description: SimulatedJoint, values: Mapping[str, ParameterValue]
) -> Action:
    b = float(values['b'])
    return Action(joint, force=lambda moment: -b * float(moment.velocity[joint]))


def _coulomb(
    joint: int, _description: SimulatedJoint, values: Mapping[str, ParameterValue]
) -> Action:
    level = float(values['level'])
    return Action(joint, dry_level=lambda _moment, _direction: level)


def _position(
    joint: int, description: SimulatedJoint, values: Mapping[str, ParameterValue]
) -> Action:
    amplitude, lo, hi = (float(values[name]) for name in ('amplitude', 'lo', 'hi'))

    def strength(moment: Moment) -> float:
        q = float(moment.position[joint])
        if description.is_continuous:
            q = (q + math.pi) % (2.0 * math.pi) - math.pi
        return amplitude if lo <= q <= hi else 0.0

    if values['kind'] == 'viscous':
        return Action(joint, force=lambda m: -strength(m) * float(m.velocity[joint]))
    return Action(joint, dry_level=lambda moment, _direction: strength(moment))


VISCOUS_FRICTION = EffectKind(
    'viscous_friction', (EffectParameter('b', 'N m s/rad', low=0.0),), _viscous
)
"""`tau_x = -b v`."""

COULOMB_FRICTION = EffectKind(
    'coulomb_friction', (EffectParameter('level', 'N m', low=0.0),), _coulomb
)
"""`tau_x = -level sign(v)`, holding up to `level` at rest."""

POSITION_FRICTION = EffectKind(
    'position_friction',
    (
        EffectParameter('amplitude', 'N m', low=0.0, unit_by_kind={'viscous': 'N m s/rad'}),
        EffectParameter('lo', 'rad'),
        EffectParameter('hi', 'rad'),
        EffectParameter('kind', choices=('coulomb', 'viscous')),
    ),
    _position,
    ordered=('lo', 'hi'),
)
"""Coulomb or viscous friction where `lo <= q <= hi`, on every turn of a continuous joint."""
