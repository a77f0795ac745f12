"""What a run went through, kept for the figures."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from sgp_ros.engine.engine import Engine
from sgp_ros.engine.results import Estimate, Step

PARAMETER_PERIOD = 5
"""Estimates between two looks at the parameters."""


@dataclass(slots=True)
class History:
    """Estimates and parameters in the order of time.

    Attributes:
        estimates: every estimate of the run.
        parameter_stamps: times of the looks at the parameters [ns].
        parameter_values: (p,) per look.
        parameter_std: (p,) per look, NaN where not identifiable.
    """

    estimates: list[Estimate] = field(default_factory=list)
    parameter_stamps: list[int] = field(default_factory=list)
    parameter_values: list[np.ndarray] = field(default_factory=list)
    parameter_std: list[np.ndarray] = field(default_factory=list)

    def take(self, engine: Engine, step: Step) -> None:
        """Keep what one push gave."""
        for estimate in step.estimates:
            self.estimates.append(estimate)
            if len(self.estimates) % PARAMETER_PERIOD == 0:
                self._look(engine, estimate.stamp_ns)

    def seconds(self) -> np.ndarray:
        """Times of the estimates since the first one [s], (n,)."""
        if not self.estimates:
            return np.zeros(0)
        first = self.estimates[0].stamp_ns
        return np.array([(e.stamp_ns - first) * 1e-9 for e in self.estimates])

    def parameter_seconds(self) -> np.ndarray:
        """Times of the looks at the parameters since the first estimate [s]."""
        if not self.parameter_stamps:
            return np.zeros(0)
        first = self.estimates[0].stamp_ns
        return np.array([(stamp - first) * 1e-9 for stamp in self.parameter_stamps])

    def channel(self, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return measured, mean and variance of `acceleration` or `effort`, each (n, k)."""
        values = [getattr(e, name) for e in self.estimates]
        return (
            np.array([v.measured for v in values]),
            np.array([v.mean for v in values]),
            np.array([v.variance for v in values]),
        )

    def scored(self) -> np.ndarray:
        """Which estimates entered the scores, (n,) of bool."""
        return np.array([e.is_scored for e in self.estimates], dtype=bool)

    def _look(self, engine: Engine, stamp_ns: int) -> None:
        parameters = engine.parameters()
        if not parameters:
            return
        self.parameter_stamps.append(stamp_ns)
        self.parameter_values.append(np.array([p.value for p in parameters]))
        self.parameter_std.append(
            np.array([np.nan if p.std is None else p.std for p in parameters])
        )
