"""A second set of laws that no list has, written down before the search was changed again.

Forces over their size, as those of `unlisted`: of an own joint, of another joint, and two that
remember. `u` is the position in halves of the width of the motion, `w` the velocity in its usual
one. They are taken from what is built into machines, not from the shapes that the search knows;
some of these are among them, see `KNOWN_SHAPES`.
"""

from __future__ import annotations

import math

import numpy as np

from sgp_ros.simulation.effects import Action

LAG_S = 0.15
"""Time constant of a damper behind a spring [s]."""
HALF_PLAY = 0.25
"""Half the play of a spring, in halves of the width of the motion."""
_STEP_S = 1e-3
PARTS = 10
"""Parts of a step in which a memory is followed, the motion being joined by lines."""
_OPEN = 0.2
"""Least part of a chamber that a piston leaves."""


def _air_spring(q, _v, _m, p):
    return 1.0 - max(1.0 - 0.6 * q / p['reach'], _OPEN) ** -1.4


def _magnet(q, _v, _m, p):
    return 4.0 / max(q / p['reach'] + 2.0, _OPEN) ** 3


def _slack_spring(q, _v, _m, p):
    u = q / p['reach']
    return -1.5 * (u - min(max(u, -0.4), 0.4))


def _over_centre(q, _v, _m, p):
    angle = 1.5 * q / p['reach']
    return math.sin(angle) * (1.0 - 0.8 / math.sqrt(1.64 - 1.28 * math.cos(angle)))


def _bent_guide(q, v, _m, p):
    return -(1.0 + 0.6 * math.sin(2.0 * q / p['reach'])) * abs(v) * v / p['v'] ** 2


def _cross_speed(_q, v, m, p):
    return -v * float(m.velocity[p['source']]) / (p['v'] * p['source_v'])


def _spring_to_other(q, _v, m, p):
    return -0.5 * (q - float(m.position[p['source']])) ** 3


def _wind_of_other(_q, _v, m, p):
    other = float(m.velocity[p['source']]) / p['source_v']
    return -0.5 * abs(other) * other


def _power(_q, v, _m, p):
    return -math.copysign(abs(v / p['v']) ** 1.5, v)


def _remembered(_q, _v, m, p):
    return -float(m.state[0]) / (p['v'] if p['kind'] == 'lagged_damper' else p['reach'])


FAMILIES = {
    'one_way_damper': lambda _q, v, _m, p: -max(v, 0.0) / p['v'],
    'air_spring': _air_spring,
    'magnet': _magnet,
    'saturating_spring': lambda q, _v, _m, p: -math.tanh(2.0 * q / p['reach']),
    'slack_spring': _slack_spring,
    'over_centre': _over_centre,
    'bent_guide': _bent_guide,
    'power_drag': _power,
    'cross_speed_of_other': _cross_speed,
    'spring_to_other': _spring_to_other,
    'wind_of_other': _wind_of_other,
    'lagged_damper': _remembered,
    'play_spring': _remembered,
}
"""Name to force over its size."""
KNOWN_SHAPES = ('one_way_damper', 'saturating_spring', 'power_drag', 'wind_of_other')
"""Those that are one of the shapes that the search tries, times one of its factors."""
REMEMBER = {
    'lagged_damper': (lambda _q, v: v, lambda _q, v, z, _p: (v - z) / LAG_S),
    'play_spring': (
        lambda _q, _v: 0.0,
        lambda q, v, z, p: v if (q - z) * math.copysign(1.0, v) >= HALF_PLAY * p['reach'] else 0.0,
    ),
}
"""Those that remember to the start of the memory, and its rate."""


def remembering(start, rate, law):
    """Return what builds the action of a force with a memory of this start and rate."""

    def build(joint, p, _joints):
        def state(m):
            return float(m.position[joint]), float(m.velocity[joint])

        return (
            Action(
                joint,
                force=lambda m: p['a'] * law(*state(m), m, p),
                start=lambda q, v: (start(q, v),),
                state_rate=lambda m: (rate(*state(m), float(m.state[0]), p),),
                substep_s=_STEP_S,
            ),
        )  # fmt: skip

    return build


def memory_along(start, rate, q, v, step, p):
    """Return the memory (n,) along a motion of even steps [s], by the rate itself."""
    at, parts = np.arange(len(q)), np.arange((len(q) - 1) * PARTS + 1) / PARTS
    q, v = np.interp(parts, at, q), np.interp(parts, at, v)
    z = np.empty(len(q))
    z[0] = start(q[0], v[0])
    for i in range(1, len(q)):
        z[i] = z[i - 1] + step / PARTS * rate(q[i - 1], v[i - 1], z[i - 1], p)
    return z[::PARTS]
