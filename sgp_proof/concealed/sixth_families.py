"""A sixth set of laws that no list has, blind both ways.

It was written by someone who had not read the search, and who did not tell its author the families
before the first score. Forces over their size, with `u` and `w` of `second_families`, and those of
the source likewise; what a designer would choose is drawn with the world. Dry friction holds at
rest, as that of the list.
"""

from __future__ import annotations

import math

from sgp_proof.concealed.family_set import FamilySet, other_u, other_w


def _rim_magnet(q, _v, _m, p):
    angle = p['turn'] * q / p['reach'] + p['phase']
    return -0.6 * math.sin(angle) / (p['apart'] - math.cos(angle)) ** 1.5


def _current_in_one_phase(q, _v, _m, p):
    field = p['steep'] * math.sin(p['poles'] * q / p['reach'] + p['phase'])
    return -min(max(field, -1.0), 1.0)


def _progressive_thread(q, _v, _m, p):
    u = q / p['reach']
    return -math.sin(p['turn'] * u + p['pitch'] * u * u + p['phase'])


def _blade_past_jet(q, _v, _m, p):
    return 1.5 * max(1.0 - abs(q / p['reach'] - p['at']) / p['width'], 0.0)


def _plate_before_jet(_q, v, _m, p):
    return 0.7 * max(p['jet'] - v / p['v'], 0.0) ** 2


def _solenoid_on_rectifier(_q, v, _m, p):
    return -0.8 * max(abs(v) / p['v'] - p['drop'], 0.0) ** 2


def _ejector(_q, v, _m, p):
    return -1.5 * (1.0 - math.exp(-abs(v) / (p['knee'] * p['v'])))


def _cold_end_of_guide(q, v, _m, p):
    return -0.8 * v / p['v'] * math.exp(p['cold'] * q / p['reach'])


def _shielded_poles(q, v, _m, p):
    angle = p['poles'] * q / p['reach'] + p['phase']
    return -1.8 * math.sin(angle) / (1.0 + (v / (p['shield'] * p['v'])) ** 2)


def _late_poles(q, v, _m, p):
    return -math.sin(p['poles'] * q / p['reach'] - p['late'] * v / p['v'] + p['phase'])


def _dashpots_at_both_ends(q, v, _m, p):
    return -2.5 * max(abs(q) / p['reach'] - p['free'], 0.0) * v / p['v']


def _sticky_patch(q, _v, _m, p):
    return 1.5 * math.exp(-(((q / p['reach'] - p['at']) / p['width']) ** 2))


def _paddle_in_stirred_bath(_q, v, m, p):
    past = (v - float(m.state[0])) / p['v']
    return -abs(past) * past


def _magnet_in_oil(q, _v, m, p):
    return -math.sin(p['poles'] * (q - float(m.state[0])) / p['reach'])


def _bucket_filled_by_motion(q, _v, m, p):
    return -1.5 * float(m.state[0]) / p['v'] * math.sin(p['swing'] * q / p['reach'] + p['lean'])


def _gyro_on_other(q, _v, m, p):
    return other_w(m, p) * math.cos(p['gear'] * q / p['reach'] + p['lean'])


def _pole_under_gantry_other(q, _v, m, p):
    along, across = q / p['reach'] - p['at'], p['ratio'] * other_u(m, p)
    return -0.7 * along / (along**2 + across**2 + p['below'] ** 2) ** 1.5


def _string_tensioned_by_other(q, _v, m, p):
    return -2.0 * q / p['reach'] * max(other_u(m, p) - p['slack'], 0.0)


def _film_thinned_by_other(_q, v, m, p):
    return -1.5 * v / p['v'] / (1.0 + (p['thin'] * other_w(m, p)) ** 2)


def _foot_on_mat_of_other(q, _v, m, p):
    angle = p['swing'] * q / p['reach']
    deep = p['depth'] - math.sin(angle) - p['ratio'] * other_u(m, p)
    return 1.2 * math.cos(angle) * max(deep, 0.0)


