"""Time, memory floor, calls and allocations of one step: predict, append, drop, update W."""

from __future__ import annotations

import gc
import time
import tracemalloc
from collections.abc import Callable
from typing import Any

import numpy as np

from sgp_proof.bench.problem import Problem, draw_problem, least_seconds, move_seconds
from sgp_proof.bench.replay import calls_of
from sgp_proof.bench.rivals import Rivals, timed
from sgp_ros.gp.factor import length_for
from sgp_ros.gp.factor_loops import absorb_column
from sgp_ros.gp.inducing_points import InducingPoints
from sgp_ros.gp.kernels import SquaredExponential
from sgp_ros.gp.model import CoefficientPrior, output_groups
from sgp_ros.gp.online import OnlineRegression
from sgp_ros.gp.regression import Memory
from sgp_ros.gp.whitening_loops import SQUARED_EXPONENTIAL, fill_covariances, solve_lower

SIZES = (250, 500, 1000, 2000)
SHAPES = ((1, 8), (1, 21), (7, 21))
"""Outputs and inputs."""
REPEATS, RIVAL_REPEATS = 9, 3


def bench_step(
    rivals: Rivals, progress: Callable[[float], None], *, is_quick: bool
) -> list[dict[str, Any]]:
    """Return one row per size of buffer, number of outputs and number of inputs."""
    cases = [(n, shape) for n in (SIZES[:1] if is_quick else SIZES) for shape in SHAPES]
    rows = []
    for i, (n, (outputs, inputs)) in enumerate(cases):
        rows.append(step_row(n, outputs, inputs, rivals, 3 if is_quick else REPEATS))
        progress((i + 1) / len(cases))
    return rows


def step_row(n: int, outputs: int, inputs: int, rivals: Rivals, repeats: int) -> dict[str, Any]:
    """Time a full buffer of n samples on a stream, and its rivals on the same."""
    period = length_for(n + 1) - n
    problem = draw_problem(n + period, outputs, inputs, seed=n)
    online = _full(problem, n)
    work = _stepping(online, problem)
    for _ in range(period):
        work()
    p = problem.F.shape[2]
    data = n * outputs * (p + 1)
    read, updated = n * n // 2 + data + n * inputs, n * n // 2 + data
    wall_s, step_s = _wall_seconds(work, period), least_seconds(work, repeats, period)
    floor_s = move_seconds(read, updated, repeats)
    row: dict[str, Any] = {
        'n': n, 'outputs': outputs, 'inputs': inputs, 'coefficients': p,
        'step_ms': 1e3 * step_s, 'wall_ms': 1e3 * wall_s, 'floor_ms': 1e3 * floor_s,
        'times_floor': step_s / floor_s, 'calls': calls_of(work)[0],
        'megabytes': 8e-6 * (read + 2 * updated),
    }  # fmt: skip
    row |= part_times(problem, n, repeats, step_s)
    until = draw_problem(n + 1, outputs, inputs, seed=n)
    for name, rival in rivals.items():
        row |= timed(name, step_s, RIVAL_REPEATS, None if rival is None else rival.step(until))
    return row | memory_of(work, period)


def _wall_seconds(work: Callable[[], None], loops: int) -> float:
    began = time.perf_counter()
    for _ in range(loops):
        work()
    return (time.perf_counter() - began) / loops


def part_times(problem: Problem, n: int, repeats: int, step_s: float) -> dict[str, float]:
    """Return the time [ms] of the loops of a step alone, and what they leave of `step_s`.

    The rotations are by a column of zeros: they move and compute as much, and leave the factor.
    The features are those of as many inducing points as a regression takes by default.
    """
    kernel = problem.model.kernels[0]
    assert isinstance(kernel, SquaredExponential)
    outputs, coefficients = problem.F.shape[1:]
    length = length_for(n + 1)
    U = np.zeros((length, length))
    K = kernel.matrix(problem.U[:n])
    U[:n, :n] = np.linalg.cholesky(K + problem.noise * np.eye(n)).T
    S = kernel.scale(problem.U[:n])
    x, carried, variance, s = np.zeros(n), np.zeros(n), kernel.variance, S[0].copy()
    extra = np.zeros(outputs * (coefficients + 1))
    white = np.zeros((n, len(extra)))
    points = InducingPoints(output_groups(problem.model)[0], coefficients, Memory(n).features)
    data = np.concatenate([problem.F, problem.y[:, :, None]], axis=2)

    def features() -> None:
        points.absorb(problem.U[0], points.features(problem.U[0]), data[0])

    points.learn_anew(problem.U[:n], data[:n], np.ones(n))
    loops = max(1, 1_000_000 // (n * n))
    found = {
        'kernel_ms': least_seconds(
            lambda: fill_covariances(SQUARED_EXPONENTIAL, variance, S, 0, s, x),
            repeats, loops,
        ),
        'solve_ms': least_seconds(lambda: solve_lower(U, 0, x), repeats, loops),
        'rotate_ms': least_seconds(
            lambda: absorb_column(U, 0, carried, white, extra), repeats, loops
        ),
        'features_ms': least_seconds(features, repeats, loops),
    }  # fmt: skip
    found['rest_ms'] = step_s - sum(found.values())
    return {name: 1e3 * seconds for name, seconds in found.items()}


def memory_of(work: Callable[[], object], steps: int) -> dict[str, float]:
    """Return the blocks that a step leaves allocated, and the most bytes it holds meanwhile."""
    tracemalloc.start()
    try:
        for _ in range(steps):
            work()
        before = _blocks()
        for _ in range(steps):
            work()
        kept = _blocks() - before
        current, _ = tracemalloc.get_traced_memory()
        tracemalloc.reset_peak()
        work()
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    return {'allocations': round(kept / steps), 'temporary_kilobytes': 1e-3 * (peak - current)}


def _blocks() -> int:
    gc.collect()
    return sum(statistic.count for statistic in tracemalloc.take_snapshot().statistics('filename'))


def _full(problem: Problem, n: int) -> OnlineRegression:
    prior = CoefficientPrior.flat(problem.F.shape[2])
    online = OnlineRegression(problem.model, prior, Memory(n))
    for u, f, y in zip(problem.U[:n], problem.F[:n], problem.y[:n], strict=True):
        online.learn(online.predict(u, f), y)
    return online


def _stepping(online: OnlineRegression, problem: Problem) -> Callable[[], None]:
    """Return the work of one step; samples repeat only after they have left the buffer."""
    count = online.size

    def work() -> None:
        nonlocal count
        i = count % len(problem.U)
        online.learn(online.predict(problem.U[i], problem.F[i]), problem.y[i])
        count += 1

    return work
