"""Where the time of a step goes: covariances, triangular solve, rotations, the rest."""

from __future__ import annotations

import numpy as np

from sgp_proof.bench.problem import Problem
from sgp_proof.bench.timing import median_seconds
from sgp_ros.gp.factor import length_for
from sgp_ros.gp.factor_loops import absorb_column, solve_lower


def part_times(problem: Problem, n: int, repeats: int, step_s: float) -> dict[str, float]:
    """Return the time [ms] of the three loops of a step alone, and what they leave of `step_s`.

    The rotations are by a column of zeros: they move and compute as much, and leave the factor.
    """
    kernel = problem.model.kernels[0]
    assert kernel is not None
    outputs, coefficients = problem.F.shape[1:]
    length = length_for(n + 1)
    U = np.zeros((length, length))
    K = kernel.matrix(problem.U[:n])
    U[:n, :n] = np.linalg.cholesky(K + problem.noise * np.eye(n)).T
    S = kernel.scale(problem.U[:n])
    x, carried = np.zeros(n), np.zeros(n)
    extra = np.zeros(outputs * (coefficients + 1))
    white = np.zeros((n, len(extra)))
    loops = max(1, 1_000_000 // (n * n))
    found = {
        'kernel_ms': median_seconds(lambda: kernel.vector(S, S[0]), repeats, loops),
        'solve_ms': median_seconds(lambda: solve_lower(U, 0, x), repeats, loops),
        'rotate_ms': median_seconds(
            lambda: absorb_column(U, 0, carried, white, extra), repeats, loops
        ),
    }
    found['rest_ms'] = step_s - sum(found.values())
    return {name: 1e3 * seconds for name, seconds in found.items()}
