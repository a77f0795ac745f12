"""Which inputs Z sees, decided on held-out stretches of time.

Evidence takes the noise for white. What the physics of a real machine leaves is not: it changes
slowly, and a process that may bend at will follows it, at the price of what it says elsewhere. So
sets of inputs compete by their squared error on stretches that were not learned from. No process
at all is one of them, and stands unless another is better by more than a hundredth in sum, and by
a t-test on the logarithms of the errors over the stretches, at a level of 5 % for all candidates.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from sgp_ros.batch.fit import OfflineOptions, fit_offline
from sgp_ros.batch.regression_data import FilteredData
from sgp_ros.gp.methods import FitOptions, Inputs
from sgp_ros.robots.robot import Robot

CANDIDATES: tuple[tuple[str, ...], ...] = (
    (),
    ('own:direction',),
    ('own:velocity', 'own:direction'),
    ('own:position', 'own:direction'),
    ('own:position', 'own:velocity', 'own:direction'),
)
"""Sets of inputs of a joint that compete; the first one means no process."""
_FOLDS, _STRETCHES, _LEVEL = 4, 3, 0.05
_LEAST_GAIN = 0.01  # of the squared error without a process
_EQUAL = 1.02
"""Errors within 2 % are equal: the first, smallest set is taken."""
_OPTIONS = OfflineOptions(
    max_points=300, max_basis=200, learning=FitOptions(tolerance=1e-6)
)  # fmt: skip
"""The evidence, thousands of nats, is sought to a hundredth of one: errors are compared to 2 %."""


@dataclass(frozen=True, slots=True, eq=False)
class InputChoice:
    """Inputs of Z per joint, and what they were chosen from.

    Attributes:
        inputs: per joint the columns of U; None where no process predicts best.
        names: the same in words.
        errors: (candidates, k) mean squared error on held-out stretches over the variance of the
            target, or in its unit squared where it is constant, in the order of `CANDIDATES`.
    """

    inputs: Inputs
    names: tuple[tuple[str, ...], ...]
    errors: np.ndarray


def choose_inputs(data: FilteredData, robot: Robot) -> InputChoice:
    """Choose per joint by held-out stretches of time.

    The time is cut into twelve stretches; each of four folds holds out every fourth one. Joints
    are chosen one by one from fits in which all have the same candidate: W alone couples them.

    Args:
        data: that is learned from.
        robot: whose Z it is.
    """
    n = len(data.time)
    stretch = np.arange(n) * (_FOLDS * _STRETCHES) // n
    columns: list[Inputs] = [
        robot.residual_columns(names) if names else (None,) * len(robot.joints)
        for names in CANDIDATES
    ]
    squares = np.zeros((len(CANDIDATES), _FOLDS * _STRETCHES, data.y.shape[1]))
    options = [_OPTIONS] * len(CANDIDATES)
    for fold in range(_FOLDS):
        is_held = stretch % _FOLDS == fold
        known, asked = data.rows(~is_held), data.rows(is_held)
        for i, candidate in enumerate(columns):
            fit = fit_offline(known, robot, 'SGP', candidate, options[i])
            learning = replace(_OPTIONS.learning, start=fit.model)  # most rows are the same
            options[i] = replace(_OPTIONS, learning=learning)
            error = (fit.predict(asked)[0] - asked.y) ** 2
            np.add.at(squares[i], stretch[is_held], error)
    spread = data.y.var(axis=0)
    squares /= n * np.where(spread > 0.0, spread, 1.0)  # the effort of a passive joint is zero
    errors = squares.sum(axis=1)
    best = _chosen(squares)
    return InputChoice(
        tuple(columns[b][j] for j, b in enumerate(best)),
        tuple(CANDIDATES[b] for b in best),
        errors,
    )


def _chosen(squares: np.ndarray) -> np.ndarray:
    """Return the index of the candidate per joint, from errors (candidates, stretches, k)."""
    total = squares.sum(axis=1)
    gain = np.log(squares[0] / np.maximum(squares, np.finfo(float).tiny))
    count = gain.shape[1]
    doubt = gain.std(axis=1, ddof=1) * np.sqrt(count)
    level = _LEVEL / (len(CANDIDATES) - 1)  # Bonferroni
    is_better = gain.sum(axis=1) > special.stdtrit(count - 1, 1.0 - level) * doubt
    is_better &= total < (1.0 - _LEAST_GAIN) * total[0]
    is_better[0] = True
    errors = np.where(is_better, total, np.inf)
    return np.asarray((errors <= _EQUAL * errors.min(axis=0)).argmax(axis=0))
