"""One-step predictions, and the methods of every regression that learns a stream."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sgp_ros.gp.factor import Whitening
from sgp_ros.gp.information import Forgetting, Information
from sgp_ros.gp.model import CoefficientPrior, Model, Observations


@dataclass(frozen=True, slots=True, eq=False)
class OnlinePrediction:
    """Prediction of X at one input, with what learning it reuses.

    Attributes:
        mean: (k,).
        covariance: (k, k) of X, without noise; infinite on the diagonal where an undetermined
            direction of W enters.
        u, f: the input (d,) and regressor (k, p) it was made for.
        whitenings: the input against the samples, one per factor, or against the inducing points.
        version: state of the model it was made with.
        gains: of inducing points, by which data enter the features, (m,) per set; else none.
    """

    mean: np.ndarray
    covariance: np.ndarray
    u: np.ndarray
    f: np.ndarray
    whitenings: tuple[Whitening, ...]
    version: int
    gains: tuple[np.ndarray, ...] = ()


@dataclass(frozen=True, slots=True)
class Memory:
    """How much of a stream a regression keeps, and for how long.

    Attributes:
        budget: most samples kept: those that Z is conditioned on, or that fits need.
        features: most inducing points of each component.
        remember: whether samples that are gone count for W, and for other hyper-parameters; else
            the prior and the samples kept are all that does.
        policy: which sample leaves a full buffer, a key of `RETENTIONS`; of inducing points it is
            always the oldest.
        forgetting: samples after which what was learned counts 1/e; 0 never forgets.
    """

    budget: int
    features: int = 100
    remember: bool = True
    policy: str = 'oldest'
    forgetting: float = 0.0


class Regression(ABC):
    """The posterior of W and Z after each sample.

    Args:
        prior: of W.
        memory: what is kept of the stream.
    """

    def __init__(self, prior: CoefficientPrior, memory: Memory) -> None:
        self._prior = Information.of_prior(prior)
        self._memory = memory
        self._forgetting = Forgetting(memory.forgetting, self._prior)
        self._version = 0

    @property
    def memory(self) -> Memory:
        """How much of the stream is kept."""
        return self._memory

    @property
    @abstractmethod
    def model(self) -> Model:
        """Hyper-parameters in force."""

    @property
    @abstractmethod
    def information(self) -> Information:
        """Information on W."""

    @property
    @abstractmethod
    def size(self) -> int:
        """Number of samples kept."""

    @property
    @abstractmethod
    def buffer(self) -> Observations:
        """The samples kept."""

    @property
    @abstractmethod
    def base(self) -> Information:
        """Information on W of the prior, and of the samples that are gone beside those kept."""

    @property
    @abstractmethod
    def unresolved(self) -> int:
        """Samples for which inducing points lacked room; 0 while there are no inducing points."""

    @abstractmethod
    def predict(self, u: np.ndarray, f: np.ndarray) -> OnlinePrediction:
        """Predict X at input u (d,) with regressor f (k, p)."""

    @abstractmethod
    def with_regressor(self, prediction: OnlinePrediction, f: np.ndarray) -> OnlinePrediction:
        """Predict for another regressor f (k, p) at an input that Z sees as the same."""

    @abstractmethod
    def learn(self, prediction: OnlinePrediction, y: np.ndarray) -> None:
        """Add the sample that `prediction` was made for, observed as y (k,)."""

    @abstractmethod
    def learn_all(self, data: Observations) -> None:
        """Learn the first samples of a stream."""

    @abstractmethod
    def change(self, model: Model | None = None, memory: Memory | None = None) -> None:
        """Take other hyper-parameters, another memory, or both.

        Raises:
            NumericalError: no factor exists under these hyper-parameters; nothing has changed.
        """

    @abstractmethod
    def state(self) -> dict[str, np.ndarray]:
        """Return everything that was learned, as arrays."""

    @abstractmethod
    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue exactly where `state` was taken."""

    def _require_current(self, prediction: OnlinePrediction) -> None:
        if prediction.version != self._version:
            raise ValueError('the prediction was made before the last change of the model')
