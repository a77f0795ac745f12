"""A fifth set of laws that no list has, blind both ways.

It was written by someone who had not read the search, and who did not tell its author the families
before the first score. Forces over their size, with `u` and `w` of `second_families`, and those of
the source likewise; what a designer would choose is drawn with the world. Dry friction holds at
rest, as that of the list. One law changes with the time since the start.
"""

from __future__ import annotations

import math

from sgp_proof.concealed.family_set import FamilySet, other_u, other_w

_CLOSED = 0.1
"""Least part that is left of a chamber or of a gap."""
_GAS = 1.4
"""Exponent of air that is compressed too fast to lose heat."""


def _half_wave_cam(q, _v, _m, p):
    return -1.8 * max(math.sin(p['turn'] * q / p['reach'] + p['phase']), 0.0)


def _governor_sleeve(_q, v, _m, p):
    spin = (v / p['v']) ** 2
    return -2.0 * spin / (spin + p['risen'] ** 2)


def _flap_in_wind(q, _v, _m, p):
    across = math.sin(p['turn'] * q / p['reach'] + p['set'])
    return -1.5 * abs(across) * across


def _weight_on_oval_gear(q, _v, _m, p):
    return -1.0 / (1.0 + p['oval'] * math.cos(p['turn'] * q / p['reach'] + p['phase']))


def _narrow_poles(q, _v, _m, p):
    angle = p['poles'] * q / p['reach'] + p['phase']
    return -2.0 * math.sin(angle) * math.exp(p['narrow'] * (math.cos(angle) - 1.0))


def _charging_battery(_q, v, _m, p):
    return -1.5 * max(v / p['v'] - p['charged'], 0.0)


def _coil_field(q, _v, _m, p):
    return 1.5 / (1.0 + ((q / p['reach'] - p['at']) / p['radius']) ** 2) ** 1.5


def _braking_coil(q, v, _m, p):
    return -2.0 * v / p['v'] / (1.0 + ((q / p['reach'] - p['at']) / p['width']) ** 2) ** 2


def _tapered_film(q, v, _m, p):
    return -0.7 * v / p['v'] / max(1.0 - p['taper'] * q / p['reach'], _CLOSED)


def _rubbing_crosshead(q, _v, _m, p):
    return 1.3 * abs(math.cos(p['turn'] * q / p['reach'] + p['phase']))


def _unbalanced_rotor(q, v, _m, p):
    return (v / p['v']) ** 2 * math.sin(p['gear'] * q / p['reach'] + p['phase'])


def _ratchet_pawl(q, v, _m, p):
    lifted = 1.0 + p['rise'] * math.sin(p['teeth'] * q / p['reach'] + p['phase'])
    return -1.2 * max(math.tanh(v / (p['grip'] * p['v'])), 0.0) * lifted


def _carriage_on_other(q, _v, m, p):
    out = 1.0 + p['travel'] * other_u(m, p)
    return -out * math.sin(p['swing'] * q / p['reach'] + p['lean'])


def _paddle_dipped_by_other(_q, v, m, p):
    w = v / p['v']
    return -2.0 * max(other_u(m, p) - p['level'], 0.0) * abs(w) * w


def _leaky_air_cushion(q, _v, m, p):
    squeezed = p['stroke'] * (q - float(m.state[0])) / p['reach']
    return 1.0 - max(1.0 - squeezed, _CLOSED) ** -_GAS


def _magnet_on_worn_key(_q, _v, m, p):
    return -math.sin(p['poles'] * float(m.state[0]) / p['reach'] + p['phase'])


def _one_way_pump(_q, _v, m, p):
    return -2.0 * float(m.state[0]) / p['v']


def _draining_weight(q, _v, m, p):
    full = max(1.0 - m.time_s / p['empty_s'], 0.0)
    return -1.5 * full * math.sin(p['swing'] * q / p['reach'] + p['lean'])


def _mast_cord_over_other(q, _v, m, p):
    own = p['swing'] * q / p['reach']
    both = own + p['swing_before'] * other_u(m, p) + p['phase']
    return -math.sin(own) - p['mast'] * math.sin(both)


def _towed_paddle_of_other(_q, v, m, p):
    w = v / p['v']
    return -w * math.hypot(w, p['arm'] * other_w(m, p))


