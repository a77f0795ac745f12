"""An eighth set of laws that no list has, blind both ways.

It was written by someone who had not read the search, and who did not tell its author the families
before the first score. Forces over their size, with `u` and `w` of `second_families`, and those of
the source likewise; what a designer would choose is drawn with the world. Dry friction holds at
rest, as that of the list. One law acts by the effort of another motor.
"""

from __future__ import annotations

import math

from sgp_proof.concealed import fourth_families as fourth
from sgp_proof.concealed.family_set import FamilySet, other_u, other_w
from sgp_ros.physics.catalogue import VISCOUS_FRICTION

_LEFT = 0.3
"""Least gap that is left before a magnet, or part of an orifice."""
_FLAT = 1.6
"""Travel at which a diaphragm lies on its stop, over the height of its cone."""
_EYELET = 0.2
"""Radius of the eyelet through which a line is reeled in, over the length of the boom."""
_STRAIGHT = 1.25
"""Angle at which a toggle rests on its stop [rad]."""


def _latches_at_both_ends(q, _v, _m, p):
    u = q / p['reach'] - p['at']
    upper, lower = (max(p['apart'] - x, _LEFT) for x in (u, -u))
    return 0.4 * (upper**-2 - lower**-2)


def _diaphragm_spring(q, _v, _m, p):
    x = min(max(p['travel'] * (q / p['reach'] - p['begin']), 0.0), _FLAT * p['cone'])
    return -0.4 * x * ((p['cone'] - x) * (p['cone'] - 0.5 * x) + 1.0)


def _weight_set_down_again(q, _v, _m, p):
    past = q / p['reach'] - p['shelf']
    up, down = (min(max(x / p['stretch'], 0.0), 1.0) for x in (past, past - p['carried']))
    return -1.5 * (up - down)


def _thickening_fluid(_q, v, _m, p):
    w = v / p['v']
    jammed = 0.5 * (1.0 + math.tanh((abs(w) - p['jam']) / p['over']))
    return -1.5 * w * (p['thin'] + jammed)


def _centrifugal_switch(_q, v, _m, p):
    return 0.75 * (1.0 - math.tanh((abs(v) / p['v'] - p['cut']) / p['over']))


def _sprag_lifting_off(_q, v, _m, p):
    return max(1.0 - (v / (p['lift'] * p['v'])) ** 2, 0.0)


def _metering_pin(q, v, _m, p):
    w, area = v / p['v'], max(1.0 - p['taper'] * q / p['reach'], _LEFT)
    return -0.8 * abs(w) * w / area**2


def _generator_into_battery(q, v, _m, p):
    field = math.cos(p['turn'] * q / p['reach'] + p['phase'])
    voltage = field * v / p['v']
    return -2.0 * field * math.copysign(max(abs(voltage) - p['battery'], 0.0), voltage)


def _positioner_at_its_limit(q, v, _m, p):
    return -math.tanh((q / p['reach'] - p['at'] + p['lead'] * v / p['v']) / p['band'])


def _seat_belt_reel(_q, v, m, p):
    ahead = abs(v - float(m.state[0])) / p['v']
    return -2.0 * v / p['v'] * max(ahead - p['trip'], 0.0)


def _leant(q, m, p):
    """Return how far a lip or a pad leans, -1 to 1: against its motion after a while."""
    return min(max((q - float(m.state[0])) / (p['slack'] * p['reach']), -1.0), 1.0)


def _folding_wiper(q, _v, m, p):
    return -math.sin(p['fold'] * _leant(q, m, p))


def _rocking_pad(q, v, m, p):
    w, leant = v / p['v'], _leant(q, m, p)
    return -0.8 * (w * abs(leant) + abs(w) * leant)


def _memory_wire(_q, _v, m, p):
    return 1.5 * min(max((float(m.state[0]) / p['v'] ** 2 - p['warm']) / p['over'], 0.0), 1.0)


def _cable_past_idler_of_other(q, _v, m, p):
    tension = float(m.drive[p['source']]) / p['source_effort']
    return tension * math.sin(p['turn'] * q / p['reach'] + p['phase'])


def _tool_in_water_with_other(q, v, m, p):
    angle, carried = p['turn'] * q / p['reach'] + p['set'], p['ratio'] * other_w(m, p)
    along = v / p['v'] + carried * math.cos(angle)
    return -0.7 * along * math.hypot(along, carried * math.sin(angle))


def _line_reeled_on_carriage_other(q, _v, m, p):
    angle = p['swing'] * q / p['reach'] + p['lean']
    carriage, across = p['post'] + p['ratio'] * other_u(m, p), math.sin(angle)
    return -1.3 * carriage * across / math.hypot(carriage - math.cos(angle), across, _EYELET)


def _stirrer_lowered_with_other(q, v, m, p):
    height = math.cos(p['swing'] * q / p['reach'] + p['lean']) + p['ratio'] * other_u(m, p)
    return -2.0 * max(p['bath'] - height, 0.0) * v / p['v']


def _freewheel_to_other(_q, v, m, p):
    return -1.5 * max(v / p['v'] - p['ratio'] * other_w(m, p), 0.0)


