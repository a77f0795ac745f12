"""Which inputs the process Z should see, decided by evidence.

A stationary Z extrapolates badly along every input that it uses: far from the data it falls back
to zero, or carries on a trend that the length scale allowed. An input that does not raise the
evidence therefore costs accuracy elsewhere for nothing. Starting from all inputs, the one whose
removal costs least is dropped, as long as that costs less than `MARGIN`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sgp_ros.core.learning import initial_model, learn, screened
from sgp_ros.core.model import Model, Observations

if TYPE_CHECKING:
    from sgp_ros.core.kernels import Kernel
    from sgp_ros.core.prior import CoefficientPrior

MARGIN = 3.0
"""Evidence that an input must be worth [nat]: a Bayes factor of twenty."""


@dataclass(frozen=True, slots=True)
class Selection:
    """Inputs chosen for one component of X.

    Attributes:
        inputs: columns of U that Z sees; None where physics and noise explain the data as well.
        evidence: log evidence with these [nat].
        evidence_of_all: with all candidates [nat].
        path: inputs in the order in which they were dropped.
    """

    inputs: tuple[int, ...] | None
    evidence: float
    evidence_of_all: float
    path: tuple[int, ...]


def select_inputs(
    data: Observations,
    prior: CoefficientPrior,
    component: int,
    candidates: tuple[int, ...],
    size: int = 300,
) -> Selection:
    """Choose the inputs of Z for one component of X, observed directly.

    Args:
        data: observations without observation matrix.
        prior: of W.
        component: of X; the others are left out.
        candidates: columns of U to choose from.
        size: most samples used, evenly spaced: the choice needs fewer than the fit.

    Raises:
        ValueError: observations through an observation matrix.
    """
    if data.G is not None:
        raise ValueError('inputs are selected for directly observed components')
    rows = np.unique(np.linspace(0, len(data.y) - 1, min(size, len(data.y))).astype(int))
    part = slice(component, component + 1)
    small = Observations(data.U[rows], data.F[rows, part], data.y[rows, part])
    start = screened(small, prior, initial_model(small, (candidates,)))
    model, evidence = _fit(small, prior, start)
    best, of_all, path = model, evidence, []
    while (kernel := best.kernels[0]) is not None:
        shorter = [_without(best, kernel, i) for i in range(len(kernel.inputs))]
        fits = [_fit(small, prior, candidate) for candidate in shorter]
        least = int(np.argmax([value for _, value in fits]))
        if fits[least][1] < evidence - MARGIN:
            break
        path.append(kernel.inputs[least])
        best, evidence = fits[least][0], max(evidence, fits[least][1])
    kernel = best.kernels[0]
    return Selection(None if kernel is None else kernel.inputs, evidence, of_all, tuple(path))


def _fit(data: Observations, prior: CoefficientPrior, start: Model) -> tuple[Model, float]:
    learned = learn(data, prior, start)
    return learned.model, learned.log_evidence


def _without(model: Model, kernel: Kernel, index: int) -> Model:
    """Return the model whose kernel lacks one input; without the last one there is no Z."""
    shorter = kernel.without(index) if len(kernel.inputs) > 1 else None
    return Model((shorter,), model.noise)
