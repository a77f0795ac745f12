"""The rivals by name, and their time beside ours."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol, TypeAlias

import numpy as np

from sgp_proof.bench import gpytorch_rival, sklearn_rival
from sgp_proof.bench.problem import Problem
from sgp_proof.bench.timing import median_seconds

Rivals: TypeAlias = 'Mapping[str, Rival | None]'


class Rival(Protocol):
    """What a module of a rival offers."""

    IS_INSTALLED: bool

    def step(self, problem: Problem) -> Callable[[], object]:
        """Return the work of one step at the last sample of a problem."""

    def evidence(self, problem: Problem) -> Callable[[], tuple[float, np.ndarray]]:
        """Return one evaluation of log evidence and gradient."""

    def fitted(self, problem: Problem) -> tuple[float, tuple[float, ...], float]:
        """Return signal variance, length scales and noise of highest evidence."""


RIVALS: dict[str, Rival] = {'gpytorch': gpytorch_rival, 'sklearn': sklearn_rival}


def installed() -> dict[str, Rival | None]:
    """Return every rival, None for those that are not installed."""
    return {name: rival if rival.IS_INSTALLED else None for name, rival in RIVALS.items()}


def timed(
    name: str, ours: float, repeats: int, theirs: Callable[[], object] | None
) -> dict[str, Any]:
    """Return the time of a rival's work [ms] and how many times faster ours [s] is."""
    if theirs is None:
        return {f'{name}_ms': None, f'times_faster_{name}': None}
    seconds = median_seconds(theirs, repeats)
    return {f'{name}_ms': 1e3 * seconds, f'times_faster_{name}': seconds / ours}
