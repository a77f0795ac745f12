"""A ninth set of laws that no list has, blind both ways.

It was written by someone who had not read the search, and who did not tell its author the families
before the first score. Forces over their size, with `u` and `w` of `second_families`, and those of
the source likewise; what a designer would choose is drawn with the world. Dry friction holds at
rest, as that of the list.
"""

from __future__ import annotations

import math

from sgp_proof.concealed.family_set import FamilySet, other_u, other_w
from sgp_ros.physics.catalogue import QUADRATIC_DRAG

_LEFT = 0.35
"""Least part of an overlap or a gap that is left."""
_REMANENT = 0.25
"""Least field of a series-wound motor, over that at rest."""


def _spring_yoke_with_slot(q, _v, _m, p):
    angle = p['turn'] * q / p['reach'] + p['phase']
    pin = math.sin(angle)
    return -3.0 * (pin - min(max(pin, -p['slot']), p['slot'])) * math.cos(angle)


def _roller_over_gap(q, _v, _m, p):
    x = (q / p['reach'] - p['at']) / p['half']
    return -1.5 * max(1.0 - abs(x), 0.0) * math.tanh(x / p['round'])


def _drum_behind_geneva_wheel(q, _v, _m, p):
    along = math.cos(p['turn'] * q / p['reach'] + p['phase'])
    return (
        -1.5 * p['pin'] * max(along - p['pin'], 0.0) / (1.0 + p['pin'] * (p['pin'] - 2.0 * along))
    )


def _foam_buffer(q, _v, _m, p):
    x = max(q / p['reach'] - p['begin'], 0.0)
    return -(1.0 - math.exp(-x / p['crush'])) - p['dense'] * x**4


def _steered_tyre(q, _v, _m, p):
    x = q / (p['slide'] * p['reach'])
    return -10.0 * x * max(1.0 - abs(x), 0.0) ** 3


def _drag_crisis(_q, v, _m, p):
    w = v / p['v']
    turbulent = 0.5 * (1.0 + math.tanh((abs(w) - p['crisis']) / p['over']))
    return -abs(w) * w * (1.0 - p['drop'] * turbulent)


def _series_wound_motor(_q, v, _m, p):
    return 0.3 / max(1.0 + v / (p['base'] * p['v']), _REMANENT) ** 2


def _mains_motor_left_on(_q, v, _m, p):
    slip = (p['synchronous'] - v / p['v']) / p['pull_out']
    return 2.0 * slip / (1.0 + slip * slip)


def _blade_through_stalk(q, v, _m, p):
    stalk = math.exp(-(((q / p['reach'] - p['at']) / p['thick']) ** 2))
    return -2.0 * max(math.tanh(v / (p['bite'] * p['v'])), 0.0) * stalk


def _stretch_reflex(q, v, _m, p):
    return -1.5 * max(q / p['reach'] - p['at'] + p['lead'] * v / p['v'], 0.0)


def _plate_onto_oil_film(q, v, _m, p):
    gap = max(p['gap'] - q / p['reach'], _LEFT)
    return -max(v, 0.0) / p['v'] / gap**3


def _pump_on_crank(q, v, _m, p):
    arm = math.sin(p['turn'] * q / p['reach'] + p['phase'])
    return -1.5 * arm * max(math.tanh(arm * v / (p['open'] * p['v'])), 0.0)


def _drawn_out_telescope(q, _v, _m, p):
    out = min(max(0.5 * p['drawn'] * (1.0 + q / p['reach']), 0.0), 1.0 - _LEFT)
    return out / (1.0 - out)


def _leaking_tappet(q, _v, m, p):
    return -3.0 * max((q - float(m.state[0])) / p['reach'] - p['lash'], 0.0)


def _governor_behind_dashpot(_q, v, m, p):
    return -2.0 * max(float(m.state[0]) / p['v'] - p['grip'], 0.0) * v / p['v']


def _sump_filling_slowly(_q, v, m, p):
    return -2.5 * max(float(m.state[0]) / p['reach'] - p['level'], 0.0) * v / p['v']


def _magnetic_gear_to_other(q, _v, m, p):
    return -math.sin(p['poles'] * q / p['reach'] - p['others'] * other_u(m, p) + p['phase'])


def _stop_ring_with_other(q, _v, m, p):
    u, across = q / p['reach'], p['ratio'] * other_u(m, p)
    return -3.0 * u * (1.0 - p['ring'] / max(math.hypot(u, across), p['ring']))


def _rubbing_on_table_with_other(_q, v, m, p):
    w = v / p['v']
    return -1.2 * w / math.hypot(w, p['ratio'] * other_w(m, p), p['creep'])


