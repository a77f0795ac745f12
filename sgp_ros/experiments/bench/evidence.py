"""Time of one evaluation of evidence and gradient, and the evidence that full fits reach."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from sgp_ros.core.kernels import SquaredExponential
from sgp_ros.core.learning import learn
from sgp_ros.core.model import Model, Observations
from sgp_ros.core.posterior import Posterior
from sgp_ros.core.prior import CoefficientPrior
from sgp_ros.experiments.bench.problem import Problem, draw_problem
from sgp_ros.experiments.bench.rivals import timed
from sgp_ros.experiments.bench.timing import median_seconds

if TYPE_CHECKING:
    from collections.abc import Callable

    from sgp_ros.experiments.bench.rivals import Rivals

SAMPLES, QUICK_SAMPLES, INPUTS = 1000, 100, 8
REPEATS, FITS = 9, 3


def bench_evidence(
    rivals: Rivals, progress: Callable[[float], None], *, is_quick: bool
) -> list[dict[str, Any]]:
    """Return one row per world: single evaluations and fits of all hyper-parameters."""
    n = QUICK_SAMPLES if is_quick else SAMPLES
    rows = []
    fits = 1 if is_quick else FITS
    for seed in range(fits):
        problem = _process_only(draw_problem(n, 1, INPUTS, seed))
        rows.append(
            {
                'n': n,
                'inputs': INPUTS,
                'seed': seed,
                **_evaluation(problem, rivals),
                **_fit(problem, rivals),
            }
        )
        progress((seed + 1) / fits)
    return rows


def _process_only(problem: Problem) -> Problem:
    """Return the world without physics, which the rivals do not have."""
    n = len(problem.U)
    y = np.sin(problem.U).sum(axis=1, keepdims=True) + 0.1 * np.cos(17.0 * problem.U[:, :1])
    return Problem(
        problem.U, np.zeros((n, 1, 0)), y, problem.variance, problem.lengthscales, problem.noise
    )


def _value(problem: Problem, model: Model) -> float:
    data = Observations(problem.U, problem.F, problem.y)
    return Posterior(model, data, CoefficientPrior.flat(0)).log_evidence


def _evaluation(problem: Problem, rivals: Rivals) -> dict[str, Any]:
    data, prior = Observations(problem.U, problem.F, problem.y), CoefficientPrior.flat(0)
    value = _value(problem, problem.model)

    def work() -> object:
        posterior = Posterior(problem.model, data, prior)
        return posterior.log_evidence, posterior.evidence_gradient()

    ours = median_seconds(work, REPEATS)
    row: dict[str, Any] = {'evaluation_ms': 1e3 * ours, 'log_evidence': value}
    for name, rival in rivals.items():
        theirs = None if rival is None else rival.evidence(problem)
        row |= timed(name, ours, REPEATS, theirs)
        row[f'{name}_difference'] = None if theirs is None else abs(float(theirs()[0]) - value)
    return row


def _fit(problem: Problem, rivals: Rivals) -> dict[str, Any]:
    """Fit all hyper-parameters from the same start; evidences are computed by one function."""
    data, prior = Observations(problem.U, problem.F, problem.y), CoefficientPrior.flat(0)
    began = time.perf_counter()
    learned = learn(data, prior, problem.model)
    row: dict[str, Any] = {
        'fit_s': time.perf_counter() - began, 'fit_log_evidence': learned.log_evidence,
    }  # fmt: skip
    for name, rival in rivals.items():
        row |= {f'{name}_fit_s': None, f'{name}_fit_log_evidence': None}
        if rival is not None:
            began = time.perf_counter()
            variance, lengths, noise = rival.fitted(problem)
            row[f'{name}_fit_s'] = time.perf_counter() - began
            kernel = SquaredExponential(variance, lengths, tuple(range(INPUTS)))
            row[f'{name}_fit_log_evidence'] = _value(problem, Model((kernel,), (noise,)))
    return row
