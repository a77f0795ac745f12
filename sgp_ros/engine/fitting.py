"""Fits hyper-parameters to a snapshot of the buffer: a pure function, for any process."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sgp_ros.errors import NumericalError
from sgp_ros.gp.kernels import SquaredExponential
from sgp_ros.gp.learning import initial_model, learn, screened
from sgp_ros.gp.model import CoefficientPrior, Model, Observations
from sgp_ros.gp.posterior import Posterior


@dataclass(frozen=True, slots=True, eq=False)
class FitRequest:
    """Everything a fit needs.

    Attributes:
        number: how many were asked for before.
        data: the buffer.
        base_root, base_target: what prior and dropped samples tell of W, (p, p) and (p,).
        model: hyper-parameters in force, the warm start.
        restarts: starts beside it: the values from the data, then random ones.
        seed: of the random ones.
    """

    number: int
    data: Observations
    base_root: np.ndarray
    base_target: np.ndarray
    model: Model
    restarts: int
    seed: int


@dataclass(frozen=True, slots=True, eq=False)
class FitResult:
    """Outcome of a fit.

    Attributes:
        number: of the request.
        model: the best hyper-parameters found; None where every start failed.
        log_evidence: at these, up to a constant of the snapshot [nat].
        log_evidence_before: at the hyper-parameters of the request [nat].
        evaluations: of the evidence.
    """

    number: int
    model: Model | None
    log_evidence: float
    log_evidence_before: float
    evaluations: int

    @property
    def refusal(self) -> str:
        """Why it is of no use, one of `results.REFIT_REFUSALS`; empty where it is better."""
        if self.model is None or not math.isfinite(self.log_evidence):
            return 'diverged'
        return '' if self.log_evidence > self.log_evidence_before else 'no_better'


def fit(request: FitRequest) -> FitResult:
    """Maximise the evidence of the buffered samples given the dropped ones. O(k n^3) a step."""
    known = np.any(request.base_root != 0.0, axis=1)
    # The constant of the prior's determinant cancels in every comparison on one snapshot.
    prior = CoefficientPrior(request.base_root[known], request.base_target[known], 0.0)
    try:
        before = Posterior(request.model, request.data, prior).log_evidence
    except NumericalError:
        before = -math.inf
    candidates = [(request.model, 0)]
    if request.restarts:
        kernels = request.model.kernels
        inputs = tuple(None if k is None else k.inputs for k in kernels)
        kind = next((type(k) for k in kernels if k is not None), SquaredExponential)
        fresh = screened(request.data, prior, initial_model(request.data, inputs, kernel=kind))
        candidates.append((fresh, request.restarts - 1))
    best, lowest, evaluations = None, -math.inf, 0
    rng = np.random.default_rng((request.seed, request.number))
    for start, restarts in candidates:
        try:
            learned = learn(request.data, prior, start, restarts, rng)
        except NumericalError:
            continue
        evaluations += learned.evaluations
        if learned.log_evidence > lowest:
            best, lowest = learned.model, learned.log_evidence
    return FitResult(request.number, best, lowest, before, evaluations)
