"""Results of recordings of a robot whose friction wears, without the recordings: drawn estimates.

A robot is switched on each day, warms up and is recorded some times. Every friction is higher when
cold, differs from day to day and scatters beyond its interval; one of them may grow from some
recording on. The fit is given only what a real campaign would have.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sgp_proof.result_files import read_result

QUANTITIES = (('shoulder', 'viscous'), ('shoulder', 'coulomb'), ('elbow', 'viscous'),
              ('elbow', 'coulomb'))  # fmt: skip
WORN = ('elbow', 'coulomb')
LEVEL, LENGTH_S = 0.3, 60.0
HOUR_NS = 3600 * 10**9
DAY_NS = 24 * HOUR_NS


@dataclass(frozen=True)
class World:
    """How estimates come about; all but the counts are relative to the level.

    Attributes:
        recordings: in all.
        warm_up: excess when cold.
        tau_h: in which it fades [h].
        day: standard deviation from day to day.
        scatter: from recording to recording.
        std: smallest and largest standard deviation of an estimate.
        growth: of the worn friction, in the end.
        ramp: recordings over which it grows; 0 for at once.
        per_day: fewest and most recordings of a day.
    """

    recordings: int = 1000
    warm_up: float = 0.2
    tau_h: float = 0.75
    day: float = 0.01
    scatter: float = 0.01
    std: tuple[float, float] = (0.015, 0.04)
    growth: float = 0.1
    ramp: int = 0
    per_day: tuple[int, int] = (4, 12)


def measured(path):
    """Return what other measurements of a campaign have left in a result file."""
    return {k: v for k, v in read_result(path).items() if k not in {'schema', 'environment'}}


def draw_results(world, seed, begin=None):
    """Return results as a campaign keeps them; the friction grows from recording `begin` on."""
    rng = np.random.default_rng(seed)
    starts, ages, days = _calendar(world, rng)
    n = len(starts)
    middle_h = ages + 0.5 * LENGTH_S / 3600.0
    cold = world.warm_up * np.exp(-middle_h / world.tau_h)
    values, stds = {}, {}
    for quantity in QUANTITIES:
        each_day = world.day * rng.standard_normal(days[-1] + 1)
        wear = np.zeros(n)
        if quantity == WORN and begin is not None:
            wear = world.growth * np.clip((np.arange(n) - begin + 1) / max(world.ramp, 1), 0, 1)
        stds[quantity] = LEVEL * rng.uniform(*world.std, n)
        true = LEVEL * (1 + wear + cold + each_day[days] + world.scatter * rng.standard_normal(n))
        values[quantity] = true + stds[quantity] * rng.standard_normal(n)
    return [
        {
            'recording': f'{i:04d}.mcap', 'start_ns': int(starts[i]), 'duration_s': LENGTH_S,
            'robot': 'arm', 'session': None, 'covariates': {}, 'versions': '',
            'tasks': {'identify': {'rows': [
                {'kind': 'coefficient', 'joint': joint, 'parameter': f'{joint}.{name}',
                 'value': float(values[joint, name][i]), 'std': float(stds[joint, name][i]),
                 'unit': 'N m'}
                for joint, name in QUANTITIES
            ]}},
        }
        for i in range(n)
    ]  # fmt: skip


def _calendar(world, rng):
    """Return start [ns], age [h] and day of recordings: some a day, at uneven distances."""
    n = world.recordings
    starts, ages, days = [], [], []
    day = 0
    while len(starts) < n:
        hours = np.cumsum(
            rng.uniform(0.2, 0.8, rng.integers(world.per_day[0], world.per_day[1] + 1))
        )
        hours -= hours[0]
        starts += (day * DAY_NS + 8 * HOUR_NS + (hours * HOUR_NS).astype(np.int64)).tolist()
        ages += hours.tolist()
        days += [day] * len(hours)
        day += 1
    epoch = 1_760_000_000 * 10**9
    return epoch + np.array(starts[:n]), np.array(ages[:n]), np.array(days[:n])
