"""Joint inference of W and Z one sample at a time, with a bounded number of samples in Z.

Each component of X has its own growing factor L with `A = L^-1 F` and `b = L^-1 y` beside it.
Appending borders the factor; the solve it needs is the one the prediction made. Dropping a sample
rotates the factor and leaves the conditional row of that sample: information on W that no
remaining sample repeats. With `remember` it is kept, and the likelihood is a product of
conditionals in which every sample counts once (Vecchia 1988). What is kept was whitened with
the noise of its time; when a fit finds another noise, it is scaled to that.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sgp_ros.core.factor import GrowingFactor
from sgp_ros.core.information import Information
from sgp_ros.core.model import Observations

if TYPE_CHECKING:
    from collections.abc import Mapping

    from sgp_ros.core.model import Model
    from sgp_ros.core.prior import CoefficientPrior


@dataclass(frozen=True, slots=True, eq=False)
class OnlinePrediction:
    """Prediction of X at one input, with what learning it reuses.

    Attributes:
        mean: (k,).
        covariance: (k, k) of X, without noise; infinite on the diagonal where an undetermined
            direction of W enters.
        u, f: the input (d,) and regressor (k, p) it was made for.
        solves: `L^-1 k*` per component, (n,) each.
        version: state of the model it was made with.
    """

    mean: np.ndarray
    covariance: np.ndarray
    u: np.ndarray
    f: np.ndarray
    solves: tuple[np.ndarray, ...]
    version: int


class OnlineRegression:
    """The posterior after each sample.

    Args:
        model: hyper-parameters, k kernels and k noise variances.
        prior: of W.
        budget: most samples that Z is conditioned on.
        remember: whether W keeps what dropped samples told about it.
    """

    def __init__(
        self, model: Model, prior: CoefficientPrior, budget: int, *, remember: bool = True
    ) -> None:
        self._prior = Information.of_prior(prior)
        self._total = self._prior.copy()
        self._budget = budget
        self._remember = remember
        self._version = 0
        p = prior.size
        self._U = np.zeros((0, 0))
        self._F = np.zeros((0, len(model.kernels), p))
        self._y = np.zeros((0, len(model.kernels)))
        self._model = model
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
        return len(self._U)

    @property
    def buffer(self) -> Observations:
        """The buffered samples, oldest first."""
        return Observations(self._U, self._F, self._y)

    @property
    def base(self) -> Information:
        """What the prior and the dropped samples tell of W."""
        rows = [kept.R for kept in self._kept]
        values = [kept.z for kept in self._kept]
        return self._prior.with_rows(np.vstack(rows), np.concatenate(values))

    def predict(self, u: np.ndarray, f: np.ndarray) -> OnlinePrediction:
        """Predict X at input u (d,) with regressor f (k, p). O(k n^2)."""
        return self._predict(u, f, tuple(factor.solve(u) for factor in self._factors))

    def with_regressor(self, prediction: OnlinePrediction, f: np.ndarray) -> OnlinePrediction:
        """Predict for another regressor f (k, p) at an input that Z sees as the same. O(k n p)."""
        return self._predict(prediction.u, f, prediction.solves)

    def _predict(
        self, u: np.ndarray, f: np.ndarray, solves: tuple[np.ndarray, ...]
    ) -> OnlinePrediction:
        rows = f.copy()
        mean = np.zeros(len(f))
        variance = np.zeros(len(f))
        for j, (factor, v) in enumerate(zip(self._factors, solves, strict=True)):
            n = len(v)
            rows[j] -= v @ factor.A[:n]
            mean[j] = v @ factor.b[:n]
            variance[j] = factor.prior_variance(u) - v @ v
        mean += rows @ self._total.coefficients
        spread = self._total.spread(rows)  # (k, r)
        covariance = spread @ spread.T
        covariance[np.diag_indices(len(f))] += variance
        unknown = ~self._total.is_determined(rows)
        covariance[unknown, unknown] = np.inf
        return OnlinePrediction(mean, covariance, u, f, solves, self._version)

    def learn(self, prediction: OnlinePrediction, y: np.ndarray) -> None:
        """Add the sample that `prediction` was made for, observed as y (k,).

        The oldest sample leaves when the budget is reached. O(k n^2).

        Raises:
            ValueError: the model changed since the prediction.
            NumericalError: the sample repeats others to rounding; nothing has changed.
        """
        if prediction.version != self._version:
            raise ValueError('the prediction was made before the last change of the model')
        for factor, v in zip(self._factors, prediction.solves, strict=True):
            factor.pivot(v, prediction.u)
        self._version += 1
        for j, (factor, v) in enumerate(zip(self._factors, prediction.solves, strict=True)):
            row, value = factor.append(v, prediction.u, prediction.f[j], float(y[j]))
            self._total.absorb(row, value)
        self._U = _appended(self._U, prediction.u)
        self._F = _appended(self._F, prediction.f)
        self._y = _appended(self._y, y)
        while self.size > self._budget:
            self._drop_oldest()

    def change(
        self,
        model: Model | None = None,
        budget: int | None = None,
        *,
        remember: bool | None = None,
    ) -> None:
        """Take other hyper-parameters, budget or memory; refactorises the buffer, O(k n^3).

        Raises:
            NumericalError: the buffer has no factor under the new hyper-parameters; nothing has
                changed then.
        """
        previous = (self._model, self._budget, self._remember, self._kept)
        if model is not None:
            ratios = np.sqrt(np.array(self._model.noise) / np.array(model.noise))
            self._kept = tuple(
                kept.scaled(float(ratio)) for kept, ratio in zip(self._kept, ratios, strict=True)
            )
            self._model = model
        self._budget = budget or self._budget
        self._remember = self._remember if remember is None else remember
        try:
            while self.size > self._budget:
                self._drop_oldest()
            self._rebuild()
        except Exception:
            self._model, self._budget, self._remember, self._kept = previous
            raise

    def state(self) -> dict[str, np.ndarray]:
        """Return everything that was learned, as arrays; `restore` takes it back."""
        arrays = {
            'U': self._U, 'F': self._F, 'y': self._y,
            'kept_R': np.array([kept.R for kept in self._kept]),
            'kept_z': np.array([kept.z for kept in self._kept]),
            'total_R': self._total.R, 'total_z': self._total.z,
        }  # fmt: skip
        for j, factor in enumerate(self._factors):
            for name, array in factor.state().items():
                arrays[f'factor{j}_{name}'] = array
        return {name: array.copy() for name, array in arrays.items()}

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue exactly where `state` was taken."""
        self._U, self._F, self._y = (np.array(state[name]) for name in ('U', 'F', 'y'))
        self._kept = tuple(
            Information(np.array(R), np.array(z))
            for R, z in zip(state['kept_R'], state['kept_z'], strict=True)
        )
        self._total = Information(np.array(state['total_R']), np.array(state['total_z']))
        for j, factor in enumerate(self._factors):
            prefix = f'factor{j}_'
            factor.restore(
                {k.removeprefix(prefix): v for k, v in state.items() if k.startswith(prefix)}
            )
        self._version += 1

    def _drop_oldest(self) -> None:
        for factor, kept in zip(self._factors, self._kept, strict=True):
            row, value = factor.drop(0)
            if self._remember:
                kept.absorb(row, value)
        self._U, self._F, self._y = self._U[1:], self._F[1:], self._y[1:]
        if not self._remember:
            self._total = self._with_buffer()

    def _rebuild(self) -> None:
        factors = []
        for j, kernel in enumerate(self._model.kernels):
            factor = GrowingFactor(
                kernel, self._model.noise[j], len(self._prior.z), self._budget + 1
            )
            factor.refactorise(self._U, self._F[:, j], self._y[:, j])
            factors.append(factor)
        self._factors = tuple(factors)
        self._total = self._with_buffer()
        self._version += 1

    def _with_buffer(self) -> Information:
        rows = [factor.A[: factor.size] for factor in self._factors]
        values = [factor.b[: factor.size] for factor in self._factors]
        return self.base.with_rows(np.vstack(rows), np.concatenate(values))


def _appended(array: np.ndarray, row: np.ndarray) -> np.ndarray:
    if not len(array):
        return row[None].copy()
    return np.concatenate([array, row[None]])
