"""The synthetic stream that all rivals are timed on, and how they are timed."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sgp_ros.gp.kernels import SquaredExponential
from sgp_ros.gp.model import Model

COEFFICIENTS_PER_OUTPUT = 4
"""Such as inertia, viscous and dry friction, gravity of each joint."""


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """Inputs, regressors and observations, and the hyper-parameters to take as given.

    Attributes:
        U: (N, d) inputs.
        F: (N, k, p) regressors.
        y: (N, k) observations.
        variance: of Z.
        lengthscales: (d,).
        noise: variance of the observations.
    """

    U: np.ndarray
    F: np.ndarray
    y: np.ndarray
    variance: float
    lengthscales: tuple[float, ...]
    noise: float

    @property
    def model(self) -> Model:
        """The hyper-parameters, one kernel for all outputs."""
        outputs = self.y.shape[1]
        kernel = SquaredExponential(
            self.variance, self.lengthscales, tuple(range(self.U.shape[1]))
        )
        return Model((kernel,) * outputs, (self.noise,) * outputs)


def draw_problem(samples: int, outputs: int, inputs: int, seed: int) -> Problem:
    """Return smooth functions of all inputs plus physics plus noise, uniform in a cube."""
    rng = np.random.default_rng(seed)
    p = COEFFICIENTS_PER_OUTPUT * outputs
    U = rng.uniform(-2.0, 2.0, size=(samples, inputs))
    F = rng.normal(size=(samples, outputs, p))
    smooth = np.sin(U @ rng.normal(size=(inputs, outputs)) / np.sqrt(inputs))
    y = F @ rng.normal(size=p) + smooth + 0.1 * rng.normal(size=(samples, outputs))
    return Problem(U, F, y, 1.0, (float(np.sqrt(inputs)),) * inputs, 0.01)


def least_seconds(work: Callable[[], object], repeats: int, loops: int = 1) -> float:
    """Return the least over `repeats` of the mean of `loops` calls [s]; one call warms up.

    Processor time of this thread. What else the machine does can only add to it, through the
    caches that are shared.
    """
    work()
    times = []
    for _ in range(repeats):
        began = time.thread_time()
        for _ in range(loops):
            work()
        times.append((time.thread_time() - began) / loops)
    return min(times)


def move_seconds(read: int, updated: int, repeats: int) -> float:
    """Return the time to read some doubles once and to read and write others once [s].

    Measured by an inner product and by a product in place over arrays of just these sizes, which
    lie in the cache if what they stand for does.
    """
    first, second = np.ones(read), np.ones(updated)
    loops = max(1, 1_000_000 // (read + updated))
    reading = least_seconds(lambda: np.dot(first, first), repeats, loops)
    updating = least_seconds(lambda: np.multiply(second, 1.0, out=second), repeats, loops)
    return reading + updating
