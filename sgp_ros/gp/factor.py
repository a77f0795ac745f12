"""A Cholesky factor that grows by a row, drops any sample and takes a rank-one change.

Whitened data stand beside it and take the same rotations.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from sgp_ros.errors import NumericalError
from sgp_ros.gp.factor_loops import (
    absorb_column,
    close_gap,
    combine_rows,
    inverse_column,
    move_to_front,
    solve_lower,
)
from sgp_ros.gp.linear_algebra import covariance_factor
from sgp_ros.gp.model import OutputGroup

ROOM = 64
"""Least number of rows that a window may slide before everything moves to the front."""


def length_for(capacity: int) -> int:
    """Return how many rows to hold so that a move of `capacity` rows is rare.

    A quarter more: the factor of n samples then moves once in n / 4 samples, which adds a
    hundredth to what each of them costs at n = 250 and less above.
    """
    return capacity + max(ROOM, capacity // 4)


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

    @property
    def is_at_end(self) -> bool:
        """Whether the next row would move everything to the front."""
        return self.start + self.size == len(self._block)

    def append(self, row: np.ndarray) -> None:
        """Add a row at the end."""
        if self.is_at_end:
            self.replace(self.rows)
        self._block[self.start + self.size] = row
        self.size += 1

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


@dataclass(frozen=True, slots=True, eq=False)
class Whitening:
    """An input against the buffered samples of one factor.

    Attributes:
        s: (d,) the input in units of the length scales.
        v: (n,) `L^-1 k(U, u)`; empty where Z is zero.
        explained: (k, p + 1) what the samples tell there: of each regressor, then of Z.
        prior: variance of Z there before any sample, for the first output.
        reduction: of it by the samples.
    """

    s: np.ndarray
    v: np.ndarray
    explained: np.ndarray
    prior: float
    reduction: float

    @property
    def variance(self) -> float:
        """Variance of Z given the samples, for the first output."""
        return self.prior - self.reduction


class GrowingFactor:
    """Factor of `K + noise I` over the buffered inputs of one group of outputs.

    Args:
        group: the outputs, their kernel and noise.
        p: number of coefficients.
        capacity: most samples held at once.
    """

    def __init__(self, group: OutputGroup, p: int, capacity: int) -> None:
        self._kernel = group.kernel
        self._noise = group.noise
        self._scales = np.array(group.scales)[:, None]  # (k, 1)
        dense = length_for(capacity) if group.kernel is not None else 0
        self._U = np.zeros((dense, dense))
        self._S = SlidingRows(capacity, (0 if group.kernel is None else len(group.kernel.inputs),))
        self._white = SlidingRows(capacity, (len(group.outputs) * (p + 1),))
        self._shape = (len(group.outputs), p + 1)
        self._carried = np.zeros(capacity)

    @property
    def size(self) -> int:
        """Samples held."""
        return self._white.size

    @property
    def outputs(self) -> int:
        """Outputs that share the factor."""
        return len(self._scales)

    @property
    def white(self) -> np.ndarray:
        """Whitened regressors and, last, observations `L^-1 [F y]`, (size, k, p + 1)."""
        return self._white.rows.reshape(self.size, *self._shape)

    @property
    def lower(self) -> np.ndarray:
        """The lower factor, a view (size, size); (0, 0) where Z is zero."""
        if self._kernel is None:
            return self._U
        live = slice(self._white.start, self._white.start + self.size)
        return self._U[live, live].T

    def inverse_column(self, m: int) -> np.ndarray:
        """Return column m (n,) of `(K + noise I)^-1`; (0,) where Z is zero. O(n^2)."""
        if self._kernel is None:
            return np.zeros(0)
        return inverse_column(self._U, self._white.start, self.size, m)

    def whiten(self, u: np.ndarray) -> Whitening:
        """Return an input u (d,) against the samples. O(n^2 / 2 + n k p)."""
        explained = np.zeros(self._shape)
        if self._kernel is None:
            return Whitening(np.zeros(0), np.zeros(0), explained, 0.0, 0.0)
        s = self._kernel.scale(u[None])[0]
        v = self._kernel.vector(self._S.rows, s)
        solve_lower(self._U, self._white.start, v)
        combine_rows(v, self._white.rows, explained.reshape(-1))
        explained *= self._scales
        prior = float(self._kernel.diagonal(u[None])[0])
        return Whitening(s, v, explained, prior, float(v @ v))

    def pivot(self, whitening: Whitening) -> float:
        """Return the diagonal element that `append` would add.

        Raises:
            NumericalError: the sample adds no positive variance in double precision.
        """
        square = whitening.prior + self._noise - whitening.reduction
        if not square > 0.0:
            raise NumericalError(
                f'a sample repeats {self.size} others to rounding, variance {square:.3g}',
                'a noise variance above the rounding error of the signal variance',
                'raise the noise variance',
            )
        return math.sqrt(square)

    def append(self, whitening: Whitening, data: np.ndarray) -> np.ndarray:
        """Border the factor with a sample.

        Args:
            whitening: of its input.
            data: its regressors and, last, observations, (k, p + 1).

        Returns:
            The whitened data (k, p + 1): `p(y | earlier samples, W)`.

        Raises:
            NumericalError: as `pivot`.
        """
        diagonal = self.pivot(whitening)
        row: np.ndarray = (data - whitening.explained) / (diagonal * self._scales)
        if self._kernel is not None and self._white.is_at_end:
            move_to_front(self._U, self._white.start, self.size)
        self._white.append(row.reshape(-1))
        self._S.append(whitening.s)
        if self._kernel is not None:
            last = self._white.start + self.size - 1
            self._U[self._white.start : last, last] = whitening.v
            self._U[last, last] = diagonal
        return row

    def drop(self, m: int) -> None:
        """Remove sample m. O(n^2)."""
        n, start = self.size, self._white.start
        row = self._white.rows[m].copy()
        if self._kernel is not None:
            carried = self._carried[: n - 1 - m]
            carried[:] = self._U[start + m, start + m + 1 : start + n]
            absorb_column(self._U, start + m + 1, carried, self._white.rows[m + 1 :], row)
            if m < n - 1:
                close_gap(self._U, start, n, m)
        self._white.drop(m)
        self._S.drop(m)

    def absorb(self, column: np.ndarray) -> None:
        """Factor `K + noise I + column column^T` instead, for a column (n,). O(n^2)."""
        carried = self._carried[: self.size]
        carried[:] = column
        extra = np.zeros(self._shape).reshape(-1)
        absorb_column(self._U, self._white.start, carried, self._white.rows, extra)

    def fill(self, U: np.ndarray, data: np.ndarray) -> None:
        """Fill a new factor from inputs U (n, d), regressors and observations (n, k, p + 1).

        O(n^3 / 3).

        Raises:
            NumericalError: the covariance is not positive definite.
        """
        n = len(U)
        if not n:
            return
        flat = (data / self._scales).reshape(n, -1)
        if self._kernel is None:
            self._white.replace(flat / math.sqrt(self._noise))
            self._S.replace(np.zeros((n, 0)))
            return
        K = self._kernel.matrix(U)
        K[np.diag_indices(n)] += self._noise
        L = covariance_factor(K, may_overwrite=True)
        self._U[:n, :n] = L.T
        self._S.replace(self._kernel.scale(U))
        self._white.replace(linalg.solve_triangular(L, flat, lower=True))

    def distance(self, exact: GrowingFactor) -> float:
        """Return the relative distance from a factor of the same samples, in Frobenius norm.

        The larger one of factor and whitened data; infinite where a number here is not finite.
        """
        pairs = ((self.lower, exact.lower), (self.white, exact.white))
        ratios = [
            float(np.linalg.norm(found - right) / np.linalg.norm(right))
            for found, right in pairs
            if right.any()
        ]
        return max((x if np.isfinite(x) else np.inf for x in ratios), default=0.0)

    def state(self) -> dict[str, np.ndarray]:
        """Return what `restore` needs, as arrays."""
        return {'L': self.lower, 'S': self._S.rows, 'white': self._white.rows}

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue exactly where `state` was taken."""
        self._white.replace(state['white'])
        self._S.replace(state['S'])
        n = len(state['L'])
        self._U[:n, :n] = state['L'].T


def part_of(state: Mapping[str, np.ndarray], prefix: str) -> dict[str, np.ndarray]:
    """Return the arrays whose names begin with `prefix`, without it."""
    return {k.removeprefix(prefix): v for k, v in state.items() if k.startswith(prefix)}
