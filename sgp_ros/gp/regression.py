"""What a stream asks of a regression, whichever way it keeps what it learned."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np

from sgp_ros.gp.information import Information
from sgp_ros.gp.model import Model, Observations
from sgp_ros.gp.online_prediction import OnlinePrediction


class Regression(Protocol):
    """The posterior of W and Z after each sample."""

    @property
    def model(self) -> Model:
        """Hyper-parameters in force."""

    @property
    def information(self) -> Information:
        """What is known of W."""

    @property
    def size(self) -> int:
        """Number of samples kept."""

    @property
    def buffer(self) -> Observations:
        """The samples kept."""

    @property
    def base(self) -> Information:
        """What the prior tells of W, and the samples that are gone beside those kept."""

    @property
    def unresolved(self) -> int:
        """Samples at which the basis of Z had no room; 0 while there is no basis."""

    def predict(self, u: np.ndarray, f: np.ndarray) -> OnlinePrediction:
        """Predict X at input u (d,) with regressor f (k, p)."""

    def with_regressor(self, prediction: OnlinePrediction, f: np.ndarray) -> OnlinePrediction:
        """Predict for another regressor f (k, p) at an input that Z sees as the same."""

    def learn(self, prediction: OnlinePrediction, y: np.ndarray) -> None:
        """Add the sample that `prediction` was made for, observed as y (k,)."""

    def learn_all(self, data: Observations) -> None:
        """Learn the first samples of a stream."""

    def change(
        self,
        model: Model | None = None,
        budget: int | None = None,
        *,
        remember: bool | None = None,
        policy: str | None = None,
        forgetting: float | None = None,
    ) -> None:
        """Take other hyper-parameters, budget, memory, policy or forgetting."""

    def state(self) -> dict[str, np.ndarray]:
        """Return everything that was learned, as arrays."""

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue exactly where `state` was taken."""
