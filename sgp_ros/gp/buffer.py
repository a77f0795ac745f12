"""Buffered samples, and the factors of their covariance: one growing factor per group of outputs.

Components of X with the same covariance up to a scale share one growing factor L, with
`A = L^-1 F` and `b = L^-1 y` of each beside it. Appending borders the factor; the solve it needs
is the one the prediction made. Which sample leaves is a policy (`gp.retention`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from sgp_ros.gp.factor import GrowingFactor, Whitening, length_for, part_of
from sgp_ros.gp.model import Model, Observations, OutputGroup, output_groups
from sgp_ros.gp.retention import RETENTIONS


class SlidingRows:
    """A growing list of rows in one block of memory.

    Attributes:
        start: first live row in the block.
        size: rows held.

    Args:
        capacity: most rows held at once.
        shape: of a row.
    """

    def __init__(self, capacity: int, shape: tuple[int, ...]) -> None:
        self._block = np.zeros((length_for(capacity), *shape))
        self.start = 0
        self.size = 0

    @property
    def rows(self) -> np.ndarray:
        """The rows in order, a view (size, ...)."""
        return self._block[self.start : self.start + self.size]

    def grown(self) -> np.ndarray:
        """Return one more row at the end, to be filled."""
        if self.start + self.size == len(self._block):
            self.replace(self.rows)
        self.size += 1
        return np.asarray(self._block[self.start + self.size - 1])

    def drop(self, m: int) -> None:
        """Remove row m; those before it move up. O(m), nothing is copied for m = 0."""
        self.size -= 1
        if m == self.size:
            return
        if m:
            live = slice(self.start, self.start + m)
            self._block[self.start + 1 : self.start + 1 + m] = self._block[live]
        self.start += 1

    def replace(self, rows: np.ndarray) -> None:
        """Hold these rows instead."""
        self._block[: len(rows)] = rows
        self.start, self.size = 0, len(rows)


class SampleBuffer:
    """Copies of samples, with room for as many as are held at once.

    Attributes:
        shape: of the data of a sample, (k, p + 1).

    Args:
        U: (n, d) inputs.
        data: (n, k, p + 1) regressors and, last, observations.
        weights: (n,) by which their equations of unit noise count for W.
        capacity: most samples held at once.
    """

    def __init__(
        self, U: np.ndarray, data: np.ndarray, weights: np.ndarray, capacity: int
    ) -> None:
        self._capacity = capacity
        self.shape: tuple[int, ...] = data.shape[1:]
        self._hold(U, data, weights)

    def _hold(self, U: np.ndarray, data: np.ndarray, weights: np.ndarray) -> None:
        self._inputs = U.shape[1]
        flat = data.reshape(len(U), math.prod(self.shape))
        rows = np.concatenate([U, flat, weights[:, None]], axis=1)
        self._rows = SlidingRows(self._capacity, rows.shape[1:])
        self._rows.replace(rows)

    @classmethod
    def empty(cls, k: int, p: int) -> SampleBuffer:
        """Return a buffer without samples or room, for k outputs and p coefficients."""
        return cls(np.zeros((0, 0)), np.zeros((0, k, p + 1)), np.zeros(0), 0)

    def with_room(self, capacity: int) -> SampleBuffer:
        """Return a copy with this capacity."""
        return SampleBuffer(self.inputs, self.data, self.weights, capacity)

    @property
    def size(self) -> int:
        """Samples held."""
        return self._rows.size

    @property
    def inputs(self) -> np.ndarray:
        """Inputs, a view (size, d)."""
        return self._rows.rows[:, : self._inputs]

    @property
    def data(self) -> np.ndarray:
        """Regressors and, last, observations, a view (size, k, p + 1)."""
        return self._rows.rows[:, self._inputs : -1].reshape(self.size, *self.shape)

    @property
    def weights(self) -> np.ndarray:
        """Weights of the equations, a view (size,)."""
        return self._rows.rows[:, -1]

    def observations(self) -> Observations:
        """Return a copy of the samples."""
        return Observations(
            self.inputs.copy(), self.data[:, :, :-1].copy(), self.data[:, :, -1].copy()
        )

    def append(self, u: np.ndarray, data: np.ndarray) -> None:
        """Add a sample of weight 1, input u (d,), data (k, p + 1); the first one tells d."""
        if len(u) != self._inputs:
            self._hold(np.zeros((0, len(u))), np.zeros((0, *self.shape)), np.zeros(0))
        row = self._rows.grown()
        row[: len(u)] = u
        row[len(u) : -1] = data.reshape(-1)
        row[-1] = 1.0

    def drop(self, m: int) -> None:
        """Remove sample m."""
        self._rows.drop(m)

    def fade(self, factor: float) -> None:
        """Let all samples count `factor` times as much as before."""
        self.weights[:] *= factor


class FactoredBuffer:
    """Samples and their factors.

    Attributes:
        model: hyper-parameters, k kernels and k noise variances.
        samples: held, in the order in which they came.
        groups: of outputs that share a factor.
        factors: one per group.
        room: most samples held at once.
        policy: which sample leaves, a key of `RETENTIONS`.
        rotated: samples dropped since the factors were computed.

    Args:
        model: hyper-parameters.
        samples: to begin with.
        room: most samples held at once.
        policy: which sample leaves.
        before: the same samples under other hyper-parameters or with other room. Factors of
            groups that are the same are taken over, and `before` must not learn any more.

    Raises:
        NumericalError: the samples have no factor in double precision.
    """

    def __init__(
        self,
        model: Model,
        samples: SampleBuffer,
        room: int,
        policy: str,
        before: FactoredBuffer | None = None,
    ) -> None:
        self.model = model
        self.samples = samples.with_room(room)
        self.groups = output_groups(model)
        self._places = tuple(group.place for group in self.groups)
        self.room = room
        kept: dict[OutputGroup, GrowingFactor] = {}
        if before is not None and before.room == room:
            kept = dict(zip(before.groups, before.factors, strict=True))
        self.factors: tuple[GrowingFactor, ...] = tuple(
            kept.get(group) or self._factored(group) for group in self.groups
        )
        self.policy = policy
        self._retention = RETENTIONS[policy]()
        self._retention.rebuild(model, self.factors, self.samples.inputs)
        is_kept = before is not None and not kept.keys().isdisjoint(self.groups)
        self.rotated: int = before.rotated if before is not None and is_kept else 0

    def _factored(self, group: OutputGroup) -> GrowingFactor:
        factor = GrowingFactor(group, self.samples.data.shape[2] - 1, self.room)
        factor.fill(self.samples.inputs, self.samples.data[:, list(group.outputs)])
        return factor

    @property
    def size(self) -> int:
        """Samples held."""
        return self.samples.size

    @property
    def rows(self) -> np.ndarray:
        """Information of the samples on W: rows of unit noise and their values, (n k, p + 1)."""
        width = self.samples.data.shape[2]
        weights = self.samples.weights[:, None, None]
        return np.vstack([(weights * factor.white).reshape(-1, width) for factor in self.factors])

    def whiten(self, u: np.ndarray) -> tuple[Whitening, ...]:
        """Return an input u (d,) against the samples, one per factor. O(n^2 / 2) each."""
        return tuple(factor.whiten(u) for factor in self.factors)

    def explain(
        self, whitenings: tuple[Whitening, ...]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the prediction at an input: of each regressor, of Z, and its variance.

        Returns:
            Shapes (k, p), (k,) and (k,): Z is the second less the first times W.
        """
        if len(self.factors) == 1:  # of all outputs, in order
            (whole,) = whitenings
            variance = self.factors[0].squared_scales * whole.variance
            return whole.explained[:, :-1], whole.explained[:, -1], variance
        explained, variance = np.empty(self.samples.shape), np.empty(self.samples.shape[0])
        for factor, place, whitening in zip(self.factors, self._places, whitenings, strict=True):
            explained[place] = whitening.explained
            variance[place] = factor.squared_scales * whitening.variance
        return explained[:, :-1], explained[:, -1], variance

    def require_room(self, whitenings: tuple[Whitening, ...]) -> None:
        """Refuse an input that repeats the samples.

        Raises:
            NumericalError: a factor would lose its positive diagonal.
        """
        for factor, whitening in zip(self.factors, whitenings, strict=True):
            factor.pivot(whitening)

    def append(
        self, u: np.ndarray, whitenings: tuple[Whitening, ...], data: np.ndarray
    ) -> list[np.ndarray]:
        """Add a sample at the input u (d,) of `whitenings`. O(n) per factor.

        Args:
            u: input.
            whitenings: of it.
            data: regressors and, last, observations (k, p + 1).

        Returns:
            `p(y | earlier samples, W)`: rows of unit noise and their values, per factor.
        """
        rows = [
            factor.append(whitening, data[place])
            for place, factor, whitening in zip(
                self._places, self.factors, whitenings, strict=True
            )
        ]
        self.samples.append(u, data)
        self._retention.append(self.factors, u)
        return rows

    def drop(self) -> None:
        """Remove the sample that the policy chooses. O(n^2) per factor."""
        m = self._retention.choose(self.factors)
        self._retention.drop(self.factors, m)
        for factor in self.factors:
            factor.drop(m)
        self.samples.drop(m)
        self.rotated += 1

    def distance(self, exact: FactoredBuffer) -> float:
        """Return the largest relative distance of a factor from that of the same samples."""
        pairs = zip(self.factors, exact.factors, strict=True)
        return max((one.distance(other) for one, other in pairs), default=0.0)

    def state(self) -> dict[str, np.ndarray]:
        """Return what `restore` needs, as arrays."""
        arrays = {
            'U': self.samples.inputs, 'data': self.samples.data,
            'weights': self.samples.weights, 'rotated': np.array(self.rotated),
        }  # fmt: skip
        for j, factor in enumerate(self.factors):
            arrays |= {f'factor{j}_{name}': array for name, array in factor.state().items()}
        retained = self._retention.state()
        return arrays | {f'retention_{name}': array for name, array in retained.items()}

    def restore(self, state: Mapping[str, np.ndarray], room: int) -> None:
        """Continue exactly where `state` was taken, with room for so many samples."""
        self.samples = SampleBuffer(state['U'], state['data'], state['weights'], room)
        self.rotated = int(state['rotated'])
        for j, factor in enumerate(self.factors):
            factor.restore(part_of(state, f'factor{j}_'))
        self._retention.restore(part_of(state, 'retention_'))
