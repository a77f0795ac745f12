"""Joint inference of W and Z over a stream of any length, at constant cost and memory.

Z is a sum of features of a bounded number of inputs, so it is linear in weights as physics is in
W, and one least-squares problem in square-root form holds all that was ever learned: each sample
is a row, rotated into the weights of its component first, then into W. No sample has to be kept
for that and none counts twice, however often the robot comes back to a place. A few are
kept all the same: hyper-parameters are fitted to them, and under new ones, which
mean new features, Z is learned from them again.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sgp_ros.core.feature_block import FeatureBlock, remainder_of
from sgp_ros.core.forgetting import Forgetting
from sgp_ros.core.information import Information
from sgp_ros.core.model import Observations
from sgp_ros.core.online_prediction import OnlinePrediction

if TYPE_CHECKING:
    from collections.abc import Mapping

    from sgp_ros.core.factor import Whitening
    from sgp_ros.core.model import Model
    from sgp_ros.core.prior import CoefficientPrior

_ARRAYS = ('U', 'F', 'y')


class BasisRegression:
    """The posterior after each sample, in a basis of bounded size.

    Args:
        model: hyper-parameters, k kernels and k noise variances.
        prior: of W.
        budget: most samples kept for fits of the hyper-parameters; at least half as many are.
        features: most features of each component.
        remember: whether W keeps under new hyper-parameters what samples told that are gone.
        forgetting: samples after which what was learned counts 1/e; 0 never forgets.
    """

    def __init__(
        self,
        model: Model,
        prior: CoefficientPrior,
        budget: int,
        features: int,
        *,
        remember: bool = True,
        forgetting: float = 0.0,
    ) -> None:
        self._prior = Information.of_prior(prior)
        self._forgetting = Forgetting(forgetting, self._prior)
        self._features = features
        self._budget = budget
        self._remember = remember
        self._model = model
        self._version = 0
        p, k = prior.size, len(model.kernels)
        self._U = np.zeros((0, 0))
        self._F = np.zeros((0, k, p))
        self._y = np.zeros((0, k))
        self._middle = self._gone = self._unresolved = 0
        self._told = _nothing(p, k)
        self._told_middle = _nothing(p, k)
        self._told_first = _nothing(p, k)
        self._total = self._prior.copy()
        self._blocks = self._fresh_blocks()

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
        """Number of samples kept for fits."""
        return len(self._U)

    @property
    def features(self) -> tuple[int, ...]:
        """Features in use by each component."""
        return tuple(block.size for block in self._blocks)

    @property
    def unresolved(self) -> int:
        """Samples at which the features of a component had no room for what Z may do there.

        Such a remainder counts as noise that is new at each sample, though it is the same at each
        return to the place: where there are many, the intervals of W are too narrow.
        """
        return self._unresolved

    @property
    def is_whole(self) -> bool:
        """Whether the kept samples are the whole stream: new features would lose nothing."""
        return self._gone == 0

    @property
    def buffer(self) -> Observations:
        """The kept samples, the last ones of the stream."""
        return Observations(self._U, self._F, self._y)

    @property
    def base(self) -> Information:
        """What the prior and the samples before the kept ones tell of W."""
        if not self._remember:
            return self._prior.copy()
        rows = [told.R for told in self._told_first]
        values = [told.z for told in self._told_first]
        return self._prior.with_rows(np.vstack(rows), np.concatenate(values))

    def predict(self, u: np.ndarray, f: np.ndarray) -> OnlinePrediction:
        """Predict X at input u (d,) with regressor f (k, p). O(k m^2)."""
        features = tuple(block.features(u) for block in self._blocks)
        gains = tuple(b.gain(phi) for b, phi in zip(self._blocks, features, strict=True))
        return self._predict(u, f, features, gains)

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
        for j, (block, phi, g) in enumerate(zip(self._blocks, features, gains, strict=True)):
            coupling = g @ block.S[: len(g)]  # (p + 1,)
            rows[j] -= coupling[:-1]
            mean[j] = coupling[-1]
            variance[j] = g @ g + remainder_of(phi)
        mean, covariance = self._total.predict(rows, mean, variance)
        return OnlinePrediction(mean, covariance, u, f, features, self._version, gains)

    def learn(self, prediction: OnlinePrediction, y: np.ndarray) -> None:
        """Add the sample that `prediction` was made for, observed as y (k,). O(k m (m + p)).

        Raises:
            ValueError: the model changed since the prediction.
        """
        if prediction.version != self._version:
            raise ValueError('the prediction was made before the last change of the model')
        self._version += 1
        self._fade()
        self._absorb(prediction.whitenings, prediction.f, y)
        u = prediction.u[None]
        self._U = np.concatenate([self._U, u]) if self.size else u.copy()
        self._F = np.concatenate([self._F, prediction.f[None]])
        self._y = np.concatenate([self._y, y[None]])
        self._forget_half()

    def _fade(self) -> None:
        if self._forgetting.factor == 1.0:
            return
        stages = (self._told, self._told_middle, self._told_first)
        self._forgetting.fade(self._total, [told for stage in stages for told in stage])
        for block, told in zip(self._blocks, self._told, strict=True):
            rest = block.fade(self._forgetting)
            self._total.absorb(rest)
            told.absorb(rest)

    def _absorb(
        self,
        features: tuple[Whitening, ...],
        f: np.ndarray,
        y: np.ndarray,
        weight: float = 1.0,
    ) -> None:
        resolved = True
        for j, block in enumerate(self._blocks):
            rest = block.absorb(features[j], f[j], float(y[j]), weight)[None]
            resolved &= block.is_resolved
            self._total.absorb(rest)
            self._told[j].absorb(rest)
        self._unresolved += not resolved

    def _forget_half(self) -> None:
        """Let the older part of the kept samples go once both parts are full."""
        if self.size - self._middle >= max(self._budget // 2, 1):
            first = self._middle
            self._U, self._F, self._y = self._U[first:], self._F[first:], self._y[first:]
            self._gone += first
            self._told_first = self._told_middle
            self._told_middle = tuple(told.copy() for told in self._told)
            self._middle = self.size

    def change(
        self,
        model: Model | None = None,
        budget: int | None = None,
        *,
        remember: bool | None = None,
        policy: str | None = None,
        forgetting: float | None = None,
    ) -> None:
        """Take other hyper-parameters, budget or memory; `policy` says nothing here.

        Other hyper-parameters mean other features: Z is learned again from the kept samples, W
        also from what it remembers of those before. O(n k m (m + p)) for n kept samples.

        """
        del policy
        self._budget = budget or self._budget
        self._remember = self._remember if remember is None else remember
        if model is not None and model != self._model:
            self._learn_again(model)
        if forgetting is not None:
            self._forgetting = Forgetting(forgetting, self._prior)

    def _learn_again(self, model: Model) -> None:
        ratios = np.sqrt(np.array(self._model.noise) / np.array(model.noise))
        self._told = tuple(
            told.scaled(float(ratio) if self._remember else 0.0)
            for told, ratio in zip(self._told_first, ratios, strict=True)
        )
        self._told_first = tuple(told.copy() for told in self._told)
        self._model = model
        self._blocks = self._fresh_blocks()
        self._total = self.base
        for i, (u, f, y) in enumerate(zip(self._U, self._F, self._y, strict=True)):
            if i == self._middle:
                self._told_middle = tuple(told.copy() for told in self._told)
            weight = self._forgetting.factor ** (self.size - 1 - i)
            self._absorb(tuple(block.features(u) for block in self._blocks), f, y, weight)
        self._version += 1

    def state(self) -> dict[str, np.ndarray]:
        """Return everything that was learned, as arrays; `restore` takes it back."""
        arrays = {name: getattr(self, f'_{name}') for name in _ARRAYS}
        counts = [self._middle, self._gone, self._unresolved, self._forgetting.turn]
        arrays['counts'] = np.array(counts)
        arrays |= {'total_R': self._total.R, 'total_z': self._total.z}
        for name in ('told', 'told_middle', 'told_first'):
            for j, told in enumerate(getattr(self, f'_{name}')):
                arrays |= {f'{name}{j}_R': told.R, f'{name}{j}_z': told.z}
        for j, block in enumerate(self._blocks):
            arrays |= {f'block{j}_{name}': array for name, array in block.state().items()}
        return {name: array.copy() for name, array in arrays.items()}

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue exactly where `state` was taken."""
        self._U, self._F, self._y = (np.array(state[name]) for name in _ARRAYS)
        counts = (int(n) for n in state['counts'])
        self._middle, self._gone, self._unresolved, self._forgetting.turn = counts
        self._total = _read(state, 'total')
        k = len(self._blocks)
        self._told = tuple(_read(state, f'told{j}') for j in range(k))
        self._told_middle = tuple(_read(state, f'told_middle{j}') for j in range(k))
        self._told_first = tuple(_read(state, f'told_first{j}') for j in range(k))
        for j, block in enumerate(self._blocks):
            prefix = f'block{j}_'
            block.restore(
                {n.removeprefix(prefix): a for n, a in state.items() if n.startswith(prefix)}
            )
        self._version += 1

    def _fresh_blocks(self) -> tuple[FeatureBlock, ...]:
        p = len(self._prior.z)
        pairs = zip(self._model.kernels, self._model.noise, strict=True)
        return tuple(FeatureBlock(kernel, v, p, self._features) for kernel, v in pairs)


def _nothing(p: int, k: int) -> tuple[Information, ...]:
    return tuple(Information.nothing(p) for _ in range(k))


def _read(state: Mapping[str, np.ndarray], name: str) -> Information:
    return Information(np.array(state[f'{name}_R']), np.array(state[f'{name}_z']))
