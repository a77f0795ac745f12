"""Held-out stretches of time, and how far they lie from what was learned.

Rows next to each other share a filter and a motion, so single rows left out at random would be
predicted by their neighbours. Whole stretches are held out instead.
"""

from __future__ import annotations

import numpy as np
from scipy import spatial

from sgp_ros.batch.regression_data import FilteredData
from sgp_ros.errors import ConfigError

KINDS = ('tail', 'alternate')


def holdout(
    data: FilteredData, kind: str = 'tail', share: float = 0.4, length_s: float = 6.0
) -> tuple[FilteredData, FilteredData]:
    """Split data in time.

    Args:
        data: n rows.
        kind: `tail` holds out the end, `alternate` every so many of consecutive stretches.
        share: of the rows that is held out, between 0 and 1.
        length_s: of a stretch, for `alternate` [s].

    Returns:
        what to learn from, and what is held out; neither is empty.

    Raises:
        ConfigError: a kind or share that does not exist, or data too short for the stretches.
    """
    if kind not in KINDS:
        raise ConfigError(f'hold-out {kind!r}', f'one of {list(KINDS)}')
    if not 0.0 < share < 1.0:
        raise ConfigError(f'hold-out share {share:g}', 'a share between 0 and 1')
    if not length_s > 0.0:
        raise ConfigError(f'hold-out in stretches of {length_s:g} s', 'a length above 0 s')
    n = len(data.time)
    if kind == 'tail':
        is_held = np.arange(n) >= round((1.0 - share) * n)
    else:
        stretch = (np.arange(n) / data.rate // length_s).astype(int)  # (n,) in recorded time
        is_held = np.floor((stretch + 1) * share) > np.floor(stretch * share)
    if is_held.all() or not is_held.any():
        raise ConfigError(
            f'{n} rows of data cannot be divided, hold-out {kind} of {share:g}',
            'rows in both parts'
            + (f', in stretches of {length_s:g} s' if kind == 'alternate' else ''),
            'use a longer recording, another share or shorter stretches',
        )
    return data.rows(~is_held), data.rows(is_held)


def distance_to(train: FilteredData, test: FilteredData) -> np.ndarray:
    """Return how far each row of `test` lies from the nearest state of `train`, (n,).

    Positions and velocities, each divided by its standard deviation in `train`; Euclidean over
    the 2 k of them divided by `sqrt(2 k)`, so that 1 is one standard deviation per coordinate.
    What does not vary in `train` is compared in SI units. O((n + m) log m) for few joints.
    """
    known, asked = _states(train), _states(test)
    spread = known.std(axis=0)
    spread = np.where(spread > 0.0, spread, 1.0)
    tree = spatial.cKDTree(known / spread)
    distance, _ = tree.query(asked / spread)
    return np.asarray(distance / np.sqrt(known.shape[1]))


def _states(data: FilteredData) -> np.ndarray:
    return np.hstack([data.motion.position, data.motion.velocity])
