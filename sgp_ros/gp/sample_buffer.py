"""The samples that a process is conditioned on, in the order in which they came."""

from __future__ import annotations

import numpy as np

from sgp_ros.gp.model import Observations
from sgp_ros.gp.sliding import SlidingRows

_FULL = np.ones(())


class SampleBuffer:
    """Copies of samples, with room for as many as are held at once.

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
        self._U = _sliding(U, capacity)
        self._data = _sliding(data, capacity)
        self._weights = _sliding(weights, capacity)

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
        return self._data.size

    @property
    def inputs(self) -> np.ndarray:
        """Inputs, a view (size, d)."""
        return self._U.rows

    @property
    def data(self) -> np.ndarray:
        """Regressors and, last, observations, a view (size, k, p + 1)."""
        return self._data.rows

    @property
    def weights(self) -> np.ndarray:
        """Weights of the equations, a view (size,)."""
        return self._weights.rows

    def observations(self) -> Observations:
        """Return a copy of the samples."""
        return Observations(
            self.inputs.copy(), self.data[:, :, :-1].copy(), self.data[:, :, -1].copy()
        )

    def append(self, u: np.ndarray, data: np.ndarray) -> None:
        """Add a sample of weight 1, input u (d,), data (k, p + 1); the first one tells d."""
        if not self.size:
            self._U = _sliding(np.zeros((0, len(u))), self._capacity)
        self._U.append(u)
        self._data.append(data)
        self._weights.append(_FULL)

    def drop(self, m: int) -> None:
        """Remove sample m."""
        self._U.drop(m)
        self._data.drop(m)
        self._weights.drop(m)

    def fade(self, factor: float) -> None:
        """Let all samples count `factor` times as much as before."""
        self._weights.rows[:] *= factor


def _sliding(rows: np.ndarray, capacity: int) -> SlidingRows:
    held = SlidingRows(capacity, rows.shape[1:])
    held.replace(rows)
    return held
