"""A seventh set of laws that no list has, blind both ways.

It was written by someone who had not read the search, and who did not tell its author the families
before the first score. Forces over their size, with `u` and `w` of `second_families`, and those of
the source likewise; what a designer would choose is drawn with the world. Dry friction holds at
rest, as that of the list.
"""

from __future__ import annotations

import math

from sgp_proof.concealed.family_set import FamilySet, other_u, other_w
from sgp_ros.physics.catalogue import VISCOUS_FRICTION

_GAS = 1.4
"""Exponent of air that is compressed too fast to lose heat."""


def _air_spring_on_crank(q, _v, _m, p):
    angle = p['turn'] * q / p['reach'] + p['phase']
    left = 1.0 - 0.5 * p['swept'] * (1.0 - math.cos(angle))
    return -(left**-_GAS - 1.0) * math.sin(angle)


def _cord_to_post(q, _v, _m, p):
    across = q / p['reach'] - p['at']
    return -5.0 * across * max(1.0 - p['cord'] / math.hypot(across, p['post']), 0.0)


def _sprung_eccentric(q, _v, _m, p):
    angle = p['turn'] * q / p['reach'] + p['phase']
    return -0.7 * (p['preload'] + 1.0 - math.cos(angle)) * math.sin(angle)


def _passing_dipole(q, _v, _m, p):
    x = (q / p['reach'] - p['at']) / p['gap']
    return 1.2 * x * (x * x - 4.0) / (1.0 + x * x) ** 3.5


def _slotted_rocker(q, _v, _m, p):
    x = (q / p['reach'] - p['at']) / p['pivot']
    return -2.0 * math.atan(x) / (1.0 + x * x)


def _slanted_magnet_track(q, _v, _m, p):
    u = q / p['reach']
    return -math.sin(p['poles'] * u + p['phase']) * math.exp(p['slant'] * u)


def _relieved_check_valve(_q, v, _m, p):
    return -2.0 * min(max(v / p['v'], 0.0), p['relief'])


def _galloping_in_wind(_q, v, _m, p):
    w = v / p['v']
    return 1.5 * w * (1.0 - (w / p['steady']) ** 2)


def _winch_at_its_power(_q, v, _m, p):
    return 1.5 * p['base'] / max(abs(v) / p['v'], p['base'])


def _alternator_behind_freewheel(_q, v, _m, p):
    w = v / p['v']
    return -2.0 * max(w - p['cut_in'], 0.0) / math.hypot(1.0, w / p['knee'])


def _warped_brake_disc(q, _v, _m, p):
    return max(p['set'] + math.cos(p['turn'] * q / p['reach'] + p['phase']), 0.0)


def _dashpot_on_crank(q, v, _m, p):
    arm = math.cos(p['turn'] * q / p['reach'] + p['phase'])
    piston = arm * v / p['v']
    return -1.5 * arm * abs(piston) * piston


def _sector_in_magnet(q, v, _m, p):
    covered = min(max((q / p['reach'] - p['edge']) / p['pole'], 0.0), 1.0)
    w = v / p['v']
    return -2.5 * covered * w / (1.0 + (w / p['critical']) ** 2)


def _self_excited_brake(_q, v, m, p):
    return -1.5 * (float(m.state[0]) / p['v']) ** 2 * v / p['v']


def _oil_along_beam(q, _v, m, p):
    tilt = p['swing'] * q / p['reach'] + p['lean']
    return 3.0 * float(m.state[0]) / p['reach'] * math.cos(tilt)


def _spring_between_cranks_of_other(q, _v, m, p):
    angle = p['turn'] * (q / p['reach'] - p['ratio'] * other_u(m, p)) + p['set']
    length = math.sqrt(1.0 + p['crank'] ** 2 - 2.0 * p['crank'] * math.cos(angle))
    return -1.5 * math.sin(angle) * (1.0 - p['free'] / length)


def _damper_swung_by_other(_q, v, m, p):
    return -2.0 * math.cos(p['swing'] * other_u(m, p) + p['lean']) ** 2 * v / p['v']


def _roller_on_cam_of_other(q, _v, m, p):
    lift = p['lift'] * math.cos(p['turn'] * other_u(m, p) + p['phase'])
    return -2.0 * max(q / p['reach'] + lift - p['clear'], 0.0)


def _slipping_belt_to_other(_q, v, m, p):
    return -math.tanh((v / p['v'] - p['ratio'] * other_w(m, p)) / p['creep'])


def _band_brake_of_other(q, _v, m, p):
    return max(p['pull'] + other_u(m, p), 0.0) * math.exp(p['wrap'] * q / p['reach'])


