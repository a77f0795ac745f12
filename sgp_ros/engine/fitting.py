"""Fits hyper-parameters to a snapshot of the buffer: a pure function, for any process.

The evidence trusts the model. Samples that repeat each other, as those of a robot at rest, raise
it without bound as the noise falls to zero and Z to a length scale at which no two inputs are
correlated: such a model memorises the samples and predicts nothing else. So a fit has to predict
too, each stretch of the buffer from the others. If it predicts an output worse than before, or
worse than a constant, and yet claims less noise, the output takes the next best fit or keeps its
hyper-parameters. If it claims more noise, the earlier model was overconfident. Whole stretches are
left out because neighbours in time are correlated: their windows overlap, and a robot at rest
repeats itself.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.errors import NumericalError
from sgp_ros.gp.blocks import build_blocks
from sgp_ros.gp.information import marginal_equations
from sgp_ros.gp.kernels import SquaredExponential
from sgp_ros.gp.learning import LearnedModel, initial_model, learn, screened
from sgp_ros.gp.linear_algebra import svd
from sgp_ros.gp.model import CoefficientPrior, Model, Observations
from sgp_ros.gp.posterior import RANK_TOLERANCE, Posterior

WORSE = 1.1
"""Mean squared error of left-out samples, over that before, from which on a fit predicts worse.

A mean square of 200 independent samples has this relative standard deviation, `sqrt(2 / n)`.
"""
TOGETHER = 10
"""Outputs up to which a fit takes all of them together."""
ROWS = 900
"""Of all outputs that one fit takes in turn, three with a full buffer of 300, so that fits of more
joints take no more time; measured by `sgp_proof.streams.many_joints`."""
STRETCHES = 10
"""Into which the buffer is cut; each is predicted from the others."""


@dataclass(frozen=True, slots=True, eq=False)
class FitRequest:
    """Everything a fit needs.

    Attributes:
        number: how many were asked for before.
        data: the buffer.
        base_root, base_target: information of prior and dropped samples on W, (p, p) and (p,).
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
    """Maximise the evidence of the buffered samples given the dropped ones.

    All outputs together, O(k n^3 + k n p^2) a step, or of more than `TOGETHER` some in turn.
    """
    outputs = request.data.y.shape[1]
    return _fit_together(request) if outputs <= TOGETHER else _fit_in_turn(request)


