"""Which effects are concealed: their parameters as a function of one size."""

from __future__ import annotations

import math

import numpy as np

from sgp_proof.concealed.concealed_effect import Concealed, UnsuitableError
from sgp_proof.concealed.unknown import UNKNOWN
from sgp_ros.physics.catalogue import EFFECTS

_STEEPEST = 0.8
"""Greatest slope of an encoder's error: an encoder does not turn back."""


def draw_effect(rng, name, bodies, motion, is_hard):
    """Return an effect of this name on a random joint that can have it."""
    motors = [i for i, b in enumerate(bodies) if b.is_driven]
    everywhere = list(range(len(bodies)))
    place = 'JOINT' if name == 'unknown' else EFFECTS[name].site.name
    joint = int(rng.choice(motors if place == 'MOTOR' else everywhere))
    if name in _SPECIAL:
        return _SPECIAL[name](rng, bodies, motion, motors, joint, is_hard)
    return _on_joint(rng, name, bodies, motion, joint)


def _on_joint(rng, name, bodies, motion, j):
    force, v, a = motion.effort[j], motion.velocity[j], motion.acceleration[j]
    small, reach = 0.3 * force, motion.high[j] - motion.low[j]
    ratio, sign, phase = rng.uniform(0.2, 0.6), rng.choice([-1.0, 1.0]), rng.uniform(-3.0, 3.0)
    kind = str(rng.choice(['coulomb', 'viscous']))
    unit = 1.0 if kind == 'coulomb' else v
    is_linear = bodies[j].is_prismatic
    periods = float(rng.integers(8, 40) if is_linear else rng.integers(3, 16))
    turns = float(rng.integers(2, 8) if is_linear else rng.integers(1, 4))
    rest = rng.uniform(motion.low[j], motion.high[j])
    slow, presliding = rng.uniform(0.1, 0.5) * v, rng.uniform(0.03, 0.15) * reach
    tau, mean = rng.uniform(5.0, 14.0), rng.uniform(1.5, 3.0)
    swap = rng.random() < 0.5
    table = {
        'viscous_friction': (small / v, lambda s: {'b': s}),
        'coulomb_friction': (small, lambda s: {'level': s}),
        'stribeck_friction': (
            small,
            lambda s: {'coulomb': s, 'static': s * mean, 'stribeck_velocity': slow},
        ),
        'quadratic_drag': (small / v**2, lambda s: {'c': s}),
        'asymmetric_coulomb': (
            small,
            lambda s: {'level_pos': s * (ratio if swap else 1.0),
                       'level_neg': s * (1.0 if swap else ratio)},
        ),
        'spring': (small / motion.spread[j], lambda s: {'stiffness': s, 'rest': rest}),
        'constant_load': (small, lambda s: {'force': sign * s}),
        'cogging': (small, lambda s: {'amplitude': s, 'periods': periods, 'phase': phase}),
        'hysteresis': (small, lambda s: {'level': s, 'presliding': presliding}),
        'armature': (small / a, lambda s: {'inertia': s}),
        'friction_drift': (
            small / unit,
            lambda s: {'start': s * (ratio if swap else 1.0), 'end': s * (1.0 if swap else ratio),
                       'time_constant': tau, 'kind': kind},
        ),
        'load_friction': (0.2, lambda s: {'level': 0.05 * s * force, 'mu': s}),
        'torque_gain': (0.25, lambda s: {'gain': 1.0 + sign * s}),
        'dead_zone': (0.3 * force, lambda s: {'width': s}),
        'actuator_lag': (0.02, lambda s: {'time_constant': max(s, 1e-3)}),
        'encoder_eccentricity': (
            0.01 * reach / turns,
            lambda s: {'amplitude': s, 'periods': turns, 'phase': phase},
        ),
        'velocity_filter_lag': (0.02, lambda s: {'time_constant': max(s, 1e-3)}),
    }  # fmt: skip
    size, values = table[name]
    turn = 2.0 * math.pi * turns if is_linear else turns
    largest = {
        'torque_gain': 0.6, 'actuator_lag': 0.08, 'velocity_filter_lag': 0.06,
        'encoder_eccentricity': _STEEPEST / turn,
    }  # fmt: skip
    return Concealed(name, bodies[j].joint, j, values, size, largest=largest.get(name, math.inf))


