"""Blocks of columns in a matrix whose columns have no names, told by their numbers.

Data for inverse dynamics are often one matrix: positions of all joints, then their velocities,
perhaps their accelerations, then their efforts. A block that is the derivative of the one before
it is no coincidence at every joint. What follows the derivatives can only be said to be efforts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from sgp_ros.recordings.column_names import EFFORT, OTHER, POSITION, VELOCITY
from sgp_ros.recordings.table_entries import Entry, Guess, JointHint

_WORDS = {
    POSITION: 'positions', VELOCITY: 'velocities', OTHER: 'accelerations', EFFORT: 'efforts',
}  # fmt: skip
_LEAST = 0.8
"""Correlation of a derivative with the change of what it is one of. Convention."""
_NEAR = 1.4
"""Factor within which its size is that of the change. Convention."""
_FEW = 50
"""Rows below which a correlation tells nothing."""


def of_blocks(
    entries: Sequence[Entry], hints: Sequence[JointHint], seconds: np.ndarray, guess: Guess
) -> list[Entry]:
    """Return entries in which the blocks of the only matrix have their quantities.

    Args:
        entries: of the table.
        hints: joints of the robot; none where it is not known.
        seconds: (n,) [s].
        guess: that is told.
    """
    found = [*entries]
    columns = {e.column for e in entries if e.index is not None}
    if len(columns) != 1 or any(e.said.role == POSITION for e in entries):
        return found
    parts = [e for e in entries if e.index is not None]
    values = np.column_stack([e.numbers for e in parts])  # (n, columns)
    for blocks in (4, 3):
        k, left = divmod(len(parts), blocks)
        if left or (hints and k != len(hints)):
            continue
        roles = _roles(np.split(values, blocks, axis=1), seconds)
        if not roles:
            continue
        said = ', '.join(
            f'{i * k} to {i * k + k - 1} are {_WORDS[r]}' for i, r in enumerate(roles)
        )
        guess.unsure.append(f'The columns of {parts[0].column} have no names: {said} of {k} '
                            'joints, judging by their changes.')  # fmt: skip
        named = [
            replace(e, said=replace(e.said, role=roles[i // k], is_target=False), label=str(i % k))
            for i, e in enumerate(parts)
        ]
        return [e for e in entries if e.index is None] + named
    return found


def _roles(blocks: Sequence[np.ndarray], seconds: np.ndarray) -> list[str]:
    """Return the quantity of each block (n, k); none if they are no motion with efforts."""
    changes = [_is_change(b, a, seconds) for a, b in pairwise(blocks)]
    if changes != [*[True] * (len(blocks) - 2), False]:
        return []
    return [POSITION, VELOCITY, *[OTHER] * (len(blocks) - 3), EFFORT]


def _is_change(rate: np.ndarray, value: np.ndarray, seconds: np.ndarray) -> bool:
    """Return whether a block (n, k) is the derivative of another at each joint that moves."""
    step = np.diff(seconds)
    good = (step > 0.0) & np.isfinite(np.diff(value, axis=0) + rate[1:] + rate[:-1]).all(axis=1)
    change = np.diff(value, axis=0)[good] / step[good, None]
    mean = 0.5 * (rate[1:] + rate[:-1])[good]
    both, power = (change * mean).sum(axis=0), (change**2).sum(axis=0)
    moves = power > 0.0
    if good.sum() < _FEW or not moves.any():
        return False
    slope = both[moves] / power[moves]
    alike = both[moves] / np.sqrt(power[moves] * np.maximum((mean**2).sum(axis=0)[moves], 1e-300))
    near = (slope > 1.0 / _NEAR) & (slope < _NEAR)
    return bool((near & (alike > _LEAST)).all())
