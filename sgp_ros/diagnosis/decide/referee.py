"""The process Z as a referee: how much of what a model leaves could still be physics.

What the motion of the robot foretells on stretches left out, or what the rest foretells of itself,
is structure that an adequate model would have. What neither foretells is noise, however large. Z
sees the motion and not the efforts: where friction takes all of an effort, that effort would
explain itself. What the rest foretells of itself is measured by linear prediction from rows
before; white noise behind the filter is foretold too, by as much as its correlations say
(Makhoul 1975), and that is taken off.
"""

from __future__ import annotations

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.locate.remainder import foretold, observations, process_inputs, spread
from sgp_ros.diagnosis.parts import PARTS, parts_of
from sgp_ros.gp.learning import initial_model, learn, screened
from sgp_ros.gp.model import CoefficientPrior

LEAST_ROWS = 5 * PARTS
"""Rows below which the referee has no opinion."""
LOOKED_AT = 0.1
"""Joints that leave less than this, relative to the worst one, are not worth a look."""
ORDER = 8
"""Rows before that may foretell one."""
LEARNED = 200
"""Rows for the hyper-parameters."""


def structure(equations: Equations, residual: np.ndarray) -> np.ndarray:
    """Return the share of each joint's rest that is not noise, (k,), with its uncertainty.

    The greater of what Z and what earlier rows explain on parts left out, plus `1/sqrt(N)` for
    N rows; 1 where no opinion was asked or can be had.

    Args:
        equations: of the recording.
        residual: of a model, (N, k) [N m or N].
    """
    N, k = residual.shape
    share = (residual**2).mean(axis=0) / equations.power
    found = np.ones(k)
    if N < LEAST_ROWS:
        return found
    for j in np.flatnonzero(share > max(LOOKED_AT * float(share.max()), 1e-300)):
        r = residual[:, j]
        told = max(_by_motion(equations, r, int(j)), _by_past(equations, r), 0.0)
        found[j] = min(1.0, told + 1.0 / np.sqrt(N))
    return found


def _by_past(equations: Equations, r: np.ndarray) -> float:
    """Return the share of r (N,) that rows before explain, beyond what they do of white noise."""
    order = min(ORDER, len(r) // 10)
    rows = len(r) - order
    past = np.column_stack([r[order - i - 1 : order - i - 1 + rows] for i in range(order)])
    now, part = r[order:], parts_of(rows)
    error = 0.0
    for i in range(PARTS):
        out = part == i
        c = np.linalg.lstsq(past[~out], now[~out], rcond=1e-6)[0]
        error += float(((now[out] - past[out] @ c) ** 2).sum())
    white = equations.filter.correlations(order)
    gram = white[np.abs(np.subtract.outer(np.arange(order), np.arange(order)))]
    least = 1.0 - float(white[1:] @ np.linalg.lstsq(gram, white[1:], rcond=1e-6)[0])
    return 1.0 - error / float(now @ now) / max(least, 1e-6)


def _by_motion(equations: Equations, r: np.ndarray, joint: int) -> float:
    """Return the share of r (N,) that Z of the motion explains on parts left out."""
    inputs, names = process_inputs(equations.motion, joint)
    seen = [i for i, name in enumerate(names) if not name.startswith('effort')]
    U = equations.filter(inputs[:, seen])
    U = U / (U.std(axis=0) + 1e-12)
    part = parts_of(len(r))
    rows = spread(np.flatnonzero(part > 0), LEARNED)
    prior, data = CoefficientPrior.flat(0), observations(U, r, rows)
    start = screened(data, prior, initial_model(data, (tuple(range(U.shape[1])),)))
    return foretold(learn(data, prior, start).model, U, r, part)
