"""Fits hyper-parameters to a snapshot of the buffer: a pure function, for any process.

The evidence trusts the model. Samples that repeat each other, as those of a robot at rest, raise
it without bound where the noise falls to nothing and Z to a length at which nothing is alike: such
a model knows them by heart and nothing else. So a fit has to predict too, each sample from the
others: an output keeps its hyper-parameters where new ones do it worse, or worse than a constant,
and yet claim less noise. Where they claim more, the model before was too sure of itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sgp_ros.errors import NumericalError
from sgp_ros.gp.kernels import SquaredExponential
from sgp_ros.gp.learning import initial_model, learn, screened
from sgp_ros.gp.model import CoefficientPrior, Model, Observations
from sgp_ros.gp.posterior import Posterior

WORSE = 1.1
"""Mean squared error of left-out samples, over that before, from which on a fit predicts worse.

A mean square of 200 independent samples has this relative standard deviation, `sqrt(2 / n)`.
"""


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
        is_worse: whether all of them were refused because they predict worse.
    """

    number: int
    model: Model | None
    log_evidence: float
    log_evidence_before: float
    evaluations: int
    is_worse: bool = False

    @property
    def refusal(self) -> str:
        """Why it is of no use, one of `results.REFIT_REFUSALS`; empty where it is better."""
        if self.model is None or not math.isfinite(self.log_evidence):
            return 'diverged'
        is_better = self.log_evidence > self.log_evidence_before and not self.is_worse
        return '' if is_better else 'no_better'


def fit(request: FitRequest) -> FitResult:
    """Maximise the evidence of the buffered samples given the dropped ones. O(k n^3) a step."""
    known = np.any(request.base_root != 0.0, axis=1)
    # The constant of the prior's determinant cancels in every comparison on one snapshot.
    prior = CoefficientPrior(request.base_root[known], request.base_target[known], 0.0)
    try:
        known_by = Posterior(request.model, request.data, prior)
        before = known_by.log_evidence
    except NumericalError:
        known_by, before = None, -math.inf
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
    is_worse = False
    if best is not None and known_by is not None:
        best, lowest, is_worse = _predicting(best, lowest, known_by)
    return FitResult(request.number, best, lowest, before, evaluations, is_worse)


def _predicting(
    found: Model, log_evidence: float, before: Posterior
) -> tuple[Model | None, float, bool]:
    """Return a fit in which outputs that it predicts worse keep what they had.

    Args:
        found: by the fit.
        log_evidence: of it [nat].
        before: posterior under the hyper-parameters in force.

    Returns:
        The model, its evidence, and whether every output keeps what it had.
    """
    data = before.data
    after, known = (
        _mean_square(posterior.left_out_errors())
        for posterior in (Posterior(found, data, before.prior), before)
    )
    constant = _mean_square(data.y - data.y.mean(axis=0))
    constant *= (1.0 + 1.0 / max(len(data.U) - 1, 1)) ** 2  # which a left-out sample does not know
    is_surer = np.array(found.noise) < np.array(before.model.noise)
    is_worse = is_surer & (after > WORSE * np.minimum(known, constant))
    if not is_worse.any() or is_worse.all():
        return found, log_evidence, bool(is_worse.all())
    old = before.model
    model = Model(
        tuple(a if w else b for w, a, b in zip(is_worse, old.kernels, found.kernels, strict=True)),
        tuple(a if w else b for w, a, b in zip(is_worse, old.noise, found.noise, strict=True)),
    )
    try:
        return model, Posterior(model, data, before.prior).log_evidence, False
    except NumericalError:
        return None, -math.inf, False


def _mean_square(errors: np.ndarray) -> np.ndarray:
    """Return the mean squares of the columns of errors (n, k), NaN for none, (k,)."""
    is_known = np.isfinite(errors)
    total = (np.where(is_known, errors, 0.0) ** 2).sum(axis=0)
    return np.asarray(total / np.where(is_known.any(axis=0), is_known.sum(axis=0), np.nan))
