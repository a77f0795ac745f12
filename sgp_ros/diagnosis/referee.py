"""The process Z as a referee: how much of what a model leaves could still be physics.

What the motion of the robot foretells on stretches left out, or what the rest foretells of itself
from one row to the next, is structure that an adequate model would have. What neither foretells
is noise, however large. Z sees the motion and not the efforts: where friction takes all of an
effort, that effort would explain itself.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sgp_ros.core.learning import initial_model, learn, screened
from sgp_ros.core.model import Observations
from sgp_ros.core.posterior import Posterior
from sgp_ros.core.prior import CoefficientPrior
from sgp_ros.diagnosis.remainder import process_inputs
from sgp_ros.diagnosis.second_opinion import PARTS, parts_of

if TYPE_CHECKING:
    from sgp_ros.core.model import Model as Hyperparameters
    from sgp_ros.diagnosis.equations import Equations

LEAST_ROWS = 5 * PARTS
"""Rows below which the referee has no opinion."""
LOOKED_AT = 0.1
"""Joints that leave less than this, relative to the worst one, are not worth a look."""
LEARNED, CONDITIONED = 200, 500
"""Rows for the hyper-parameters and for each prediction."""


def structure(equations: Equations, residual: np.ndarray) -> np.ndarray:
    """Return the share of each joint's rest that is not noise, (k,), with its uncertainty.

    The greater of what Z explains on parts left out and of the square of the correlation from one
    row to the next, beyond that of filtered white noise, plus `1/sqrt(N)` for N rows; 1 where no
    opinion was asked or can be had.

    Args:
        equations: of the recording.
        residual: of a model, (N, k) [N m or N].
    """
    N, k = residual.shape
    share = (residual**2).mean(axis=0) / equations.power
    found, white = np.ones(k), equations.filter.correlation
    if N < LEAST_ROWS:
        return found
    for j in np.flatnonzero(share > max(LOOKED_AT * float(share.max()), 1e-300)):
        r = residual[:, j]
        own = (float(r[1:] @ r[:-1]) / float(r @ r) - white) / (1.0 - white)
        told = max(_explained(equations, r, int(j)), max(own, 0.0) ** 2, 0.0)
        found[j] = min(1.0, told + 1.0 / np.sqrt(N))
    return found


def _explained(equations: Equations, r: np.ndarray, joint: int) -> float:
    """Return the share of r (N,) that Z of the motion explains on parts left out."""
    inputs, names = process_inputs(equations.motion, joint)
    seen = [i for i, name in enumerate(names) if not name.startswith('effort')]
    U = equations.filter(inputs[:, seen])
    U = U / (U.std(axis=0) + 1e-12)
    part = parts_of(len(r))
    rows = _spread(np.flatnonzero(part > 0), LEARNED)
    prior, data = CoefficientPrior.flat(0), _observations(U, r, rows)
    start = screened(data, prior, initial_model(data, (tuple(range(U.shape[1])),)))
    model = learn(data, prior, start).model
    error = sum(_error(model, prior, U, r, part == i) for i in range(PARTS))
    return 1.0 - float(error) / float(r @ r)


def _error(
    model: Hyperparameters, prior: CoefficientPrior, U: np.ndarray, r: np.ndarray, out: np.ndarray
) -> float:
    """Return the sum of squared errors on the rows that are out."""
    known = _observations(U, r, _spread(np.flatnonzero(~out), CONDITIONED))
    there = U[out]
    mean = Posterior(model, known, prior).predict(there, np.zeros((len(there), 1, 0))).mean[:, 0]
    return float(((r[out] - mean) ** 2).sum())


def _spread(rows: np.ndarray, count: int) -> np.ndarray:
    """Return at most `count` of the rows, evenly spread."""
    chosen = np.linspace(0, len(rows) - 1, min(count, len(rows)))
    return np.asarray(rows[np.unique(chosen.astype(int))])


def _observations(U: np.ndarray, r: np.ndarray, rows: np.ndarray) -> Observations:
    return Observations(U[rows], np.zeros((len(rows), 1, 0)), r[rows, None])