def _magnet_grid_with_other(q, _v, m, p):
    across = math.cos(p['columns'] * other_u(m, p) + p['lean'])
    return -1.4 * math.sin(p['rows'] * q / p['reach'] + p['phase']) * across


def _toggle_clamp_of_other(_q, _v, m, p):
    return 0.8 * math.tan(min(max(p['set'] + p['swing'] * other_u(m, p), 0.0), _STRAIGHT))


_SMOOTH = {
    'latches_at_both_ends': _latches_at_both_ends,
    'diaphragm_spring': _diaphragm_spring,
    'weight_set_down_again': _weight_set_down_again,
    'thickening_fluid': _thickening_fluid,
    'centrifugal_switch': _centrifugal_switch,
    'metering_pin': _metering_pin,
    'generator_into_battery': _generator_into_battery,
    'positioner_at_its_limit': _positioner_at_its_limit,
    'seat_belt_reel': _seat_belt_reel,
    'folding_wiper': _folding_wiper,
    'rocking_pad': _rocking_pad,
    'memory_wire': _memory_wire,
    'cable_past_idler_of_other': _cable_past_idler_of_other,
    'tool_in_water_with_other': _tool_in_water_with_other,
    'line_reeled_on_carriage_other': _line_reeled_on_carriage_other,
    'stirrer_lowered_with_other': _stirrer_lowered_with_other,
    'freewheel_to_other': _freewheel_to_other,
    'magnet_grid_with_other': _magnet_grid_with_other,
}
_DRY = {
    'sprag_lifting_off': _sprag_lifting_off,
    'toggle_clamp_of_other': _toggle_clamp_of_other,
}
"""Name to level of dry friction over the size of the force."""
_DRAWN = {
    'latches_at_both_ends': {'at': (-0.15, 0.15), 'apart': (1.3, 1.6)},
    'diaphragm_spring': {'begin': (-0.6, -0.2), 'travel': (1.8, 2.4), 'cone': (2.1, 2.5)},
    'weight_set_down_again': {
        'shelf': (-0.6, -0.2), 'carried': (0.5, 0.8), 'stretch': (0.15, 0.3),
    },
    'thickening_fluid': {'thin': (0.05, 0.15), 'jam': (1.2, 1.7), 'over': (0.15, 0.3)},
    'centrifugal_switch': {'cut': (0.5, 1.0), 'over': (0.15, 0.3)},
    'sprag_lifting_off': {'lift': (0.5, 0.8)},
    'metering_pin': {'taper': (0.4, 0.7)},
    'generator_into_battery': {'turn': (1.5, 3.0), 'phase': (-1.5, 1.5), 'battery': (0.2, 0.5)},
    'positioner_at_its_limit': {'at': (-0.3, 0.3), 'lead': (0.3, 0.7), 'band': (0.15, 0.4)},
    'seat_belt_reel': {'trip': (0.4, 0.8), 'ring_s': (0.3, 0.8)},
    'folding_wiper': {'slack': (0.2, 0.45), 'fold': (2.0, 2.8)},
    'rocking_pad': {'slack': (0.4, 0.7)},
    'memory_wire': {'warm': (0.4, 0.8), 'over': (0.5, 1.0), 'heat_s': (0.15, 0.5)},
    'cable_past_idler_of_other': {'turn': (2.0, 3.5), 'phase': (-1.5, 1.5)},
    'tool_in_water_with_other': {'turn': (1.0, 2.0), 'set': (-0.8, 0.8), 'ratio': (0.6, 1.2)},
    'line_reeled_on_carriage_other': {
        'swing': (1.5, 2.5), 'lean': (-0.5, 0.5), 'post': (0.9, 1.3), 'ratio': (0.5, 0.8),
    },
    'stirrer_lowered_with_other': {
        'swing': (1.2, 2.0), 'lean': (-0.8, 0.8), 'ratio': (0.4, 0.8), 'bath': (0.5, 0.9),
    },
    'freewheel_to_other': {'ratio': (0.5, 1.0)},
    'magnet_grid_with_other': {
        'rows': (2.5, 4.5), 'phase': (-1.5, 1.5), 'columns': (1.5, 3.0), 'lean': (-0.8, 0.8),
    },
    'toggle_clamp_of_other': {'set': (0.5, 0.8), 'swing': (0.5, 0.7)},
}  # fmt: skip
"""Name to the ranges of its constants."""


SET = FamilySet(_SMOOTH, _DRY, _DRAWN)
FAMILIES = SET.families
"""Name to force over its size."""
_BEHIND_PLAY = fourth.REMEMBER['preload_behind_play']
REMEMBER = {
    'seat_belt_reel': (lambda _q, v: v, lambda _q, v, z, p: (v - z) / p['ring_s']),
    'folding_wiper': _BEHIND_PLAY,
    'rocking_pad': _BEHIND_PLAY,
    'memory_wire': (lambda _q, v: v * v, lambda _q, v, z, p: (v * v - z) / p['heat_s']),
}
"""Those that remember to the start of the memory, and its rate."""
LISTED_PARTS = {'thickening_fluid': VISCOUS_FRICTION.name}
"""A law that contains an effect of the list may be named as that effect beside the rest."""
OF_EFFORT = ('cable_past_idler_of_other',)
"""Those that act by the effort of the source: their formulas may contain it."""
