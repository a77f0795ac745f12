"""Effects outside the list, as actions for the simulation.

Their parameters: `a` size, `v` usual velocity of the joint, `reach` half the width of its motion,
`start` and `end` of a disturbance [s], `hz` its frequency, `source` another joint, `source_v` its
usual velocity.
"""

from __future__ import annotations

import math

from sgp_ros.simulation.effects import Action

NAME = 'unknown'
"""Name of all of them."""


def force(law):
    """Return an effect whose force is `a law(q, v, moment, parameters)`."""

    def build(joint, p, _joints):
        def exerted(moment):
            q, v = float(moment.position[joint]), float(moment.velocity[joint])
            return p['a'] * law(q, v, moment, p)

        return (Action(joint, force=exerted),)

    return build


def _position_gain(joint, p, _joints):
    def drive(moment):
        gain = 1.0 + p['a'] * math.cos(2.0 * float(moment.position[joint]) / p['reach'])
        return gain * float(moment.drive[joint])

    return (Action(joint, drive=drive),)


def _burst(_q, _v, moment, p):
    if not p['start'] <= moment.time_s <= p['end']:
        return 0.0
    return math.sin(2.0 * math.pi * p['hz'] * (moment.time_s - p['start']))


def _other_velocity(_q, _v, moment, p):
    return -float(moment.velocity[p['source']]) / p['source_v']


def _other_gain(_q, v, moment, p):
    return -math.tanh(v / (0.2 * p['v'])) * math.sin(float(moment.position[p['source']]) * 2.0)


UNKNOWN = {
    'sine_friction': force(
        lambda q, v, _m, p: -math.sin(3.0 * q / p['reach']) * math.tanh(v / (0.2 * p['v']))
    ),
    'cubic_drag': force(lambda _q, v, _m, p: -0.4 * (v / p['v']) ** 3),
    'position_times_velocity': force(lambda q, v, _m, p: -(q / p['reach']) * v / p['v']),
    'hardening_spring': force(lambda q, _v, _m, p: 3.0 * (q / p['reach']) ** 3 - q / p['reach']),
    'square_law_wind': force(lambda _q, v, _m, p: -0.6 * (v / p['v']) ** 2),
    'position_gain': _position_gain,
    'other_velocity': force(_other_velocity),
    'other_position_gain': force(_other_gain),
    'burst': force(_burst),
    'periodic': force(lambda _q, _v, m, p: math.sin(2.0 * math.pi * p['hz'] * m.time_s)),
}
"""Name to what builds the actions from joint, parameters and all joints."""
OF_TIME = ('burst', 'periodic', 'walk')
"""Those that are no function of the motion: there is no law to be found."""
