"""Laws that no list has, with constants that are drawn with the world."""

from __future__ import annotations

import math

import numpy as np

from sgp_ros.physics.catalogue import (
    COULOMB_FRICTION,
    QUADRATIC_DRAG,
    SPRING,
    VISCOUS_FRICTION,
)
from sgp_ros.simulation.effects import Action

LISTED = {
    COULOMB_FRICTION.name: lambda _q, v, p: -p['level'] * np.sign(v),
    VISCOUS_FRICTION.name: lambda _q, v, p: -p['b'] * v,
    QUADRATIC_DRAG.name: lambda _q, v, p: -p['c'] * np.abs(v) * v,
    SPRING.name: lambda q, _v, p: -p['stiffness'] * (q - p['rest']),
}
"""Effects that may be named beside a law that contains them, to their force."""


STEP_S = 0.005
"""Step of a motion along which laws that remember are compared [s]."""


def other_u(m, p):
    """Return the position of the source over half its width."""
    return float(m.position[p['source']]) / p['source_reach']


def other_w(m, p):
    """Return the velocity of the source over its usual one."""
    return float(m.velocity[p['source']]) / p['source_v']


class FamilySet:
    """Families by name: smooth force and level of dry friction over the size, and constants.

    Attributes:
        families: name to the whole force over its size.
        ranges: name to the ranges of its constants.
    """

    def __init__(self, smooth, dry, ranges):
        self._places, self.ranges = {'force': smooth, 'dry_level': dry}, ranges
        self.families = {kind: self._whole(kind) for kind in ranges}

    def _whole(self, kind):
        smooth, level = (laws.get(kind, lambda *_: 0.0) for laws in self._places.values())
        return lambda *at: smooth(*at) - math.copysign(level(*at), at[1])

    def constants(self, kind, rng, source_reach):
        """Return what is drawn for a world of a family; nothing for those of other sets."""
        if kind not in self.families:
            return {}
        drawn = {name: float(rng.uniform(*ends)) for name, ends in self.ranges[kind].items()}
        return {**drawn, 'source_reach': source_reach}

    def builder(self, kind):
        """Return what builds the action of a family without memory."""

        def build(joint, p, _joints):
            def of(law):
                return lambda m, *_direction: (
                    p['a'] * law(float(m.position[joint]), float(m.velocity[joint]), m, p)
                )

            laws = {place: laws[kind] for place, laws in self._places.items() if kind in laws}
            return (Action(joint, **{place: of(law) for place, law in laws.items()}),)

        return build


def _lag(_at, x, time_constant):
    z, lag = np.array(x, dtype=np.float64), max(time_constant, 1e-9)
    keep, behind = math.exp(-STEP_S / lag), np.diff(x) * lag / STEP_S  # joined by lines
    for i in range(1, len(z)):
        z[i] = x[i] - behind[i - 1] + (z[i - 1] - x[i - 1] + behind[i - 1]) * keep
    return z


def _play(_at, x, width):
    z = np.array(x, dtype=np.float64)
    for i in range(1, len(z)):
        z[i] = min(max(z[i - 1], x[i] - 0.5 * width), x[i] + 0.5 * width)
    return z


def _delay(_at, x, delay):
    t = STEP_S * np.arange(len(x))
    return np.interp(t - delay, t, x)


ALONG = {'lag': _lag, 'play': _play, 'delay': _delay}
"""Functions that remember, along a motion in steps of `STEP_S`."""
