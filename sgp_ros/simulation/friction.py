"""Laws of friction: of speed and load, then of position, time and the path travelled."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from sgp_ros.errors import ConfigError
from sgp_ros.physics.parts import Value
from sgp_ros.simulation.effects import Action, Moment, side_of, source_of
from sgp_ros.simulation.mechanism import SimulatedJoint


def viscous(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, Value]
) -> tuple[Action, ...]:
    """Return `tau_x = -b v`."""
    b = float(values['b'])
    return (Action(joint, force=lambda moment: -b * float(moment.velocity[joint])),)


def coulomb(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, Value]
) -> tuple[Action, ...]:
    """Return `tau_x = -level sign(v)`, holding up to `level` at rest."""
    level = float(values['level'])
    return (Action(joint, dry_level=lambda _moment, _direction: level),)


def stribeck(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, Value]
) -> tuple[Action, ...]:
    """Return `tau_x = -(coulomb + (static - coulomb) exp(-(v / stribeck_velocity)^2)) sign(v)`."""
    coulomb, static = float(values['coulomb']), float(values['static'])
    scale = float(values['stribeck_velocity'])

    def level(moment: Moment, _direction: int) -> float:
        ratio = float(moment.velocity[joint]) / scale
        return coulomb + (static - coulomb) * math.exp(-ratio * ratio)

    return (Action(joint, dry_level=level),)


def quadratic(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, Value]
) -> tuple[Action, ...]:
    """Return `tau_x = -c |v| v`."""
    c = float(values['c'])

    def force(moment: Moment) -> float:
        v = float(moment.velocity[joint])
        return -c * abs(v) * v

    return (Action(joint, force=force),)


def asymmetric(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, Value]
) -> tuple[Action, ...]:
    """Return `-level_pos` for `v > 0`, `level_neg` for `v < 0`."""
    up, down = float(values['level_pos']), float(values['level_neg'])
    return (Action(joint, dry_level=lambda _moment, direction: up if direction > 0 else down),)


def load(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, Value]
) -> tuple[Action, ...]:
    """Return `tau_x = -(level + mu |force of the motor|) sign(v)`."""
    level, mu = float(values['level']), float(values['mu'])
    return (
        Action(joint, dry_level=lambda m, _direction: level + mu * abs(float(m.drive[joint]))),
    )


_STIFF_S = 1e-3
_MOST_DECAY = 2.0
"""Of a memory within a step: Runge and Kutta are stable up to 2.7."""


def _of_kind(joint: int, kind: Value, strength: Callable[[Moment], float]) -> tuple[Action, ...]:
    """Return viscous or Coulomb friction of a strength that changes."""
    if kind == 'viscous':
        return (Action(joint, force=lambda m: -strength(m) * float(m.velocity[joint])),)
    return (Action(joint, dry_level=lambda moment, _direction: strength(moment)),)


def position(
    joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, Value]
) -> tuple[Action, ...]:
    """Return friction where `lo <= q <= hi`, on every turn, rising over the length `edge`."""
    amplitude, lo, hi = (float(values[name]) for name in ('amplitude', 'lo', 'hi'))
    is_continuous, edge = joints[joint].is_continuous, float(values['edge'])
    centre = 0.5 * (lo + hi)

    def strength(moment: Moment) -> float:
        q = float(moment.position[joint])
        if is_continuous:  # the turn about the interval, which may cross the wrap
            q = (q - centre + math.pi) % (2.0 * math.pi) - math.pi + centre
        if edge == 0.0:
            return amplitude if lo <= q <= hi else 0.0
        inside = min(q - lo, hi - q) / edge + 0.5
        return amplitude * min(max(inside, 0.0), 1.0)

    return _of_kind(joint, values['kind'], strength)


def limit(
    joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, Value]
) -> tuple[Action, ...]:
    """Return dry friction that rises from 0 at `onset` to `amplitude` at the limit `side`."""
    amplitude, onset = float(values['amplitude']), float(values['onset'])
    description = joints[joint]
    side = side_of(description, onset, values['side'])
    limit = description.upper if side > 0 else description.lower
    if not math.isfinite(limit) or side * (limit - onset) <= 0.0:
        raise ConfigError(
            f'limit_friction with onset {onset:g} on joint {description.name!r}',
            f'a joint with limits and an onset between them, here {description.lower:g} and '
            f'{description.upper:g}',
        )

    def level(moment: Moment, _direction: int) -> float:
        return amplitude * max((float(moment.position[joint]) - onset) / (limit - onset), 0.0)

    return (Action(joint, dry_level=level),)


def drift(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, Value]
) -> tuple[Action, ...]:
    """Return friction of the strength `end + (start - end) exp(-t / time_constant)`."""
    start, end = float(values['start']), float(values['end'])
    time_constant = float(values['time_constant'])

    def strength(moment: Moment) -> float:
        return end + (start - end) * math.exp(-moment.time_s / time_constant)

    return _of_kind(joint, values['kind'], strength)


def hysteresis(
    _joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, Value]
) -> tuple[Action, ...]:
    """Return `tau_x = -level z` with `dz/dt = (v - |v| z) / presliding` (Dahl 1968)."""
    level, presliding = float(values['level']), float(values['presliding'])
    fastest = _MOST_DECAY * presliding / _STIFF_S

    def rate(moment: Moment) -> tuple[float]:
        v, z = float(moment.velocity[joint]), float(moment.state[0])
        v = min(max(v, -fastest), fastest)
        return ((v - abs(v) * z) / presliding,)

    return (
        Action(
            joint,
            force=lambda moment: -level * float(moment.state[0]),
            start=lambda _q, _v: (0.0,),
            state_rate=rate,
            substep_s=_STIFF_S,
        ),
    )


def coupled(
    joints: tuple[SimulatedJoint, ...], joint: int, values: Mapping[str, Value]
) -> tuple[Action, ...]:
    """Return friction of a motor that turns with `w = v + ratio v_source`, on both joints."""
    source, ratio = source_of(joints, joint, values, 'coupled_friction'), float(values['ratio'])
    coulomb, viscous = float(values['coulomb']), float(values['viscous'])

    def drag(moment: Moment) -> float:
        return -viscous * float(moment.velocity[joint] + ratio * moment.velocity[source])

    return (
        Action(
            joint, force=drag, dry_level=lambda _moment, _direction: coulomb,
            geared=(source, ratio),
        ),
        Action(source, force=lambda moment: ratio * drag(moment)),
    )  # fmt: skip
