"""On which variables the discrepancy of a joint depends, judged on stretches left out.

The discrepancy is averaged over bins of each variable, apart for both directions of motion, on
five sixths of the time; the score is the share of its mean square that the averages explain on
the last sixth, over all six.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sgp_ros.diagnosis.result import Dependence

if TYPE_CHECKING:
    from sgp_ros.diagnosis.compare.equations import Equations

BINS, STRETCHES = 16, 24


def dependences(equations: Equations, residual: np.ndarray) -> tuple[Dependence, ...]:
    """Return the dependence of each joint's discrepancy (N, k) on the motion."""
    motion, low = equations.motion, equations.filter
    names = motion.tree.moving_names
    q, v, u = motion.wrapped[low.rows], low(motion.velocity), low(motion.effort)
    share = (residual**2).mean(axis=0) / equations.power
    result = []
    for j, name in enumerate(names):
        variables = {'position': q[:, j], 'velocity': v[:, j]}
        if motion.tree.is_actuated[j]:
            variables['effort'] = u[:, j]
        for i, other in enumerate(names):
            if i != j:
                variables[f'position of {other}'] = q[:, i]
                variables[f'velocity of {other}'] = v[:, i]
        variables['time'] = equations.time
        direction = (v[:, j] > 0).astype(int)
        scores = {
            variable: _score(x, direction, residual[:, j], is_time=variable == 'time')
            for variable, x in variables.items()
        }
        result.append(Dependence(name, float(share[j]), scores))
    return tuple(result)


def _score(x: np.ndarray, direction: np.ndarray, r: np.ndarray, *, is_time: bool) -> float:
    power = float(r @ r)
    if power <= 0.0:
        return 0.0
    edges = np.quantile(x, np.linspace(0.0, 1.0, BINS + 1)[1:-1])
    cell = np.searchsorted(edges, x) * 2 + direction
    if is_time:  # neighbours in time are no test of time: leave out every other half bin
        stretch = (np.arange(len(r)) * 6 * BINS // len(r)) % 6
    else:
        stretch = (np.arange(len(r)) * STRETCHES // len(r)) % 6
    error = 0.0
    for s in range(6):
        out = stretch == s
        count = np.bincount(cell[~out], minlength=2 * BINS)
        total = np.bincount(cell[~out], weights=r[~out], minlength=2 * BINS)
        mean = np.where(count > 3, total / np.maximum(count, 1), 0.0)
        error += float(((r[out] - mean[cell[out]]) ** 2).sum())
    return max(0.0, 1.0 - error / power)
