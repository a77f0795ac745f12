"""The result of a search for a law at one joint."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import special

from sgp_ros.batch.least_squares import correlation_factor
from sgp_ros.diagnosis.explain.fitted_model import Model


@dataclass(frozen=True, eq=False)
class Searched:
    """Result of a search at one joint.

    Attributes:
        joint: index.
        listed: best model of listed effects.
        smooth: best model with a smooth force at the joint.
        laws: models with a formula there, best first.
        free: what a force of any form beside the first formula leaves of parts that were left out
            of its fit (N,).
        floor: mean square that errors of signals and filters leave.
        is_slight: whether listed effects keep their names where no formula is asserted.
    """

    joint: int
    listed: Model
    smooth: Model
    laws: tuple[Model, ...]
    free: np.ndarray
    floor: float
    is_slight: bool = False

    @property
    def lack_of_fit(self) -> tuple[float, float]:
        """Ratio of what the first formula leaves to what any form beside it does, and its chance.

        A form that follows rests at some positions, or noise, predicts no other part. The chance
        is that of a mean difference of squares that is not positive, with rows as independent as
        these differences are.
        """
        law = self.laws[0].residual[:, self.joint] ** 2
        gain = law - self.free**2
        rows = len(gain) / correlation_factor(gain)
        spread = max(float(gain.std()), 1e-300) / math.sqrt(rows)
        ratio = (law.mean() + self.floor) / ((self.free**2).mean() + self.floor)
        return float(ratio), float(special.ndtr(-gain.mean() / spread))
