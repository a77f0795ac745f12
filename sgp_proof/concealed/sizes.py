"""The size of a concealed effect, such that its share of the squared effort is as wanted."""

from __future__ import annotations

import math

import numpy as np

from sgp_proof.concealed import eighth_families as eighth
from sgp_proof.concealed import fifth_families as fifth
from sgp_proof.concealed import ninth_families as ninth
from sgp_proof.concealed import seventh_families as seventh
from sgp_proof.concealed import sixth_families as sixth
from sgp_proof.concealed.balance import Balance
from sgp_proof.concealed.unknown import NAME
from sgp_ros.physics.catalogue import VELOCITY_FILTER_LAG
from sgp_ros.physics.drawing import UnsuitableError
from sgp_ros.physics.place import PLACES

SMALLEST_SHARE = 0.0042
LEAST_BEYOND, MOST_BEYOND, MOST_OF_ALL = 0.05, 0.4, 0.6
"""Shares of a law of the fifth set on: beyond plain effects at least and at most, and in all."""
_TARGETS = {'A': (0.02, 0.2), 'B': (0.006, 0.1)}
_BEYOND = 0.07, 0.3
_BEYOND_PLAIN = set().union(*(x.FAMILIES for x in (fifth, sixth, seventh, eighth, ninth)))
"""Those that are measured by what plain effects cannot absorb of them."""
_PILOT_S = 10.0
_ROUNDS = 4


def shares(recording, world):
    """Return the share of what a robot without effects does not explain, (k,).

    Of the mean squared command; on a joint without a motor, of the mean square of `M_jj a`.
    """
    balance = Balance.of(recording, world.true.mechanism)
    scale = np.where(
        [body.is_driven for body in world.bodies],
        np.mean(balance.given**2, axis=0),
        np.mean(balance.diagonal**2, axis=0),
    )
    return np.mean((balance.needed - balance.given) ** 2, axis=0) / scale


def is_measured_beyond(effect):
    """Return whether an effect is measured by what plain effects cannot absorb of it."""
    return effect.at.name == NAME and effect.at.parameters['kind'] in _BEYOND_PLAIN


def targets(effect, tier):
    """Return the ends of the range from which the share of an effect is drawn."""
    return _BEYOND if is_measured_beyond(effect) else _TARGETS[tier]


def is_suitable(recording, world, effect):
    """Return whether the share of an effect counts as physics, and as that of its set."""
    share = own_share(recording, world, effect)
    if not is_measured_beyond(effect):
        return share >= SMALLEST_SHARE
    whole = float(shares(recording, world)[effect.index])
    return LEAST_BEYOND <= share <= MOST_BEYOND and whole <= MOST_OF_ALL


def beyond_plain(recording, world, j):
    """Return the share that constant, spring, friction and inertia of the joint leave."""
    balance = Balance.of(recording, world.true.mechanism)
    v = recording.shown_velocity[:, j]
    plain = np.column_stack([
        np.ones_like(v), recording.shown_position[:, j], v, np.sign(v),
        recording.true_acceleration[:, j],
    ])  # fmt: skip
    missing = (balance.needed - balance.given)[:, j]
    missing = missing - plain @ np.linalg.lstsq(plain, missing, rcond=None)[0]
    whole = balance.given if world.bodies[j].is_driven else balance.diagonal
    return float(np.mean(missing**2) / np.mean(whole[:, j] ** 2))


def own_share(recording, world, effect):
    """Return the share by which the size of an effect is measured."""
    at = effect.at
    if is_measured_beyond(effect):
        return beyond_plain(recording, world, effect.index)
    if at.name == VELOCITY_FILTER_LAG.name:
        clean = recording.shown_velocity[:, effect.index]
        late = _late(recording, clean, at.parameters['time_constant'])
        return float(np.mean((late - clean) ** 2) / np.var(clean))
    found = shares(recording, world)
    several = at.joint in PLACES or at.effect.is_body or at.effect.has_source
    return float(found.max() if several else found[effect.index])


def sized(world, effect, target):
    """Set the size of an effect by runs of the world with that effect alone.

    Raises:
        UnsuitableError: the effect cannot have such a share.
    """
    power = effect.power
    before = None
    for _ in range(_ROUNDS):
        effect.size = min(effect.size, effect.largest)
        try:
            share = own_share(world.run('near', _PILOT_S, 1, [effect]), world, effect)
        except UnsuitableError:
            effect.size, before = 0.4 * effect.size, None
            continue
        if 0.75 < share / target < 1.33 or (share < target and effect.size >= effect.largest):
            return
        if before is not None and share > 0.0 and before[1] > 0.0 and before[0] != effect.size:
            found = math.log(share / before[1]) / math.log(effect.size / before[0])
            power = min(max(found, 0.3), 6.0)
        before = (effect.size, share)
        step = (target / share) ** (1.0 / power) if share > 1e-9 else 3.0
        effect.size *= min(max(step, 0.2), 4.0)


def _late(recording, v, time_constant):
    """Return a velocity behind a first-order low-pass, samples being joined by lines."""
    dt = np.diff(1e-9 * (recording.stamps_ns - recording.stamps_ns[0]))
    late = np.empty_like(v)
    late[0] = v[0]
    for i, h in enumerate(dt):
        keep, slope = math.exp(-h / time_constant), (v[i + 1] - v[i]) / h
        steady = v[i] - slope * time_constant
        late[i + 1] = steady + slope * h + (late[i] - steady) * keep
    return late
