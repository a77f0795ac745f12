"""The weight of Z beside the physics alone, from the errors of both.

Z helps where it has seen the state before; on another motion, or with a split of the data that
W and Z cannot agree on, it can predict worse than the physics alone. Both are experts with an
unknown error variance each. Given the errors so far, with a memory that fades, their likelihoods
under the variance that suits each best are in the ratio (profile likelihood, n errors)

    (S_physics / S_model)^(n / 2),    S the mean of squared errors,

which depends neither on scale nor on the variance that either claims. The weight of Z is its
share of the two (Bayesian averaging, Hoeting et al. 1999; with fading memory Raftery et al. 2010,
dynamic model averaging). The mean is then the weighted mean, and the covariance that of the
mixture.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

MEMORY = 10
"""Errors after which the past counts little: the same as that of the local spread of intervals."""


@dataclass(slots=True)
class ProcessWeight:
    """Weight of Z for one joint; O(1) memory and time.

    Attributes:
        n: pairs of errors seen.
        model, physics: fading means of the squared errors with Z and without.
        total: sum of the weights used, for their mean.
    """

    n: int = 0
    model: float = 0.0
    physics: float = 0.0
    total: float = 0.0

    @property
    def value(self) -> float:
        """Weight in [0, 1]; 1 before any error."""
        if self.model <= self.physics * 1e-300:
            return 1.0
        if self.physics <= self.model * 1e-300:
            return 0.0
        odds = 0.5 * min(self.n, MEMORY) * math.log(self.model / self.physics)
        return 1.0 / (1.0 + math.exp(min(odds, 700.0)))

    @property
    def mean(self) -> float:
        """Mean weight so far; 1 before any error."""
        return self.total / self.n if self.n else 1.0

    def add(self, model: float, physics: float) -> None:
        """Take the errors of both on one sample, after it was predicted."""
        self.total += self.value
        self.n += 1
        share = 1.0 / min(self.n, MEMORY)
        self.model += share * (model * model - self.model)
        self.physics += share * (physics * physics - self.physics)
