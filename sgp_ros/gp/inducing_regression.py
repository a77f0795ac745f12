"""Inducing-point GP: joint inference of W and Z over a stream, at constant cost and memory.

W and Z are predicted from the information of the whole stream (`gp.inducing_information`). No
sample has to be kept for that. The last ones are kept all the same: hyper-parameters are fitted to
them, and what other hyper-parameters need beyond that information is learned from them.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from sgp_ros.gp.buffer import SampleBuffer
from sgp_ros.gp.factor import Whitening, part_of
from sgp_ros.gp.inducing_information import InducingInformation
from sgp_ros.gp.information import Forgetting, Information
from sgp_ros.gp.model import CoefficientPrior, Model, Observations
from sgp_ros.gp.regression import Memory, OnlinePrediction, Regression


class InducingPointRegression(Regression):
    """The posterior after each sample, in a basis of bounded size.

    Args:
        model: hyper-parameters, k kernels and k noise variances.
        prior: of W.
        memory: how many samples are kept for fits of the hyper-parameters, the last ones, and how
            many inducing points there may be.
    """

    def __init__(self, model: Model, prior: CoefficientPrior, memory: Memory) -> None:
        super().__init__(prior, memory)
        self._model = model
        self._gone = 0
        self._samples = SampleBuffer.empty(len(model.kernels), prior.size).with_room(
            memory.budget + 1
        )
        self._basis = InducingInformation(model, self._prior, memory.features)

    @property
    def model(self) -> Model:
        """Hyper-parameters in force."""
        return self._model

    @property
    def information(self) -> Information:
        """Information on W."""
        return self._basis.total

    @property
    def size(self) -> int:
        """Number of samples kept for fits."""
        return self._samples.size

    @property
    def features(self) -> tuple[int, ...]:
        """Features in use by each component."""
        sizes = {j: points.size for points in self._basis.sets for j in points.group.outputs}
        return tuple(sizes[j] for j in sorted(sizes))

    @property
    def unresolved(self) -> int:
        """Samples at which the features of a component had no room for what Z may do there.

        Such samples hold little information on W and Z: Z may take the same value there at each
        return, so they count as if it did.
        """
        return self._basis.unresolved

    @property
    def buffer(self) -> Observations:
        """A copy of the kept samples, the last ones of the stream."""
        return self._samples.observations()

    @property
    def base(self) -> Information:
        """Information on W of the prior, and of the samples that are gone. O(n m^2)."""
        if not (self._memory.remember and self._gone):
            return self._prior.copy()
        kept = InducingInformation.of_samples(
            self._model, self._prior, self._memory.features, self._samples
        )
        gone = self._basis.total.less(kept.total)
        return self._prior.with_rows(gone.R, gone.z)

    def predict(self, u: np.ndarray, f: np.ndarray) -> OnlinePrediction:
        """Predict X at input u (d,) with regressor f (k, p). O(k m^2)."""
        features = self._basis.features(u)
        pairs = zip(self._basis.sets, features, strict=True)
        return self._predict(u, f, features, tuple(points.gain(found) for points, found in pairs))

    def with_regressor(self, prediction: OnlinePrediction, f: np.ndarray) -> OnlinePrediction:
        """Predict for another regressor f (k, p) at an input that Z sees as the same. O(k m p)."""
        return self._predict(prediction.u, f, prediction.whitenings, prediction.gains)

    def _predict(
        self,
        u: np.ndarray,
        f: np.ndarray,
        features: tuple[Whitening, ...],
        gains: tuple[np.ndarray, ...],
    ) -> OnlinePrediction:
        rows, mean, variance = f.copy(), np.zeros(len(f)), np.zeros(len(f))
        for points, found, gain in zip(self._basis.sets, features, gains, strict=True):
            place = points.place
            explained, mean[place], variance[place] = points.explain(found, gain)
            rows[place] -= explained
        mean, covariance = self._basis.total.predict(rows, mean, variance)
        return OnlinePrediction(mean, covariance, u, f, features, self._version, gains)

    def learn(self, prediction: OnlinePrediction, y: np.ndarray) -> None:
        """Add the sample that `prediction` was made for, observed as y (k,). O(k m (m + p)).

        Raises:
            ValueError: the model changed since the prediction.
        """
        self._require_current(prediction)
        data = np.concatenate([prediction.f, y[:, None]], axis=1)  # (k, p + 1)
        self._learn(prediction.u, prediction.whitenings, data)

    def learn_all(self, data: Observations) -> None:
        """Learn samples as `learn` does one by one."""
        for u, f, y in zip(data.U, data.F, data.y, strict=True):
            self._learn(u, self._basis.features(u), np.concatenate([f, y[:, None]], axis=1))

    def _learn(self, u: np.ndarray, features: tuple[Whitening, ...], data: np.ndarray) -> None:
        self._version += 1
        if self._forgetting.factor != 1.0:
            self._basis.fade(self._forgetting)
            self._samples.fade(self._forgetting.factor)
        self._basis.absorb(u, features, data)
        self._samples.append(u, data)
        self._keep_to_budget()

    def _keep_to_budget(self) -> None:
        while self.size > self._memory.budget:
            self._samples.drop(0)
            self._gone += 1

    def change(self, model: Model | None = None, memory: Memory | None = None) -> None:
        """Take other hyper-parameters, another memory, or both.

        While the kept samples are the whole stream, it is learned again under other
        hyper-parameters; later its information is taken over (`gp.inducing_information`), or
        without remembering the kept samples are learned again. O(k m^3 + n k m^2).
        """
        memory = memory or self._memory
        if model is not None and model != self._model:
            if self._gone and not memory.remember:
                self._basis = InducingInformation.of_samples(
                    model, self._prior, memory.features, self._samples
                )
                self._gone = 0
            else:
                self._basis = self._basis.under(model, self._samples, is_whole=not self._gone)
            self._model = model
            self._version += 1
        if memory.forgetting != self._memory.forgetting:
            self._forgetting = Forgetting(memory.forgetting, self._prior)
        self._memory = memory
        self._keep_to_budget()
        self._samples = self._samples.with_room(memory.budget + 1)

    def state(self) -> dict[str, np.ndarray]:
        """Return everything that was learned, as arrays; `restore` takes it back."""
        arrays = {
            'U': self._samples.inputs, 'data': self._samples.data,
            'weights': self._samples.weights,
            'counts': np.array([self._gone, self._forgetting.turn]),
        }  # fmt: skip
        arrays |= {f'basis_{name}': array for name, array in self._basis.state().items()}
        return {name: array.copy() for name, array in arrays.items()}

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue exactly where `state` was taken."""
        self._samples = SampleBuffer(
            state['U'], state['data'], state['weights'], self._memory.budget + 1
        )
        self._gone, self._forgetting.turn = (int(count) for count in state['counts'])
        self._basis = InducingInformation.restored(
            self._model, self._prior, self._memory.features, part_of(state, 'basis_')
        )
        self._version += 1
