"""Time of one evaluation of evidence and gradient, and the evidence that full fits reach."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy import linalg

from sgp_proof.bench.problem import Problem, draw_problem, least_seconds
from sgp_proof.bench.rivals import Rivals, timed
from sgp_ros.gp.kernels import SquaredExponential
from sgp_ros.gp.learning import learn
from sgp_ros.gp.model import CoefficientPrior, Model, Observations
from sgp_ros.gp.posterior import Posterior

SAMPLES, QUICK_SAMPLES, INPUTS = 1000, 100, 8
REPEATS = 9


def bench_evidence(
    rivals: Rivals, progress: Callable[[float], None], *, is_quick: bool
) -> list[dict[str, Any]]:
    """Return one row per world: single evaluations and fits of all hyper-parameters."""
    n = QUICK_SAMPLES if is_quick else SAMPLES
    worlds = WORLDS[:1] if is_quick else WORLDS
    rows = []
    for i, (world, seed) in enumerate(worlds):
        problem = world(draw_problem(n, 1, INPUTS, seed), seed)
        row = {'n': n, 'inputs': INPUTS, 'world': world.__name__, 'seed': seed}
        rows.append(row | _evaluation(problem, rivals) | _fit(problem, rivals))
        progress((i + 1) / len(worlds))
    return rows


def drawn(problem: Problem, seed: int) -> Problem:
    """Return a world without physics, drawn from the process whose hyper-parameters it states."""
    n = len(problem.U)
    kernel = problem.model.kernels[0]
    assert kernel is not None
    K = kernel.matrix(problem.U) + problem.noise * np.eye(n)
    y = np.linalg.cholesky(K) @ np.random.default_rng(seed).normal(size=(n, 1))
    return replace(problem, F=np.zeros((n, 1, 0)), y=y)


def additive(problem: Problem, seed: int) -> Problem:
    """Return a sum of sines of each input, which no squared exponential of all inputs fits well.

    The evidence is highest where the signal variance is far above the variance of the data.
    """
    n = len(problem.U)
    noise = 0.1 * np.random.default_rng(seed).normal(size=(n, 1))
    y = np.sin(problem.U).sum(axis=1, keepdims=True) + noise
    return replace(problem, F=np.zeros((n, 1, 0)), y=y)


WORLDS = ((drawn, 0), (drawn, 1), (additive, 0))
"""Each with a seed."""


def _value(problem: Problem, model: Model) -> float:
    data = Observations(problem.U, problem.F, problem.y)
    return Posterior(model, data, CoefficientPrior.flat(0)).log_evidence


def _evaluation(problem: Problem, rivals: Rivals) -> dict[str, Any]:
    data, prior = Observations(problem.U, problem.F, problem.y), CoefficientPrior.flat(0)
    value = _value(problem, problem.model)

    def work() -> object:
        posterior = Posterior(problem.model, data, prior)
        return posterior.log_evidence, posterior.evidence_gradient()

    ours = least_seconds(work, REPEATS)
    lapack = least_seconds(lambda: _factor_and_invert(problem), REPEATS)
    row: dict[str, Any] = {
        'evaluation_ms': 1e3 * ours, 'lapack_ms': 1e3 * lapack, 'log_evidence': value,
    }  # fmt: skip
    for name, rival in rivals.items():
        theirs = None if rival is None else rival.evidence(problem)
        row |= timed(name, ours, REPEATS, theirs)
        row[f'{name}_difference'] = None if theirs is None else abs(float(theirs()[0]) - value)
    return row


def _factor_and_invert(problem: Problem) -> None:
    """Do what no exact evaluation can do without, on a matrix that costs nothing to build."""
    K = np.eye(len(problem.U), order='F')
    factor, _ = linalg.lapack.dpotrf(K, lower=True, overwrite_a=True)
    linalg.lapack.dpotri(factor, lower=True, overwrite_c=True)


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
