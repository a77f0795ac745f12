"""A fourth set of laws that no list has, blind both ways.

It was written by someone who had not read the search, and who did not tell its author the families
before the first score. Forces over their size, with `u` and `w` of `second_families`, and those of
the source likewise; what a designer would choose is drawn with the world. Dry friction holds at
rest, as that of the list.
"""

from __future__ import annotations

import math

from sgp_proof.concealed.family_set import FamilySet, other_u, other_w
from sgp_ros.physics.catalogue import (
    COULOMB_FRICTION,
    QUADRATIC_DRAG,
    SPRING,
    VISCOUS_FRICTION,
)

_STEEPEST = 1.1
"""Angle at which a lever has left its slide [rad]."""
_EDGE = 0.2
"""Part of a groove's height in which a ball changes its flank."""
_LIFT_WIDTH = 0.2
"""Speed over which a bearing is lifted by its film, as `w`."""
_SHORTEST = 0.3
"""Least free length of a leaf whose pivot is moved, over the usual one."""


def _lever_on_slide(q, _v, _m, p):
    angle = min(max(p['swing'] * q / p['reach'], -_STEEPEST), _STEEPEST)
    return -math.tan(angle) / math.cos(angle) ** 2


def _lifted_chain(q, _v, _m, p):
    return -1.5 * min(max((q / p['reach'] - p['floor']) / p['length'], 0.0), 1.0)


def _star_wheel(q, _v, _m, p):
    angle = p['grooves'] * q / p['reach'] + p['phase']
    return -math.cos(angle) * math.tanh(math.sin(angle) / _EDGE)


def _leaf_catch(q, _v, _m, p):
    x = max((q / p['reach'] - p['begin']) / p['bend'], 0.0)
    return -1.5 * x * math.exp(1.0 - x)


def _flow_valve(_q, v, _m, p):
    w = v / p['v']
    return -(1.0 if w > 0.0 else p['back']) * abs(w) * w


def _critical_speed(_q, v, _m, p):
    r = v / (p['critical'] * p['v'])
    twice = 2.0 * p['damping'] * r
    return -1.5 * (2.0 * p['damping']) ** 2 * r**5 / ((1.0 - r * r) ** 2 + twice * twice)


def _foil_bearing(_q, v, _m, p):
    lifted = 0.5 * (1.0 + math.tanh((abs(v) / p['v'] - p['lift']) / _LIFT_WIDTH))
    return 1.0 - (1.0 - p['film']) * lifted


def _running_belt(_q, v, _m, p):
    return math.tanh((p['belt'] - v / p['v']) / p['grip'])


def _end_cushion(q, v, _m, p):
    return -3.0 * max(q / p['reach'] - p['begin'], 0.0) * max(v, 0.0) / p['v']


def _shorted_winding(q, v, _m, p):
    return -1.5 * math.sin(p['poles'] * q / p['reach'] + p['phase']) ** 2 * v / p['v']


def _warming_grease(_q, v, m, p):
    return -2.0 * v / p['v'] * math.exp(-p['heat'] * float(m.state[0]) / p['v'] ** 2)


def _preload_behind_play(_q, _v, m, p):
    return -math.tanh(float(m.state[0]) / (p['knee'] * p['reach']))


def _leaf_set_by_other(q, _v, m, p):
    free = max(1.0 - p['lever'] * other_u(m, p), _SHORTEST)
    return -q / p['reach'] / free**2


def _brake_lever_of_other(_q, _v, m, p):
    return 1.5 * min(max((other_u(m, p) - p['begin']) / p['over'], 0.0), 1.0)


def _fluid_coupling_to_other(_q, v, m, p):
    slip = v / p['v'] - p['ratio'] * other_w(m, p)
    return -0.5 * abs(slip) * slip


def _passing_magnet_of_other(_q, _v, m, p):
    return 1.5 * math.exp(-(((other_u(m, p) - p['at']) / p['width']) ** 2))


def _slack_tendon_over_other(q, _v, m, p):
    return -2.0 * max(q / p['reach'] + p['ratio'] * other_u(m, p) - p['slack'], 0.0)


def _hose_over_other(q, _v, m, p):
    return (q / p['reach'] + p['ratio'] * other_u(m, p)) ** 2


