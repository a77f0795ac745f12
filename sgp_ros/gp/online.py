"""Joint inference of W and Z one sample at a time, with a bounded number of samples in Z.

Until the first sample leaves the buffer, everything is exact. From then on the posterior is the
product `p(W | all samples) p(Z | W, buffer)`: the first from a basis that absorbs each sample once
(`gp.inducing_information`), the second from the factored buffer (`gp.buffer`). What this
neglects: Z given W is known from the buffer alone, and for W, Z is what the features of the
inducing points can express.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from sgp_ros.errors import NumericalError
from sgp_ros.gp.buffer import FactoredBuffer, SampleBuffer
from sgp_ros.gp.factor import Whitening, part_of
from sgp_ros.gp.inducing_information import GradualFill, InducingInformation
from sgp_ros.gp.information import Forgetting, Information
from sgp_ros.gp.model import CoefficientPrior, Model, Observations
from sgp_ros.gp.regression import Memory, OnlinePrediction, Regression


class OnlineRegression(Regression):
    """The posterior after each sample.

    Args:
        model: hyper-parameters, k kernels and k noise variances.
        prior: of W.
        memory: how many samples Z is conditioned on, and what W keeps of the others.
    """

    def __init__(self, model: Model, prior: CoefficientPrior, memory: Memory) -> None:
        super().__init__(prior, memory)
        samples = SampleBuffer.empty(len(model.kernels), prior.size)
        self._held = FactoredBuffer(model, samples, memory.budget + 1, memory.policy)
        self._total = self._prior.copy()
        self._basis: InducingInformation | None = None
        self._ahead: GradualFill | None = None

    @property
    def model(self) -> Model:
        """Hyper-parameters in force."""
        return self._held.model

    @property
    def information(self) -> Information:
        """Information on W."""
        return self._total if self._basis is None else self._basis.total

    @property
    def size(self) -> int:
        """Number of samples in the buffer."""
        return self._held.size

    @property
    def unresolved(self) -> int:
        """Samples at which the features had no room for what Z may do there.

        Such samples hold little information on W and Z: Z may take the same value there at each
        return, so they count as if it did.
        """
        return 0 if self._basis is None else self._basis.unresolved

    @property
    def buffer(self) -> Observations:
        """A copy of the buffered samples, in the order in which they came."""
        return self._held.samples.observations()

    @property
    def rotated(self) -> int:
        """Samples dropped since the factors were last computed from the buffer."""
        return self._held.rotated

    @property
    def base(self) -> Information:
        """Information on W of the prior, and of the dropped samples. O(n p^2)."""
        if self._basis is None:
            return self._prior.copy()
        dropped = self._basis.total.less(self._with_buffer())
        return self._prior.with_rows(dropped.R, dropped.z)

    def predict(self, u: np.ndarray, f: np.ndarray) -> OnlinePrediction:
        """Predict X at input u (d,) with regressor f (k, p). O(n^2 / 2) per factor."""
        return self._predict(u, f, self._held.whiten(u))

    def with_regressor(self, prediction: OnlinePrediction, f: np.ndarray) -> OnlinePrediction:
        """Predict for another regressor f (k, p) at an input that Z sees as the same. O(k p^2)."""
        return self._predict(prediction.u, f, prediction.whitenings)

    def _predict(
        self, u: np.ndarray, f: np.ndarray, whitenings: tuple[Whitening, ...]
    ) -> OnlinePrediction:
        explained, mean, variance = self._held.explain(whitenings)
        mean, covariance = self.information.predict(f - explained, mean, variance)
        return OnlinePrediction(mean, covariance, u, f, whitenings, self._version)

    def learn(self, prediction: OnlinePrediction, y: np.ndarray) -> None:
        """Add the sample that `prediction` was made for, observed as y (k,).

        One sample leaves when the budget is exceeded. O(n^2) per factor.

        Raises:
            ValueError: the model changed since the prediction.
            NumericalError: the sample repeats others to rounding; nothing has changed.
        """
        self._require_current(prediction)
        self._held.require_room(prediction.whitenings)
        self._version += 1
        if self._forgetting.factor != 1.0:
            self._fade()
        u, data = prediction.u, np.concatenate([prediction.f, y[:, None]], axis=1)  # (k, p + 1)
        rows = self._held.append(u, prediction.whitenings, data)
        if self._basis is not None:
            self._basis.absorb(u, self._basis.features(u), data)
        else:
            for row in rows:
                self._total.absorb(row)
        self._keep_to_budget()

    def learn_all(self, data: Observations) -> None:
        """Learn samples, the first ones, as `learn` does one by one. O(n^3 / 3) per factor.

        Raises:
            NumericalError: some repeat others to rounding; this model is of no further use.
        """
        if self._forgetting.factor != 1.0:
            for u, f, y in zip(data.U, data.F, data.y, strict=True):
                self.learn(self.predict(u, f), y)
            return
        n = len(data.U)
        rows = np.concatenate([data.F, data.y[..., None]], axis=2)
        samples = SampleBuffer(data.U, rows, np.ones(n), n)
        room = max(self._memory.budget, n) + 1
        self._take(FactoredBuffer(self.model, samples, room, self._held.policy))
        self._keep_to_budget()

    def _fade(self) -> None:
        self._held.samples.fade(self._forgetting.factor)
        if self._basis is None:
            self._forgetting.fade(self._total, ())
        else:
            self._basis.fade(self._forgetting)

    def _look_ahead(self) -> None:
        if self._basis is None and self._memory.remember:
            room = self._memory.budget - self.size
            # What fades as it ages can be absorbed only at the end.
            if room < 0 or self._forgetting.factor == 1.0:
                if self._ahead is None:
                    basis = InducingInformation(self.model, self._prior, self._memory.features)
                    self._ahead = GradualFill(basis)
                self._ahead.catch_up(self._held.samples, room)

    def _keep_to_budget(self) -> None:
        self._look_ahead()
        while self.size > self._memory.budget:
            if self._ahead is not None:
                self._basis, self._ahead = self._ahead.information, None
            self._held.drop()
            if self._basis is None:
                self._total = self._with_buffer()

    def is_sound(self, prediction: OnlinePrediction) -> bool:
        """Whether every factor gave the observation a positive variance."""
        try:
            self._held.require_room(prediction.whitenings)
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
        before = self._held
        self._take(
            FactoredBuffer(self.model, before.samples, self._memory.budget + 1, before.policy)
        )
        return before.distance(self._held)

    def change(self, model: Model | None = None, memory: Memory | None = None) -> None:
        """Take other hyper-parameters, another memory, or both.

        O(n^3) for each factor whose hyper-parameters or room are others than before.

        Raises:
            NumericalError: the buffer has no factor under the new hyper-parameters; nothing has
                changed.
        """
        model, memory = model or self.model, memory or self._memory
        samples = self._held.samples
        room = max(memory.budget, self.size) + 1
        held = FactoredBuffer(model, samples, room, memory.policy, before=self._held)
        basis = self._basis if memory.remember else None
        if basis is not None and model != self.model:
            basis = basis.under(model, samples, is_whole=False)
        if memory.forgetting != self._memory.forgetting:
            self._forgetting = Forgetting(memory.forgetting, self._prior)
        self._memory, self._basis = memory, basis
        self._take(held)
        self._ahead = None
        self._keep_to_budget()

    def state(self) -> dict[str, np.ndarray]:
        """Return everything that was learned, as arrays; `restore` takes it back."""
        arrays = {
            'total_R': self._total.R, 'total_z': self._total.z,
            'turn': np.array(self._forgetting.turn),
        }  # fmt: skip
        arrays |= self._held.state()
        if self._basis is not None:
            arrays |= {f'basis_{name}': array for name, array in self._basis.state().items()}
        return {name: array.copy() for name, array in arrays.items()}

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue exactly where `state` was taken."""
        self._held.restore(state, self._memory.budget + 1)
        self._total = Information(np.array(state['total_R']), np.array(state['total_z']))
        self._forgetting.turn = int(state['turn'])
        basis = part_of(state, 'basis_')
        self._basis = None
        if basis:
            self._basis = InducingInformation.restored(
                self.model, self._prior, self._memory.features, basis
            )
        self._ahead = None
        self._version += 1

    def _take(self, held: FactoredBuffer) -> None:
        self._held = held
        if self._basis is None:
            self._total = self._with_buffer()
        self._version += 1

    def _with_buffer(self) -> Information:
        rows = self._held.rows
        return self._prior.with_rows(rows[:, :-1], rows[:, -1])
