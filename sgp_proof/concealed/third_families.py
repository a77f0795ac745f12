"""A third set of laws that no list has, blind both ways.

It was written by someone who had not read the search, and who did not tell its author the families
before the first score. Forces over their size, with `u` and `w` of `second_families`; what a
designer would choose is drawn with the world. Dry friction holds at rest, as that of the list.
"""

from __future__ import annotations

import math

from sgp_proof.concealed.family_set import FamilySet
from sgp_ros.physics.catalogue import COULOMB_FRICTION

_RESIDUAL_GAP, _FASTEST = 0.6, 4.0
"""Air left when a plunger has arrived, as `u`; speed at which a muscle no longer pulls, as `w`."""


def _thinning_fluid(_q, v, _m, p):
    w = v / p['v']
    return -1.4 * w * (1.0 + (w / p['knee']) ** 2) ** (0.5 * (p['index'] - 1.0))


def _centrifugal_brake(_q, v, _m, p):
    w = v / p['v']
    return -0.6 * math.copysign(max(w * w - p['grip'] ** 2, 0.0), w)


def _blow_off_damper(_q, v, _m, p):
    w = v / p['v']
    closed = min(max(w, -p['knee']), p['knee'])
    return -1.5 * (closed + p['open'] * (w - closed))


def _slider_crank(q, _v, _m, p):
    angle = 3.5 * q / p['reach']
    tilt = p['rod'] * math.cos(angle) / math.sqrt(1.0 - (p['rod'] * math.sin(angle)) ** 2)
    return -math.sin(angle) * (1.0 + tilt)


def _float(q, _v, _m, p):
    depth = min(max((q / p['reach'] - p['level']) / p['radius'], -1.0), 1.0)
    return -0.4 * (1.0 + depth) ** 2 * (2.0 - depth)


def _cam_lobe(q, _v, _m, p):
    x = (q / p['reach'] - p['top']) / p['flank']
    return math.sin(math.pi * x) if abs(x) < 1.0 else 0.0


def _muscle(q, v, _m, p):
    speed = min(max(v / (_FASTEST * p['v']), -1.0), 1.0)
    overlap = math.exp(-(((q / p['reach'] - p['best']) / p['width']) ** 2))
    if speed > 0.0:
        return overlap * (1.0 - speed) / (1.0 + speed / p['hill'])
    return overlap * (1.5 - 0.5 * (1.0 + speed) / (1.0 - 7.56 * speed / p['hill']))


def _flyweight(q, _v, m, p):
    spin = float(m.velocity[p['source']]) / p['source_v']
    return 0.6 * spin**2 * math.sin(2.0 * (p['rest'] + 0.8 * q / p['reach']))


def _solenoid(q, _v, _m, p):
    return -0.7 * (p['gap'] / max(q / p['reach'] + p['gap'], _RESIDUAL_GAP)) ** 2


def _behind_cardan(q, _v, _m, p):
    turn = math.cos(2.0 * q / p['reach'])
    return math.cos(p['bend']) / (1.0 - (math.sin(p['bend']) * turn) ** 2)


def _bowden_cable(_q, _v, m, p):
    return 0.7 * math.exp(p['mu'] * float(m.position[p['source']]) / p['source_reach'])


_SMOOTH = {
    'thinning_fluid': _thinning_fluid,
    'rolling_traction': lambda _q, v, _m, p: -0.5 * math.asinh(v / (p['knee'] * p['v'])),
    'centrifugal_brake': _centrifugal_brake,
    'blow_off_damper': _blow_off_damper,
    'slider_crank': _slider_crank,
    'weight_over_pulley': lambda q, _v, _m, p: -q / math.hypot(q, p['depth'] * p['reach']),
    'dipping_float': _float,
    'cam_lobe': _cam_lobe,
    'muscle': _muscle,
    'flyweight_of_other': _flyweight,
    'solenoid_with_gland': _solenoid,
    'throttled_balancer': lambda _q, _v, m, p: -float(m.state[0]) / p['reach'],
}
_DRY = {
    'friction_behind_cardan': _behind_cardan,
    'bowden_cable_of_other': _bowden_cable,
    'solenoid_with_gland': lambda _q, _v, _m, p: p['gland'],
}
"""Name to level of dry friction over the size of the force."""
_DRAWN = {
    'thinning_fluid': {'knee': (0.3, 0.8), 'index': (0.2, 0.5)},
    'rolling_traction': {'knee': (0.1, 0.35)},
    'centrifugal_brake': {'grip': (0.7, 1.2)},
    'blow_off_damper': {'knee': (0.3, 0.8), 'open': (0.1, 0.3)},
    'slider_crank': {'rod': (0.3, 0.6)},
    'weight_over_pulley': {'depth': (0.2, 0.5)},
    'dipping_float': {'level': (-0.3, 0.3), 'radius': (0.4, 0.7)},
    'cam_lobe': {'top': (-0.3, 0.3), 'flank': (0.4, 0.8)},
    'muscle': {'hill': (0.2, 0.4), 'best': (-0.3, 0.3), 'width': (0.5, 0.9)},
    'friction_behind_cardan': {'bend': (0.6, 0.9)},
    'bowden_cable_of_other': {'mu': (0.6, 1.0)},
    'flyweight_of_other': {'rest': (0.4, 0.9)},
    'solenoid_with_gland': {'gap': (1.6, 2.2), 'gland': (0.4, 0.8)},
    'throttled_balancer': {'fill_s': (0.1, 0.4)},
}
"""Name to the ranges of its constants."""


SET = FamilySet(_SMOOTH, _DRY, _DRAWN)
FAMILIES = SET.families
"""Name to force over its size."""
REMEMBER = {'throttled_balancer': (lambda q, _v: q, lambda q, _v, z, p: (q - z) / p['fill_s'])}
"""The one that remembers to the start of the memory, and its rate."""
LISTED_PARTS = {'solenoid_with_gland': COULOMB_FRICTION.name}
"""A law that contains an effect of the list may be named as that effect beside the rest."""