_SMOOTH = {
    'rim_magnet': _rim_magnet,
    'current_in_one_phase': _current_in_one_phase,
    'progressive_thread': _progressive_thread,
    'blade_past_jet': _blade_past_jet,
    'plate_before_jet': _plate_before_jet,
    'solenoid_on_rectifier': _solenoid_on_rectifier,
    'ejector': _ejector,
    'cold_end_of_guide': _cold_end_of_guide,
    'shielded_poles': _shielded_poles,
    'late_poles': _late_poles,
    'dashpots_at_both_ends': _dashpots_at_both_ends,
    'paddle_in_stirred_bath': _paddle_in_stirred_bath,
    'magnet_in_oil': _magnet_in_oil,
    'bucket_filled_by_motion': _bucket_filled_by_motion,
    'gyro_on_other': _gyro_on_other,
    'pole_under_gantry_other': _pole_under_gantry_other,
    'string_tensioned_by_other': _string_tensioned_by_other,
    'film_thinned_by_other': _film_thinned_by_other,
    'foot_on_mat_of_other': _foot_on_mat_of_other,
}
_DRY = {'sticky_patch': _sticky_patch}
"""Name to level of dry friction over the size of the force."""
_DRAWN = {
    'rim_magnet': {'turn': (2.5, 4.5), 'phase': (-1.5, 1.5), 'apart': (1.2, 1.5)},
    'current_in_one_phase': {'poles': (2.5, 5.0), 'phase': (-1.5, 1.5), 'steep': (1.5, 2.5)},
    'progressive_thread': {'turn': (2.5, 4.0), 'pitch': (0.8, 1.6), 'phase': (-1.5, 1.5)},
    'blade_past_jet': {'at': (-0.3, 0.3), 'width': (0.4, 0.7)},
    'plate_before_jet': {'jet': (0.1, 0.5)},
    'solenoid_on_rectifier': {'drop': (0.3, 0.7)},
    'ejector': {'knee': (0.7, 1.5)},
    'cold_end_of_guide': {'cold': (0.8, 1.5)},
    'shielded_poles': {'poles': (2.5, 5.0), 'phase': (-1.5, 1.5), 'shield': (0.5, 1.0)},
    'late_poles': {'poles': (2.5, 5.0), 'phase': (-1.5, 1.5), 'late': (0.4, 1.0)},
    'dashpots_at_both_ends': {'free': (0.2, 0.5)},
    'sticky_patch': {'at': (-0.3, 0.3), 'width': (0.25, 0.5)},
    'paddle_in_stirred_bath': {'follow_s': (0.3, 1.0)},
    'magnet_in_oil': {'poles': (4.0, 7.0), 'oil_s': (0.3, 0.8)},
    'bucket_filled_by_motion': {'swing': (1.5, 2.5), 'lean': (-0.8, 0.8), 'leak_s': (0.3, 0.8)},
    'gyro_on_other': {'gear': (1.0, 2.0), 'lean': (-0.8, 0.8)},
    'pole_under_gantry_other': {'at': (-0.3, 0.3), 'ratio': (0.5, 1.0), 'below': (0.4, 0.6)},
    'string_tensioned_by_other': {'slack': (-0.5, 0.0)},
    'film_thinned_by_other': {'thin': (1.0, 2.0)},
    'foot_on_mat_of_other': {'swing': (1.0, 1.5), 'ratio': (0.5, 1.0), 'depth': (0.0, 0.4)},
}
"""Name to the ranges of its constants."""


SET = FamilySet(_SMOOTH, _DRY, _DRAWN)
FAMILIES = SET.families
"""Name to force over its size."""
REMEMBER = {
    'paddle_in_stirred_bath': (lambda _q, v: v, lambda _q, v, z, p: (v - z) / p['follow_s']),
    'magnet_in_oil': (lambda q, _v: q, lambda q, _v, z, p: (q - z) / p['oil_s']),
    'bucket_filled_by_motion': (
        lambda _q, v: abs(v),
        lambda _q, v, z, p: (abs(v) - z) / p['leak_s'],
    ),
}
"""Those that remember to the start of the memory, and its rate."""
LISTED_PARTS: dict[str, str] = {}
"""None contains an effect of the list that could be named beside the rest."""
