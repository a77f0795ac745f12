"""One way to fit and score every method on every experiment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from sgp_ros.gp.kernel import Kernel
from sgp_ros.gp.learning import learn
from sgp_ros.gp.methods import METHODS, FitOptions, FittedMethod
from sgp_ros.gp.model import CoefficientPrior, Model, Observations
from sgp_ros.gp.posterior import Posterior
from sgp_ros.gp.scores import coverage95, nlpd, nmse, pit
from sgp_ros.gp.selection import select_inputs

SGP_ALL = 'SGP_all'
"""The choice of the paper: Z sees every input, one length scale each."""
RESTARTS = 0
"""Random starts of every fit beside the screened one; three change no number of the toy by more
than its spread over seeds."""
METHOD_NAMES = ('PR', 'GP', 'PRGP', 'SGP', SGP_ALL)


@dataclass(frozen=True, slots=True, eq=False)
class Test:
    """Queries of one region.

    Attributes:
        data: inputs, regressors and measured targets.
        truth: (n, k) noise-free targets.
    """

    data: Observations
    truth: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """One draw of an experiment.

    Attributes:
        train: what is learned from.
        tests: by region.
        channels: names of the k components.
        candidates: per component, the columns of U that Z could see.
        paper_inputs: the same as the paper has it, where that is less.
        true_coefficients: by index of W, where known.
        size: most samples that a fit uses, evenly spaced.
    """

    train: Observations
    tests: Mapping[str, Test]
    channels: tuple[str, ...]
    candidates: tuple[tuple[int, ...], ...]
    true_coefficients: Mapping[int, float] = field(default_factory=dict)
    size: int = 500
    paper_inputs: tuple[tuple[int, ...], ...] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """Result of one method in one world.

    Attributes:
        scores: region to channel to nmse, nmse_measured, nlpd, coverage95.
        pit: region to (n, k) probability integral transforms of the measured targets.
        means: region to (n, k) predictions.
        errors: relative error of W by index.
        kernels: of Z per component, as learned; None where there was no Z.
    """

    scores: dict[str, dict[str, dict[str, float]]]
    pit: dict[str, np.ndarray]
    means: dict[str, np.ndarray]
    errors: dict[int, float]
    kernels: tuple[Kernel | None, ...]

    @property
    def inputs(self) -> tuple[tuple[int, ...] | None, ...]:
        """Columns Z saw, per component; None where there was no Z."""
        return tuple(None if k is None else k.inputs for k in self.kernels)


def run_method(name: str, world: World, prior: CoefficientPrior | None = None) -> Outcome:
    """Fit one method out of `METHOD_NAMES` to a world and score it on every region."""
    train = thinned(world.train, world.size)
    prior = prior or CoefficientPrior.flat(train.F.shape[2])
    return score(_fit(name, world, train, prior), world)


def score(fitted: FittedMethod, world: World) -> Outcome:
    """Score a fitted method on every region of a world.

    nMSE is against the noise-free truth; NLPD, coverage and PIT are against measured targets.
    """
    scores: dict[str, dict[str, dict[str, float]]] = {}
    transforms, means = {}, {}
    for region, test in world.tests.items():
        seen = fitted.predict_observed(test.data.U, test.data.F)
        measured = test.data.y
        columns = {
            'nmse': nmse(test.truth, seen.mean),
            'nmse_measured': nmse(measured, seen.mean),
            'nlpd': nlpd(measured, seen.mean, seen.variance),
            'coverage95': coverage95(measured, seen.mean, seen.variance),
        }
        scores[region] = {
            channel: {key: float(values[j]) for key, values in columns.items()}
            for j, channel in enumerate(world.channels)
        }
        transforms[region] = pit(measured, seen.mean, seen.variance)
        means[region] = seen.mean
    w = fitted.coefficients
    errors = {i: float(w[i] / true - 1.0) for i, true in world.true_coefficients.items() if len(w)}
    return Outcome(scores, transforms, means, errors, fitted.model.kernels)


def thinned(data: Observations, size: int) -> Observations:
    """Return at most `size` observations, evenly spaced."""
    if len(data.y) <= size:
        return data
    rows = np.unique(np.linspace(0, len(data.y) - 1, size).astype(int))
    return type(data)(data.U[rows], data.F[rows], data.y[rows])


def _fit(name: str, world: World, train: Observations, prior: CoefficientPrior) -> FittedMethod:
    if name != 'SGP':
        method = METHODS['SGP' if name == SGP_ALL else name]
        inputs = world.candidates
        if name == SGP_ALL and world.paper_inputs is not None:
            inputs = world.paper_inputs
        return method(train, prior, inputs, FitOptions(restarts=RESTARTS))
    chosen = [
        select_inputs(train, prior, j, columns) for j, columns in enumerate(world.candidates)
    ]
    start = Model(tuple(s.kernel for s in chosen), tuple(s.noise for s in chosen))
    learned = learn(train, prior, start, RESTARTS, np.random.default_rng(0))
    posterior = Posterior(learned.model, train, prior)
    return FittedMethod(posterior, None, learned.log_evidence)