def _strut(q, v, _m, p):
    w, rubber = v / p['v'], max(q / p['reach'] - p['begin'], 0.0)
    return -1.5 * rubber**2 - (1.5 * w / (1.0 + w / p['open']) if w > 0.0 else p['back'] * w)


_SMOOTH = {
    'lever_on_slide': _lever_on_slide,
    'lifted_chain': _lifted_chain,
    'star_wheel': _star_wheel,
    'leaf_catch': _leaf_catch,
    'flow_valve': _flow_valve,
    'critical_speed': _critical_speed,
    'running_belt': _running_belt,
    'end_cushion': _end_cushion,
    'leaf_pack': lambda q, _v, _m, p: -q / p['reach'],
    'shorted_winding': _shorted_winding,
    'warming_grease': _warming_grease,
    'preload_behind_play': _preload_behind_play,
    'leaf_set_by_other': _leaf_set_by_other,
    'fluid_coupling_to_other': _fluid_coupling_to_other,
    'passing_magnet_of_other': _passing_magnet_of_other,
    'slack_tendon_over_other': _slack_tendon_over_other,
    'strut_with_bump_rubber': _strut,
}
_DRY = {
    'foil_bearing': _foil_bearing,
    'leaf_pack': lambda q, _v, _m, p: p['rub'] * abs(q) / p['reach'],
    'brake_lever_of_other': _brake_lever_of_other,
    'hose_over_other': _hose_over_other,
}
"""Name to level of dry friction over the size of the force."""
_DRAWN = {
    'lever_on_slide': {'swing': (0.8, 1.0)},
    'lifted_chain': {'floor': (-0.5, 0.0), 'length': (0.5, 0.9)},
    'star_wheel': {'grooves': (3.0, 6.0), 'phase': (-1.5, 1.5)},
    'leaf_catch': {'begin': (-0.6, 0.0), 'bend': (0.2, 0.4)},
    'flow_valve': {'back': (0.1, 0.35)},
    'critical_speed': {'critical': (0.7, 1.2), 'damping': (0.2, 0.35)},
    'foil_bearing': {'lift': (0.5, 1.0), 'film': (0.15, 0.35)},
    'running_belt': {'belt': (0.5, 1.0), 'grip': (0.15, 0.35)},
    'end_cushion': {'begin': (0.0, 0.4)},
    'leaf_pack': {'rub': (0.3, 0.6)},
    'shorted_winding': {'poles': (1.5, 3.0), 'phase': (0.0, 3.0)},
    'warming_grease': {'heat': (0.6, 1.2), 'warm_s': (1.0, 3.0)},
    'preload_behind_play': {'slack': (0.15, 0.35), 'knee': (0.2, 0.4)},
    'leaf_set_by_other': {'lever': (0.35, 0.6)},
    'brake_lever_of_other': {'begin': (-0.4, 0.2), 'over': (0.4, 0.8)},
    'fluid_coupling_to_other': {'ratio': (0.5, 1.0)},
    'passing_magnet_of_other': {'at': (-0.4, 0.4), 'width': (0.3, 0.6)},
    'slack_tendon_over_other': {'ratio': (0.5, 1.0), 'slack': (0.0, 0.4)},
    'hose_over_other': {'ratio': (0.5, 1.0)},
    'strut_with_bump_rubber': {'begin': (-0.6, 0.0), 'open': (0.4, 0.8), 'back': (0.2, 0.4)},
}
"""Name to the ranges of its constants."""


def _slipped(q, v, z, p):
    """Return the rate of the far side of a play."""
    return v if (q - z) * math.copysign(1.0, v) >= p['slack'] * p['reach'] else 0.0


SET = FamilySet(_SMOOTH, _DRY, _DRAWN)
FAMILIES = SET.families
"""Name to force over its size."""
REMEMBER = {
    'warming_grease': (lambda _q, v: v * v, lambda _q, v, z, p: (v * v - z) / p['warm_s']),
    'preload_behind_play': (lambda q, _v: q, _slipped),
}
"""Those that remember to the start of the memory, and its rate."""
LISTED_PARTS = {
    'flow_valve': QUADRATIC_DRAG.name,
    'foil_bearing': COULOMB_FRICTION.name,
    'leaf_pack': SPRING.name,
    'shorted_winding': VISCOUS_FRICTION.name,
    'leaf_set_by_other': SPRING.name,
}
"""A law that contains an effect of the list may be named as that effect beside the rest."""
