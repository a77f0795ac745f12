"""Selection of the inputs that the process Z sees, smooth or linear in them, by evidence.

A stationary Z extrapolates badly along every input that it uses: far from the data it falls back
to zero, or carries on a trend that the length scale allowed. An input that does not raise the
evidence therefore costs accuracy elsewhere for nothing. Starting from all inputs, the one whose
removal costs least is dropped, as long as that costs less than `MARGIN`. Then Z is taken for a
linear function of what is left, where that raises the evidence: a squared exponential can only
imitate one by long length scales and a large free constant, which it carries into regions
without data.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.errors import NumericalError
from sgp_ros.gp.kernel import Kernel
from sgp_ros.gp.kernels import Linear
from sgp_ros.gp.learning import initial_model, learn, screened
from sgp_ros.gp.model import CoefficientPrior, Model, Observations

MARGIN = 3.0
"""Evidence that an input must be worth [nat]: a Bayes factor of twenty."""
_LOUDER = 10.0
"""Factor by which the noise of a start grows whose covariance has no factor."""


@dataclass(frozen=True, slots=True)
class Selection:
    """Inputs and structure chosen for one component of X.

    Attributes:
        kernel: of Z, as learned on the samples used; None where physics and noise explain the
            data as well.
        noise: variance learned beside it.
        evidence: log evidence with these [nat].
        evidence_of_all: with all candidates [nat].
        path: inputs in the order in which they were dropped.
    """

    kernel: Kernel | None
    noise: float
    evidence: float
    evidence_of_all: float
    path: tuple[int, ...]

    @property
    def inputs(self) -> tuple[int, ...] | None:
        """Columns of U that Z sees; None without Z."""
        return None if self.kernel is None else self.kernel.inputs


def select_inputs(
    data: Observations,
    prior: CoefficientPrior,
    component: int,
    candidates: tuple[int, ...],
    size: int = 300,
) -> Selection:
    """Choose inputs and structure of Z for one component of X, observed directly.

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
    model, of_all = _fit(small, prior, start)
    best, evidence, path = _eliminate(small, prior, model, of_all)
    if best.kernels[0] is not None:
        linear, value = _fit_linear(small, prior, best)
        if value > evidence:
            best, evidence, more = _eliminate(small, prior, linear, value)
            path += more
    return Selection(best.kernels[0], best.noise[0], evidence, of_all, tuple(path))


def _eliminate(
    data: Observations, prior: CoefficientPrior, model: Model, evidence: float
) -> tuple[Model, float, list[int]]:
    """Drop inputs one by one; return the model, its evidence, and the inputs dropped."""
    path = []
    while (kernel := model.kernels[0]) is not None:
        shorter = [_without(model, kernel, i) for i in range(len(kernel.inputs))]
        fits = [_fit(data, prior, candidate) for candidate in shorter]
        least = int(np.argmax([value for _, value in fits]))
        if fits[least][1] < evidence - MARGIN:
            break
        path.append(kernel.inputs[least])
        model, evidence = fits[least][0], max(evidence, fits[least][1])
    return model, evidence, path


def _fit_linear(data: Observations, prior: CoefficientPrior, model: Model) -> tuple[Model, float]:
    """Fit Z as a linear function of the inputs that the model's Z sees."""
    kernel = model.kernels[0]
    assert kernel is not None
    lengths = data.U[:, kernel.inputs].std(axis=0) / data.y.std()
    usual = tuple(float(x) if x > 0.0 else 1.0 for x in lengths)
    start = Model((Linear(usual, kernel.inputs),), model.noise)
    return _fit(data, prior, screened(data, prior, start))


def _fit(data: Observations, prior: CoefficientPrior, start: Model) -> tuple[Model, float]:
    """Fit from a start, with more noise where so little leaves the covariance no factor.

    What an input explained is noise without it.
    """
    try:
        learned = learn(data, prior, start)
    except NumericalError:
        noise = _LOUDER * start.noise[0]
        if not 0.0 < noise < data.y.var():
            raise
        return _fit(data, prior, replace(start, noise=(noise,)))
    return learned.model, learned.log_evidence


def _without(model: Model, kernel: Kernel, index: int) -> Model:
    """Return the model whose kernel lacks one input; without the last one there is no Z."""
    shorter = kernel.without(index) if len(kernel.inputs) > 1 else None
    return Model((shorter,), model.noise)