def _fit_in_turn(request: FitRequest) -> FitResult:
    """Fit some outputs one after the other: ascent of the same evidence by coordinates.

    `p(y) = p(y_others) p(y_j | y_others)`, and only the second factor depends on the
    hyper-parameters of output j. The others enter it by their information on the columns of W that
    j has; a joint of a tree has those of the bodies that it carries.
    """
    data, model, p = request.data, request.model, request.data.F.shape[2]
    k = len(model.noise)
    some = min(k, max(1, ROWS // len(data.U)))
    turn = [(request.number * some + i) % k for i in range(some)]
    information = [_information(model, data, j) for j in range(k)]
    base = np.column_stack([request.base_root, request.base_target])
    rest = np.vstack([base, *(information[j] for j in range(k) if j not in turn)])
    rest = np.asarray(np.linalg.qr(rest, mode='r'))
    before = after = 0.0
    evaluations, refusals = 0, []
    for j in turn:
        columns = np.flatnonzero(np.any(data.F[:, j] != 0.0, axis=0))
        others = np.vstack([rest, *(information[i] for i in turn if i != j)])
        known = marginal_equations(others, [*columns, p])
        F, root = _determined(data.F[:, j, columns], known[:, :-1])
        found = _fit_together(replace(
            request, data=Observations(data.U, F[:, None], data.y[:, [j]]),
            base_root=root, base_target=known[:, -1], model=model.output(j),
        ))  # fmt: skip
        evaluations += found.evaluations
        refusals.append(found.is_worse)
        if found.refusal:
            continue
        before, after = before + found.log_evidence_before, after + found.log_evidence
        assert found.model is not None
        model = model.with_output(j, found.model)
        information[j] = _information(model, data, j)
    return FitResult(request.number, model, after, before, evaluations, all(refusals))


def _determined(F: np.ndarray, root: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return regressor (n, r) and prior (m, r) of the combinations of W that they determine.

    From regressor (n, p) and prior (m, p); directions that are left out do not enter.
    """
    rows = np.vstack([F, root])
    size = np.linalg.norm(rows, axis=0)
    rows /= np.where(size > 0.0, size, 1.0)
    _, S, Vt = svd(rows)
    combined = rows @ Vt[RANK_TOLERANCE * S.max(initial=0.0) < S].T
    return combined[: len(F)], combined[len(F) :]


def _information(model: Model, data: Observations, j: int) -> np.ndarray:
    """Return all that output j tells of W, as equations of unit noise, (r, p + 1)."""
    p = data.F.shape[2]
    columns = np.flatnonzero(np.any(data.F[:, j] != 0.0, axis=0))
    own = Observations(data.U, data.F[:, [j]][:, :, columns], data.y[:, [j]])
    block = build_blocks(model.output(j), own)[0]
    known = np.asarray(np.linalg.qr(np.column_stack([block.A, block.b]), mode='r'))
    rows = np.zeros((len(known), p + 1))
    rows[:, [*columns, p]] = known
    return rows


def _fit_together(request: FitRequest) -> FitResult:
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
    found: list[LearnedModel] = []
    rng = np.random.default_rng((request.seed, request.number))
    for start, restarts in candidates:
        with suppress(NumericalError):
            found.append(learn(request.data, prior, start, restarts, rng))
    evaluations = sum(learned.evaluations for learned in found)
    found.sort(key=lambda learned: -learned.log_evidence)
    best, highest, is_worse = None, -math.inf, False
    if found:
        best, highest = found[0].model, found[0].log_evidence
        if known_by is not None:
            best, highest, is_worse = _predicting(found, known_by)
    return FitResult(request.number, best, highest, before, evaluations, is_worse)


def _predicting(
    found: Sequence[LearnedModel], before: Posterior
) -> tuple[Model | None, float, bool]:
    """Return for each output the best fit that does not predict it worse, else what it had.

    Args:
        found: fits from several starts, that of the highest evidence first.
        before: posterior under the hyper-parameters in force.

    Returns:
        The model, its evidence [nat], and whether every output keeps what it had; the first fit
        then.
    """
    data, old = before.data, before.model
    known = _mean_square(left_out_errors(old, data, before.prior))
    constant = _mean_square(left_out_errors(None, data, before.prior))
    chosen: dict[int, Model] = {}
    for learned in found:
        after = _mean_square(left_out_errors(learned.model, data, before.prior))
        is_surer = np.array(learned.model.noise) < np.array(old.noise)
        is_worse = is_surer & (after > WORSE * np.minimum(known, constant))
        for output in np.flatnonzero(~is_worse).tolist():
            chosen.setdefault(output, learned.model)
        if len(chosen) == len(old.noise):
            break
    if not chosen or all(chosen.get(j) is found[0].model for j in range(len(old.noise))):
        return found[0].model, found[0].log_evidence, not chosen
    sources = [chosen.get(output, old) for output in range(len(old.noise))]
    model = Model(
        tuple(source.kernels[j] for j, source in enumerate(sources)),
        tuple(source.noise[j] for j, source in enumerate(sources)),
    )
    try:
        return model, Posterior(model, data, before.prior).log_evidence, False
    except NumericalError:
        return None, -math.inf, False


def left_out_errors(
    model: Model | None, data: Observations, prior: CoefficientPrior
) -> np.ndarray:
    """Return y less what the other stretches predict of it, (n, k): `STRETCHES` posteriors.

    Args:
        model: None for a constant, the mean of the others.
        data: the buffer, in the order of time.
        prior: of W.

    Returns:
        NaN where the others leave it undetermined, infinite where they have no factor.
    """
    if len(data.U) < 2:
        return np.full(data.y.shape, np.nan)
    errors = np.full(data.y.shape, np.inf)
    for part in np.array_split(np.arange(len(data.U)), min(STRETCHES, len(data.U))):
        rest = np.setdiff1d(np.arange(len(data.U)), part, assume_unique=True)
        if model is None:
            errors[part] = data.y[part] - data.y[rest].mean(axis=0)
            continue
        others = Observations(data.U[rest], data.F[rest], data.y[rest])
        try:
            found = Posterior(model, others, prior).predict(data.U[part], data.F[part])
        except NumericalError:
            continue
        is_determined = np.isfinite(found.variance)
        errors[part] = np.where(is_determined, data.y[part] - found.mean, np.nan)
    return errors


def _mean_square(errors: np.ndarray) -> np.ndarray:
    """Return the mean squares of the columns of errors (n, k), NaN for none, (k,)."""
    is_known = ~np.isnan(errors)
    total = (np.where(is_known, errors, 0.0) ** 2).sum(axis=0)
    return np.asarray(total / np.where(is_known.any(axis=0), is_known.sum(axis=0), np.nan))