def _swash_plate_of_other(_q, _v, m, p):
    return 1.5 * abs(math.sin(p['set'] + p['swing'] * other_u(m, p)))


_SMOOTH = {
    'spring_yoke_with_slot': _spring_yoke_with_slot,
    'roller_over_gap': _roller_over_gap,
    'drum_behind_geneva_wheel': _drum_behind_geneva_wheel,
    'foam_buffer': _foam_buffer,
    'steered_tyre': _steered_tyre,
    'drag_crisis': _drag_crisis,
    'series_wound_motor': _series_wound_motor,
    'mains_motor_left_on': _mains_motor_left_on,
    'blade_through_stalk': _blade_through_stalk,
    'stretch_reflex': _stretch_reflex,
    'plate_onto_oil_film': _plate_onto_oil_film,
    'pump_on_crank': _pump_on_crank,
    'leaking_tappet': _leaking_tappet,
    'governor_behind_dashpot': _governor_behind_dashpot,
    'sump_filling_slowly': _sump_filling_slowly,
    'magnetic_gear_to_other': _magnetic_gear_to_other,
    'stop_ring_with_other': _stop_ring_with_other,
    'rubbing_on_table_with_other': _rubbing_on_table_with_other,
}
_DRY = {
    'drawn_out_telescope': _drawn_out_telescope,
    'swash_plate_of_other': _swash_plate_of_other,
}
"""Name to level of dry friction over the size of the force."""
_DRAWN = {
    'spring_yoke_with_slot': {'turn': (1.5, 2.5), 'phase': (-1.0, 1.0), 'slot': (0.2, 0.45)},
    'roller_over_gap': {'at': (-0.3, 0.3), 'half': (0.5, 0.8), 'round': (0.05, 0.15)},
    'drum_behind_geneva_wheel': {'turn': (2.0, 3.5), 'phase': (-0.8, 0.8), 'pin': (0.4, 0.7)},
    'foam_buffer': {'begin': (-0.2, 0.2), 'crush': (0.05, 0.12), 'dense': (0.2, 0.4)},
    'steered_tyre': {'slide': (0.7, 1.2)},
    'drag_crisis': {'crisis': (0.8, 1.1), 'drop': (0.75, 0.85), 'over': (0.05, 0.12)},
    'series_wound_motor': {'base': (1.4, 2.0)},
    'mains_motor_left_on': {'synchronous': (0.6, 1.2), 'pull_out': (0.3, 0.6)},
    'blade_through_stalk': {'at': (-0.3, 0.3), 'thick': (0.3, 0.6), 'bite': (0.15, 0.3)},
    'stretch_reflex': {'at': (-0.2, 0.4), 'lead': (0.3, 0.8)},
    'plate_onto_oil_film': {'gap': (1.3, 1.7)},
    'pump_on_crank': {'turn': (1.5, 3.0), 'phase': (-1.5, 1.5), 'open': (0.1, 0.25)},
    'drawn_out_telescope': {'drawn': (0.6, 0.75)},
    'leaking_tappet': {'lash': (0.05, 0.25), 'leak_s': (0.3, 0.8)},
    'governor_behind_dashpot': {'grip': (0.4, 0.8), 'follow_s': (0.2, 0.6)},
    'sump_filling_slowly': {'level': (-0.3, 0.1), 'run_s': (0.3, 0.8)},
    'magnetic_gear_to_other': {'poles': (2.0, 4.0), 'others': (1.5, 3.0), 'phase': (-1.5, 1.5)},
    'stop_ring_with_other': {'ratio': (0.7, 1.2), 'ring': (0.4, 0.7)},
    'rubbing_on_table_with_other': {'ratio': (1.2, 2.0), 'creep': (0.05, 0.15)},
    'swash_plate_of_other': {'set': (-0.4, 0.4), 'swing': (1.0, 1.6)},
}
"""Name to the ranges of its constants."""


SET = FamilySet(_SMOOTH, _DRY, _DRAWN)
FAMILIES = SET.families
"""Name to force over its size."""
REMEMBER = {
    'leaking_tappet': (lambda q, _v: q, lambda q, _v, z, p: (q - z) / p['leak_s']),
    'governor_behind_dashpot': (
        lambda _q, v: abs(v),
        lambda _q, v, z, p: (abs(v) - z) / p['follow_s'],
    ),
    'sump_filling_slowly': (lambda q, _v: q, lambda q, _v, z, p: (q - z) / p['run_s']),
}
"""Those that remember to the start of the memory, and its rate."""
LISTED_PARTS = {'drag_crisis': QUADRATIC_DRAG.name}
"""A law that contains an effect of the list may be named as that effect beside the rest."""
