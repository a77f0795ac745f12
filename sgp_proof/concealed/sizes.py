"""The size of a concealed effect, such that its share of the squared effort is as wanted."""

from __future__ import annotations

import math

import numpy as np

from sgp_proof.concealed.balance import Balance
from sgp_ros.physics.catalogue import VELOCITY_FILTER_LAG
from sgp_ros.physics.drawing import UnsuitableError
from sgp_ros.physics.parts import PLACES

SMALLEST_SHARE = 0.0042
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


def own_share(recording, world, effect):
    """Return the share by which the size of an effect is measured."""
    at = effect.at
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
