"""Medians of repeated runs, and the least time in which memory could have moved."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np


def median_seconds(work: Callable[[], object], repeats: int, loops: int = 1) -> float:
    """Return the median over `repeats` of the mean of `loops` calls [s]; one call warms up."""
    work()
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        for _ in range(loops):
            work()
        times.append((time.perf_counter() - began) / loops)
    return float(np.median(times))


def move_seconds(read: int, updated: int, repeats: int) -> float:
    """Return the time to read some doubles once and to read and write others once [s].

    Measured by an inner product and by a product in place over arrays of just these sizes, which
    lie in the cache if what they stand for does.
    """
    first, second = np.ones(read), np.ones(updated)
    loops = max(1, 1_000_000 // (read + updated))
    reading = median_seconds(lambda: np.dot(first, first), repeats, loops)
    updating = median_seconds(lambda: np.multiply(second, 1.0, out=second), repeats, loops)
    return reading + updating