def _position_friction(rng, bodies, motion, _motors, j, is_hard):
    kind = str(rng.choice(['coulomb', 'viscous']))
    low, high = motion.low[j], motion.high[j]
    if bodies[j].kind == 'continuous' and max(-low, high) > math.pi:
        low, high = -3.0, 3.0
    width = rng.uniform(0.08, 0.2) * (high - low)
    wanted = (0.02, 0.08) if is_hard and rng.random() < 0.5 else (0.06, 0.4)
    for _ in range(50):
        lo = rng.uniform(low, high - width)
        share = float(
            np.mean((motion.positions[:, j] > lo) & (motion.positions[:, j] < lo + width))
        )
        if wanted[0] <= share <= wanted[1]:
            break
    else:
        raise UnsuitableError('position_friction')
    size = motion.effort[j] * 0.6 / (1.0 if kind == 'coulomb' else motion.velocity[j])

    def values(s):
        return {'amplitude': s, 'lo': lo, 'hi': lo + width, 'kind': kind, 'edge': 0.05 * width}

    where = {'position': [[lo, lo + width]]}
    place = {'joint': bodies[j].joint, 'variables': ['position'], 'intervals': where}
    return Concealed('position_friction', bodies[j].joint, j, values, size, location=place)


def _limit_friction(rng, bodies, motion, _motors, _j, _is_hard):
    able = [i for i, b in enumerate(bodies) if b.kind != 'continuous']
    if not able:
        raise UnsuitableError('limit_friction')
    j = int(rng.choice(able))
    side = rng.choice([-1.0, 1.0])
    end = motion.high[j] if side > 0 else -motion.low[j]
    onset = side * rng.uniform(0.2, 0.6) * min(end, bodies[j].limit)
    if end <= 0.1 * bodies[j].limit:
        raise UnsuitableError('limit_friction')
    return Concealed(
        'limit_friction', bodies[j].joint, j,
        lambda s: {'amplitude': s, 'onset': onset}, 2.0 * motion.effort[j],
    )  # fmt: skip


def _end_stop(rng, bodies, motion, _motors, j, _is_hard):
    side = rng.choice([-1.0, 1.0])
    end = motion.high[j] if side > 0 else -motion.low[j]
    if end <= 0.3 * motion.spread[j] or (bodies[j].kind == 'continuous' and end > 6.0):
        raise UnsuitableError('end_stop')
    position = side * rng.uniform(0.5, 0.85) * end
    share, reach = rng.uniform(0.005, 0.03), motion.high[j] - motion.low[j]
    return Concealed(
        'end_stop', bodies[j].joint, j,
        lambda s: {'position': position, 'stiffness': s, 'damping': share * s},
        8.0 * motion.effort[j] / reach, power=1.0, largest=400.0 * motion.effort[j] / reach,
    )  # fmt: skip


def _saturation(_rng, bodies, motion, _motors, j, _is_hard):
    force = motion.effort[j]
    return Concealed(
        'saturation', bodies[j].joint, j, lambda s: {'limit': force / s}, 0.7, 5.0, 2.0
    )


def _delay(rng, bodies, _motion, motors, j, _is_hard):
    joint = 'all' if len(motors) > 1 and rng.random() < 0.3 else bodies[j].joint
    return Concealed(
        'command_delay', joint, j, lambda s: {'delay': round(s, 4)}, 0.015, largest=0.06
    )


def _backlash(rng, bodies, motion, motors, _j, _is_hard):
    leaves = [i for i in motors if not any(b.parent == i for b in bodies)]
    if not leaves:
        raise UnsuitableError('backlash')
    j = int(rng.choice(leaves))
    body, axis = bodies[j], np.array(bodies[j].axis)
    own = body.mass if body.is_prismatic else axis @ body.inertia @ axis
    motor = rng.uniform(0.2, 0.5) * own
    reach = motion.high[j] - motion.low[j]
    return Concealed(
        'backlash', body.joint, j, lambda s: {'gap': s, 'motor_inertia': motor},
        0.01 * reach, power=1.0, largest=0.05 * reach,
    )  # fmt: skip