_SMOOTH = {
    'air_spring_on_crank': _air_spring_on_crank,
    'cord_to_post': _cord_to_post,
    'sprung_eccentric': _sprung_eccentric,
    'passing_dipole': _passing_dipole,
    'slotted_rocker': _slotted_rocker,
    'slanted_magnet_track': _slanted_magnet_track,
    'relieved_check_valve': _relieved_check_valve,
    'galloping_in_wind': _galloping_in_wind,
    'winch_at_its_power': _winch_at_its_power,
    'alternator_behind_freewheel': _alternator_behind_freewheel,
    'dashpot_on_crank': _dashpot_on_crank,
    'sector_in_magnet': _sector_in_magnet,
    'self_excited_brake': _self_excited_brake,
    'oil_along_beam': _oil_along_beam,
    'spring_between_cranks_of_other': _spring_between_cranks_of_other,
    'damper_swung_by_other': _damper_swung_by_other,
    'roller_on_cam_of_other': _roller_on_cam_of_other,
    'slipping_belt_to_other': _slipping_belt_to_other,
}
_DRY = {
    'warped_brake_disc': _warped_brake_disc,
    'band_brake_of_other': _band_brake_of_other,
}
"""Name to level of dry friction over the size of the force."""
_DRAWN = {
    'air_spring_on_crank': {'turn': (2.5, 4.0), 'phase': (-1.5, 1.5), 'swept': (0.6, 0.75)},
    'cord_to_post': {'at': (-0.3, 0.3), 'post': (0.3, 0.5), 'cord': (0.6, 0.8)},
    'sprung_eccentric': {'turn': (3.0, 5.0), 'phase': (-1.5, 1.5), 'preload': (0.3, 0.8)},
    'passing_dipole': {'at': (-0.3, 0.3), 'gap': (0.35, 0.6)},
    'slotted_rocker': {'at': (-0.3, 0.3), 'pivot': (0.4, 0.7)},
    'slanted_magnet_track': {'poles': (2.5, 5.0), 'phase': (-1.5, 1.5), 'slant': (0.4, 0.8)},
    'relieved_check_valve': {'relief': (0.4, 0.9)},
    'galloping_in_wind': {'steady': (1.0, 1.6)},
    'winch_at_its_power': {'base': (0.3, 0.6)},
    'alternator_behind_freewheel': {'cut_in': (0.2, 0.5), 'knee': (0.4, 0.8)},
    'warped_brake_disc': {'turn': (2.5, 4.0), 'phase': (-1.5, 1.5), 'set': (-0.2, 0.4)},
    'dashpot_on_crank': {'turn': (1.5, 3.0), 'phase': (-1.5, 1.5)},
    'sector_in_magnet': {'edge': (-0.6, 0.0), 'pole': (0.6, 1.0), 'critical': (0.6, 1.0)},
    'self_excited_brake': {'coil_s': (0.15, 0.5)},
    'oil_along_beam': {'swing': (1.2, 2.0), 'lean': (-0.5, 0.5), 'run_s': (0.3, 0.8)},
    'spring_between_cranks_of_other': {
        'turn': (1.2, 2.0), 'ratio': (0.5, 1.0), 'set': (-0.8, 0.8), 'crank': (1.3, 1.6),
        'free': (0.5, 0.9),
    },
    'damper_swung_by_other': {'swing': (1.5, 2.5), 'lean': (-0.8, 0.8)},
    'roller_on_cam_of_other': {
        'lift': (0.5, 0.9), 'turn': (1.5, 3.0), 'phase': (-1.5, 1.5), 'clear': (0.0, 0.3),
    },
    'slipping_belt_to_other': {'ratio': (0.5, 1.0), 'creep': (0.2, 0.5)},
    'band_brake_of_other': {'pull': (0.2, 0.6), 'wrap': (0.4, 0.8)},
}  # fmt: skip
"""Name to the ranges of its constants."""


SET = FamilySet(_SMOOTH, _DRY, _DRAWN)
FAMILIES = SET.families
"""Name to force over its size."""
REMEMBER = {
    'self_excited_brake': (lambda _q, v: v, lambda _q, v, z, p: (v - z) / p['coil_s']),
    'oil_along_beam': (lambda q, _v: q, lambda q, _v, z, p: (q - z) / p['run_s']),
}
"""Those that remember to the start of the memory, and its rate."""
LISTED_PARTS = {
    'galloping_in_wind': VISCOUS_FRICTION.name,
    'damper_swung_by_other': VISCOUS_FRICTION.name,
}
"""A law that contains an effect of the list may be named as that effect beside the rest."""