_SMOOTH = {
    'half_wave_cam': _half_wave_cam,
    'governor_sleeve': _governor_sleeve,
    'flap_in_wind': _flap_in_wind,
    'weight_on_oval_gear': _weight_on_oval_gear,
    'narrow_poles': _narrow_poles,
    'charging_battery': _charging_battery,
    'coil_field': _coil_field,
    'braking_coil': _braking_coil,
    'tapered_film': _tapered_film,
    'unbalanced_rotor': _unbalanced_rotor,
    'ratchet_pawl': _ratchet_pawl,
    'carriage_on_other': _carriage_on_other,
    'paddle_dipped_by_other': _paddle_dipped_by_other,
    'leaky_air_cushion': _leaky_air_cushion,
    'magnet_on_worn_key': _magnet_on_worn_key,
    'one_way_pump': _one_way_pump,
    'draining_weight': _draining_weight,
    'mast_cord_over_other': _mast_cord_over_other,
    'towed_paddle_of_other': _towed_paddle_of_other,
}
_DRY = {'rubbing_crosshead': _rubbing_crosshead}
"""Name to level of dry friction over the size of the force."""
_DRAWN = {
    'half_wave_cam': {'turn': (2.5, 4.5), 'phase': (-1.5, 1.5)},
    'governor_sleeve': {'risen': (0.4, 0.9)},
    'flap_in_wind': {'turn': (3.5, 5.5), 'set': (-1.0, 1.0)},
    'weight_on_oval_gear': {'oval': (0.65, 0.8), 'turn': (3.5, 5.5), 'phase': (-1.5, 1.5)},
    'narrow_poles': {'poles': (3.5, 6.0), 'narrow': (1.0, 2.0), 'phase': (-1.5, 1.5)},
    'charging_battery': {'charged': (0.3, 0.8)},
    'coil_field': {'at': (-0.3, 0.3), 'radius': (0.2, 0.4)},
    'braking_coil': {'at': (-0.3, 0.3), 'width': (0.3, 0.5)},
    'tapered_film': {'taper': (0.7, 0.85)},
    'rubbing_crosshead': {'turn': (2.5, 4.0), 'phase': (-1.5, 1.5)},
    'unbalanced_rotor': {'gear': (3.0, 6.0), 'phase': (-1.5, 1.5)},
    'ratchet_pawl': {
        'teeth': (4.0, 8.0), 'rise': (0.5, 0.9), 'phase': (-1.5, 1.5), 'grip': (0.1, 0.2),
    },
    'carriage_on_other': {'travel': (0.7, 1.0), 'swing': (1.0, 2.0), 'lean': (-0.8, 0.8)},
    'paddle_dipped_by_other': {'level': (-0.6, 0.0)},
    'leaky_air_cushion': {'stroke': (0.5, 0.7), 'leak_s': (0.2, 0.6)},
    'magnet_on_worn_key': {'poles': (2.0, 4.0), 'phase': (-1.5, 1.5), 'slack': (0.15, 0.35)},
    'one_way_pump': {'leak_s': (0.15, 0.4)},
    'draining_weight': {'swing': (1.5, 2.5), 'lean': (-0.8, 0.8), 'empty_s': (15.0, 30.0)},
    'mast_cord_over_other': {
        'swing': (1.2, 2.0), 'swing_before': (1.2, 2.0), 'mast': (0.7, 1.3), 'phase': (-1.0, 1.0),
    },
    'towed_paddle_of_other': {'arm': (1.0, 2.0)},
}  # fmt: skip
"""Name to the ranges of its constants."""


def _slipped(q, v, z, p):
    """Return the rate of the far side of a play."""
    return v if (q - z) * math.copysign(1.0, v) >= p['slack'] * p['reach'] else 0.0


SET = FamilySet(_SMOOTH, _DRY, _DRAWN)
FAMILIES = SET.families
"""Name to force over its size."""
REMEMBER = {
    'leaky_air_cushion': (lambda q, _v: q, lambda q, _v, z, p: (q - z) / p['leak_s']),
    'magnet_on_worn_key': (lambda q, _v: q, _slipped),
    'one_way_pump': (
        lambda _q, v: max(v, 0.0),
        lambda _q, v, z, p: (max(v, 0.0) - z) / p['leak_s'],
    ),
}
"""Those that remember to the start of the memory, and its rate."""
LISTED_PARTS: dict[str, str] = {}
"""None contains an effect of the list that could be named beside the rest."""
OF_CLOCK = ('draining_weight',)
"""Those that change with the time since the start: their formulas may contain it."""
