"""Joint inference of W and Z one sample at a time, with a bounded number of samples in Z.

Components of X with the same covariance up to a scale share one growing factor L, with
`A = L^-1 F` and `b = L^-1 y` of each beside it. Appending borders the factor; the solve it needs
is the one the prediction made. Which sample leaves a full buffer is a policy (`core.retention`).
Dropping it rotates the factor and leaves the conditional row of that sample: information on W
that no remaining sample repeats. With `remember` it is kept, and the likelihood is a product of
conditionals in which every sample counts once (Vecchia 1988). What is kept was whitened with the
noise of its time; when a fit finds another noise, it is scaled to that.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sgp_ros.core.factor import GrowingFactor
from sgp_ros.core.forgetting import Forgetting
from sgp_ros.core.information import Information
from sgp_ros.core.online_prediction import OnlinePrediction
from sgp_ros.core.output_groups import output_groups
from sgp_ros.core.retention import RETENTIONS
from sgp_ros.core.sample_buffer import SampleBuffer
from sgp_ros.errors import NumericalError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from sgp_ros.core.factor import Whitening
    from sgp_ros.core.model import Model, Observations
    from sgp_ros.core.output_groups import OutputGroup
    from sgp_ros.core.prior import CoefficientPrior


class OnlineRegression:
    """The posterior after each sample.

    Args:
        model: hyper-parameters, k kernels and k noise variances.
        prior: of W.
        budget: most samples that Z is conditioned on.
        remember: whether W keeps what dropped samples told about it.
        policy: which sample leaves a full buffer, a key of `RETENTIONS`.
        forgetting: samples after which information on W counts 1/e; 0 never forgets.
    """

    def __init__(
        self,
        model: Model,
        prior: CoefficientPrior,
        budget: int,
        *,
        remember: bool = True,
        policy: str = 'oldest',
        forgetting: float = 0.0,
    ) -> None:
        self._prior = Information.of_prior(prior)
        self._forgetting = Forgetting(forgetting, self._prior)
        self._total = self._prior.copy()
        self._budget = budget
        self._remember = remember
        self._retention = RETENTIONS[policy]()
        self._version = 0
        self._rotated = 0
        p = prior.size
        self._samples = SampleBuffer.empty(len(model.kernels), p)
        self._model = model
        self._groups: tuple[OutputGroup, ...] = ()
        self._factors: tuple[GrowingFactor, ...] = ()
        self._kept = tuple(Information.nothing(p) for _ in model.kernels)
        self._rebuild()

    @property
    def model(self) -> Model:
        """Hyper-parameters in force."""
        return self._model

    @property
    def information(self) -> Information:
        """What is known of W."""
        return self._total

    @property
    def size(self) -> int:
        """Number of samples in the buffer."""
        return self._samples.size

    @property
    def unresolved(self) -> int:
        """Samples at which a basis had no room: there is none."""
        return 0

    @property
    def buffer(self) -> Observations:
        """A copy of the buffered samples, in the order in which they came."""
        return self._samples.observations()

    @property
    def rotated(self) -> int:
        """Samples dropped since the factors were last computed from the buffer."""
        return self._rotated

    @property
    def base(self) -> Information:
        """What the prior and the dropped samples tell of W."""
        rows = [kept.R for kept in self._kept]
        values = [kept.z for kept in self._kept]
        return self._prior.with_rows(np.vstack(rows), np.concatenate(values))

    def predict(self, u: np.ndarray, f: np.ndarray) -> OnlinePrediction:
        """Predict X at input u (d,) with regressor f (k, p). O(n^2 / 2) per factor."""
        return self._predict(u, f, tuple(factor.whiten(u) for factor in self._factors))

    def with_regressor(self, prediction: OnlinePrediction, f: np.ndarray) -> OnlinePrediction:
        """Predict for another regressor f (k, p) at an input that Z sees as the same. O(k p^2)."""
        return self._predict(prediction.u, f, prediction.whitenings)

    def _predict(
        self, u: np.ndarray, f: np.ndarray, whitenings: tuple[Whitening, ...]
    ) -> OnlinePrediction:
        rows = f.copy()
        mean = np.zeros(len(f))
        variance = np.zeros(len(f))
        for group, whitening in zip(self._groups, whitenings, strict=True):
            outputs = list(group.outputs)
            rows[outputs] -= whitening.explained[:, :-1]
            mean[outputs] = whitening.explained[:, -1]
            variance[outputs] = np.square(group.scales) * whitening.variance
        mean, covariance = self._total.predict(rows, mean, variance)
        return OnlinePrediction(mean, covariance, u, f, whitenings, self._version)

    def learn(self, prediction: OnlinePrediction, y: np.ndarray) -> None:
        """Add the sample that `prediction` was made for, observed as y (k,).

        One sample leaves when the budget is exceeded. O(n^2) per factor.

        Raises:
            ValueError: the model changed since the prediction.
            NumericalError: the sample repeats others to rounding; nothing has changed.
        """
        if prediction.version != self._version:
            raise ValueError('the prediction was made before the last change of the model')
        for factor, whitening in zip(self._factors, prediction.whitenings, strict=True):
            factor.pivot(whitening)
        self._version += 1
        if self._forgetting.factor != 1.0:
            self._forgetting.fade(self._total, self._kept)
            self._samples.fade(self._forgetting.factor)
        data = np.concatenate([prediction.f, y[:, None]], axis=1)  # (k, p + 1)
        for group, factor, whitening in zip(
            self._groups, self._factors, prediction.whitenings, strict=True
        ):
            self._total.absorb(factor.append(whitening, data[list(group.outputs)]))
        self._samples.append(prediction.u, data)
        self._retention.append(self._factors, prediction.u)
        while self.size > self._budget:
            self._drop(self._retention.choose(self._factors))

    def is_sound(self, prediction: OnlinePrediction) -> bool:
        """Whether every factor gave the observation a positive variance."""
        try:
            for factor, whitening in zip(self._factors, prediction.whitenings, strict=True):
                factor.pivot(whitening)
        except NumericalError:
            return False
        return True

    def refresh(self) -> float:
        """Factor the buffer anew, O(n^3 / 3) per factor, and say how far the factors had drifted.

        Returns:
            The largest norm of a difference, over the norm of what it should have been, among
            the factors and their whitened data; infinite where a factor was lost.

        Raises:
            NumericalError: the buffer has no factor in double precision; nothing has changed.
        """
        before = self._factors
        self._rebuild()
        drift = [a.distance(b) for a, b in zip(before, self._factors, strict=True)]
        return max(drift, default=0.0)

    def change(
        self,
        model: Model | None = None,
        budget: int | None = None,
        *,
        remember: bool | None = None,
        policy: str | None = None,
        forgetting: float | None = None,
    ) -> None:
        """Take other hyper-parameters, budget, memory or policy; refactorises, O(k n^3).

        Raises:
            NumericalError: the buffer has no factor under the new hyper-parameters; nothing has
                changed then.
        """
        previous = (self._model, self._budget, self._remember, self._kept, self._retention)
        if model is not None:
            ratios = np.sqrt(np.array(self._model.noise) / np.array(model.noise))
            self._kept = tuple(
                kept.scaled(float(ratio)) for kept, ratio in zip(self._kept, ratios, strict=True)
            )
            self._model = model
        self._budget = budget or self._budget
        self._remember = self._remember if remember is None else remember
        if policy is not None:
            self._retention = RETENTIONS[policy]()
            self._retention.rebuild(self._model, self._factors, self._samples.inputs)
        try:
            while self.size > self._budget:
                self._drop(self._retention.choose(self._factors))
            self._rebuild()
        except Exception:
            self._model, self._budget, self._remember, self._kept, self._retention = previous
            self._retention.rebuild(self._model, self._factors, self._samples.inputs)
            raise
        if forgetting is not None:
            self._forgetting = Forgetting(forgetting, self._prior)

    def state(self) -> dict[str, np.ndarray]:
        """Return everything that was learned, as arrays; `restore` takes it back."""
        arrays = {
            'U': self._samples.inputs, 'data': self._samples.data,
            'weights': self._samples.weights,
            'kept_R': np.array([kept.R for kept in self._kept]),
            'kept_z': np.array([kept.z for kept in self._kept]),
            'rotated': np.array(self._rotated),
            'total_R': self._total.R, 'total_z': self._total.z,
            'turn': np.array(self._forgetting.turn),
        }  # fmt: skip
        for j, factor in enumerate(self._factors):
            for name, array in factor.state().items():
                arrays[f'factor{j}_{name}'] = array
        for name, array in self._retention.state().items():
            arrays[f'retention_{name}'] = array
        return {name: array.copy() for name, array in arrays.items()}

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue exactly where `state` was taken."""
        self._samples = SampleBuffer(state['U'], state['data'], state['weights'], self._budget + 1)
        self._rotated = int(state['rotated'])
        self._kept = tuple(
            Information(np.array(R), np.array(z))
            for R, z in zip(state['kept_R'], state['kept_z'], strict=True)
        )
        self._total = Information(np.array(state['total_R']), np.array(state['total_z']))
        self._forgetting.turn = int(state['turn'])
        for j, factor in enumerate(self._factors):
            factor.restore(_part(state, f'factor{j}_'))
        self._retention.restore(_part(state, 'retention_'))
        self._version += 1

    def _drop(self, m: int) -> None:
        self._retention.drop(self._factors, m)
        weight = self._samples.weights[m]
        for group, factor in zip(self._groups, self._factors, strict=True):
            rows = weight * factor.drop(m)
            if self._remember:
                for j, row in zip(group.outputs, rows, strict=True):
                    self._kept[j].absorb(row[None])
        self._rotated += 1
        self._samples.drop(m)
        if not self._remember:
            self._total = self._with_buffer()

    def _rebuild(self) -> None:
        groups = output_groups(self._model)
        factors = []
        for group in groups:
            factor = GrowingFactor(group, len(self._prior.z), self._budget + 1)
            factor.fill(self._samples.inputs, self._samples.data[:, list(group.outputs)])
            factors.append(factor)
        self._samples = self._samples.with_room(self._budget + 1)
        self._groups, self._factors = groups, tuple(factors)
        self._total = self._with_buffer()
        self._retention.rebuild(self._model, self._factors, self._samples.inputs)
        self._rotated = 0
        self._version += 1

    def _with_buffer(self) -> Information:
        p, weights = len(self._prior.z), self._samples.weights[:, None, None]
        whitened = [(weights * factor.white).reshape(-1, p + 1) for factor in self._factors]
        rows = np.vstack(whitened)
        return self.base.with_rows(rows[:, :-1], rows[:, -1])


def _part(state: Mapping[str, np.ndarray], prefix: str) -> dict[str, np.ndarray]:
    return {k.removeprefix(prefix): v for k, v in state.items() if k.startswith(prefix)}
