"""One-step predictions, and the methods of every regression that learns a stream."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sgp_ros.gp.factor import Whitening
from sgp_ros.gp.information import Information
from sgp_ros.gp.model import Model, Observations


@dataclass(frozen=True, slots=True, eq=False)
class OnlinePrediction:
    """Prediction of X at one input, with what learning it reuses.

    Attributes:
        mean: (k,).
        covariance: (k, k) of X, without noise; infinite on the diagonal where an undetermined
            direction of W enters.
        u, f: the input (d,) and regressor (k, p) it was made for.
        whitenings: the input against the samples, one per factor; in a basis against the inducing
            inputs, one per component.
        version: state of the model it was made with.
        gains: of a basis, by which data enter the features, (m,) per component; else none.
    """

    mean: np.ndarray
    covariance: np.ndarray
    u: np.ndarray
    f: np.ndarray
    whitenings: tuple[Whitening, ...]
    version: int
    gains: tuple[np.ndarray, ...] = ()


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