def _coupling(rng, bodies, motion, motors, _j, _is_hard):
    if len(bodies) < 2:
        raise UnsuitableError('joint_coupling')
    kind = 'torque' if len(motors) > 1 and rng.random() < 0.5 else 'spring'
    j = int(rng.choice(motors if kind == 'torque' else len(bodies)))
    others = [i for i in (motors if kind == 'torque' else range(len(bodies))) if i != j]
    source = int(rng.choice(others))
    name, size = bodies[source].joint, 0.3 * motion.effort[j]
    if kind == 'torque':
        sign = rng.choice([-1.0, 1.0])
        return Concealed(
            'joint_coupling', bodies[j].joint, j,
            lambda s: {'source_joint': name, 'kind': kind, 'coefficient': sign * s},
            size / motion.effort[source], largest=1.0,
        )  # fmt: skip
    ratio = rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 1.5)
    ratio *= motion.spread[j] / motion.spread[source]
    return Concealed(
        'joint_coupling', bodies[j].joint, j,
        lambda s: {'source_joint': name, 'kind': kind, 'stiffness': s, 'ratio': ratio},
        size / motion.spread[j],
    )  # fmt: skip


def _tilt(rng, bodies, _motion, _motors, _j, _is_hard):
    if len(bodies) < 2:
        raise UnsuitableError('gravity_tilt')
    angle = rng.uniform(0.0, 2.0 * math.pi)
    return Concealed(
        'gravity_tilt', 'base', -1,
        lambda s: {'roll': s * math.cos(angle), 'pitch': s * math.sin(angle)}, 0.08, largest=0.3,
    )  # fmt: skip


def _payload(_rng, bodies, _motion, _motors, _j, _is_hard):
    last = bodies[-1]
    where = dict(zip('xyz', (float(x) for x in last.tip), strict=True))
    return Concealed(
        'payload', last.joint, len(bodies) - 1, lambda s: {'mass': s, **where},
        0.2 * last.mass, largest=1.5 * last.mass,
    )  # fmt: skip


def _tip_force(rng, bodies, motion, _motors, _j, _is_hard):
    if len(bodies) < 2:
        raise UnsuitableError('tip_force')
    axis = rng.normal(size=3)
    axis = axis / np.linalg.norm(axis)
    return Concealed(
        'tip_force', 'tool', -1,
        lambda s: dict(zip(('fx', 'fy', 'fz'), (float(s * x) for x in axis), strict=True)),
        0.5 * float(np.median(motion.effort)),
    )  # fmt: skip


def _unknown(rng, bodies, motion, motors, j, _is_hard):
    kind = str(rng.choice(list(UNKNOWN)))
    if kind == 'position_gain':
        j = int(rng.choice(motors))
    others = [i for i in range(len(bodies)) if i != j]
    if kind in {'other_velocity', 'other_position_gain'} and not others:
        kind = 'sine_friction'
    force, v = motion.effort[j], motion.velocity[j]
    start = rng.uniform(4.0, 18.0)
    fixed = {
        'kind': kind, 'v': v, 'reach': 0.5 * (motion.high[j] - motion.low[j]),
        'start': start, 'end': start + rng.uniform(3.0, 9.0), 'hz': rng.uniform(0.4, 2.0),
        'source': int(rng.choice(others)) if others else -1,
        'source_v': float(motion.velocity[others].mean()) if others else 1.0,
    }  # fmt: skip
    place = {}
    if kind == 'burst':
        place = {
            'joint': bodies[j].joint, 'variables': ['time'],
            'time': [[fixed['start'], fixed['end']]],
        }  # fmt: skip
    size = 0.3 if kind == 'position_gain' else 0.4 * force
    return Concealed(
        'unknown', bodies[j].joint, j, lambda s: {**fixed, 'a': s}, size, location=place
    )


_SPECIAL = {
    'position_friction': _position_friction, 'limit_friction': _limit_friction,
    'end_stop': _end_stop, 'saturation': _saturation, 'command_delay': _delay,
    'backlash': _backlash, 'joint_coupling': _coupling, 'gravity_tilt': _tilt,
    'payload': _payload, 'tip_force': _tip_force, 'unknown': _unknown,
}  # fmt: skip
