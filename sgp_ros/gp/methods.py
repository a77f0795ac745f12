"""The four methods of the paper behind one interface: PR, GP, PRGP, SGP.

Each takes observations, learns its hyper-parameters by evidence, and gives back something that
predicts X with a covariance. PR is Z = 0 (section III.C), GP is W = 0 (section III.B), PRGP fits
the physics first and a process to what it leaves (the two-step baseline of section IV.A), SGP
infers both jointly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.gp.learning import TOLERANCE, initial_model, learn, screened
from sgp_ros.gp.model import CoefficientPrior, Model, Observations
from sgp_ros.gp.posterior import Posterior, Prediction


@dataclass(frozen=True, slots=True)
class FitOptions:
    """How hyper-parameters are learned.

    Attributes:
        rule: starting values: `paper` as printed there; `standardised` the best of nine around
            the standard deviations.
        restarts: random starts beside that one.
        seed: of these.
        start: hyper-parameters of a like fit, from which SGP starts in place of the rule.
        tolerance: relative change of the evidence at which a search ends.
    """

    rule: str = 'standardised'
    restarts: int = 0
    seed: int = 0
    start: Model | None = None
    tolerance: float = TOLERANCE


@dataclass(frozen=True, slots=True, eq=False)
class FittedMethod:
    """A method after learning.

    Attributes:
        physics: posterior that sees the regressor; None for GP.
        process: posterior without regressor on top of `physics`; None for PR and SGP.
        log_evidence: of the last stage [nat].
    """

    physics: Posterior | None
    process: Posterior | None
    log_evidence: float

    @property
    def model(self) -> Model:
        """Hyper-parameters of the stage that holds Z, or of PR."""
        stage = self.process or self.physics
        assert stage is not None
        return stage.model

    @property
    def coefficients(self) -> np.ndarray:
        """Posterior mean of W, (p,); empty for GP."""
        return np.zeros(0) if self.physics is None else self.physics.coefficients

    def predict(self, U: np.ndarray, F: np.ndarray) -> Prediction:
        """Predict X at inputs U (q, d) with regressors F (q, k, p).

        PRGP adds the means; its covariance is that of the process alone, since the second step
        takes the parameters of the first for known.
        """
        if self.process is None:
            assert self.physics is not None
            return self.physics.predict(U, F)
        prediction = self.process.predict(U, F[:, :, :0])
        if self.physics is None:
            return prediction
        mean = prediction.mean + F @ self.physics.coefficients
        return Prediction(mean, prediction.covariance)

    def predict_observed(
        self, U: np.ndarray, F: np.ndarray, G: np.ndarray | None = None
    ) -> Prediction:
        """Predict Y = g X + V, noise included."""
        return self.predict(U, F).observed(np.array(self.model.noise), G)


Inputs = tuple[tuple[int, ...] | None, ...]
Method = Callable[[Observations, CoefficientPrior, Inputs, FitOptions], FittedMethod]


def fit_pr(
    data: Observations, prior: CoefficientPrior, inputs: Inputs, options: FitOptions
) -> FittedMethod:
    """Parametric regression: Z = 0, noise by evidence."""
    posterior, evidence = _learn(data, prior, (None,) * len(inputs), options)
    return FittedMethod(posterior, None, evidence)


def fit_gp(
    data: Observations, prior: CoefficientPrior, inputs: Inputs, options: FitOptions
) -> FittedMethod:
    """Gaussian process alone: W = 0.

    Components that are observed directly then have nothing in common: the search for the
    hyper-parameters of each ends when it has converged, not when all have. Alone it ends in a
    poor maximum more often: it starts from a random perturbation too.
    """
    del prior
    none, bare = CoefficientPrior.flat(0), replace(data, F=data.F[:, :, :0])
    start = _start(bare, none, inputs, options)
    if data.G is not None:
        posterior, evidence = _learn(bare, none, inputs, options, start)
        return FittedMethod(None, posterior, evidence)
    options = replace(options, restarts=max(options.restarts, 1))
    models, evidence = [], 0.0
    for j, own in enumerate(zip(start.kernels, start.noise, strict=True)):
        one = slice(j, j + 1)
        alone = replace(bare, F=bare.F[:, one], y=bare.y[:, one])
        posterior, gained = _learn(alone, none, inputs[one], options, Model(own[:1], own[1:]))
        models.append(posterior.model)
        evidence += gained
    whole = Model(tuple(m.kernels[0] for m in models), tuple(m.noise[0] for m in models))
    return FittedMethod(None, Posterior(whole, bare, none), evidence)


def fit_prgp(
    data: Observations, prior: CoefficientPrior, inputs: Inputs, options: FitOptions
) -> FittedMethod:
    """Two steps: parametric regression, then a process on its residual."""
    first = fit_pr(data, prior, inputs, options)
    explained = data.F @ first.coefficients  # (n, k)
    if data.G is not None:
        explained = np.einsum('nmk,nk->nm', data.G, explained)
    second = fit_gp(replace(data, y=data.y - explained), prior, inputs, options)
    return FittedMethod(first.physics, second.process, second.log_evidence)


def fit_sgp(
    data: Observations, prior: CoefficientPrior, inputs: Inputs, options: FitOptions
) -> FittedMethod:
    """Semi-parametric Gaussian process: W and Z jointly."""
    posterior, evidence = _learn(data, prior, inputs, options, options.start)
    return FittedMethod(posterior, None, evidence)


METHODS: dict[str, Method] = {'PR': fit_pr, 'GP': fit_gp, 'PRGP': fit_prgp, 'SGP': fit_sgp}


def _learn(
    data: Observations,
    prior: CoefficientPrior,
    inputs: Inputs,
    options: FitOptions,
    start: Model | None = None,
) -> tuple[Posterior, float]:
    if start is None:
        start = _start(data, prior, inputs, options)
    rng = np.random.default_rng(options.seed)
    learned = learn(data, prior, start, options.restarts, rng, tolerance=options.tolerance)
    return Posterior(learned.model, data, prior), learned.log_evidence


def _start(
    data: Observations, prior: CoefficientPrior, inputs: Inputs, options: FitOptions
) -> Model:
    start = initial_model(data, inputs, options.rule)
    return start if options.rule == 'paper' else screened(data, prior, start)
