"""A Cholesky factor that grows by a row, drops any sample and takes a rank-one change.

Whitened data stand beside it and take the same rotations.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy import linalg

from sgp_ros.errors import NumericalError
from sgp_ros.gp.factor_loops import absorb_column, append_row, drop_row, substitute_back
from sgp_ros.gp.kernels import COMPILED_FORMS
from sgp_ros.gp.linear_algebra import covariance_factor
from sgp_ros.gp.model import OutputGroup
from sgp_ros.gp.whitening_loops import solve_lower, whiten_input, whiten_vector

ROOM = 64
"""Least number of rows that a window may slide before everything moves to the front."""
_NOTHING = np.zeros(0)


def length_for(capacity: int) -> int:
    """Return how many rows to hold so that a move of `capacity` rows is rare.

    A quarter more: the factor of n samples then moves once in n / 4 samples, which adds a
    hundredth to what each of them costs at n = 250 and less above.
    """
    return capacity + max(ROOM, capacity // 4)


class Whitening(NamedTuple):
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

    Attributes:
        size: samples held.
        squared_scales: of the outputs, (k,).

    Args:
        group: the outputs, their kernel and noise.
        p: number of coefficients.
        capacity: most samples held at once.
    """

    def __init__(self, group: OutputGroup, p: int, capacity: int) -> None:
        self._kernel = kernel = group.kernel
        self._noise = group.noise
        self._scales = np.array(group.scales)  # (k,)
        self.squared_scales = np.square(self._scales)
        self._shape = (len(group.outputs), p + 1)
        self._width = len(group.outputs) * (p + 1)
        length = length_for(capacity)
        dense = length if kernel is not None else 0
        self._U = np.zeros((dense, dense))
        self._S = np.zeros((length, 0 if kernel is None else len(kernel.inputs)))
        self._white = np.zeros((length, self._width))
        self._start = self.size = 0
        self._carried, self._extra = np.zeros(capacity), np.zeros(self._width)
        self._form = COMPILED_FORMS.get(type(kernel), 0) if kernel is not None else 0
        if kernel is not None:
            self._columns, self._lengths = np.array(kernel.inputs), np.array(kernel.lengthscales)
            self._variance = kernel.variance

    @property
    def outputs(self) -> int:
        """Outputs that share the factor."""
        return len(self._scales)

    @property
    def white(self) -> np.ndarray:
        """Whitened regressors and, last, observations `L^-1 [F y]`, (size, k, p + 1)."""
        return self._white[self._live].reshape(self.size, *self._shape)

    @property
    def lower(self) -> np.ndarray:
        """The lower factor, a view (size, size); (0, 0) where Z is zero."""
        return self._U if self._kernel is None else self._U[self._live, self._live].T

    @property
    def _live(self) -> slice:
        return slice(self._start, self._start + self.size)

    def inverse_column(self, m: int) -> np.ndarray:
        """Return column m (n,) of `(K + noise I)^-1`; (0,) where Z is zero.

        Forward substitution from row m on, then back substitution. O(n^2), no n x n array.
        """
        if self._kernel is None:
            return np.zeros(0)
        x = np.zeros(self.size)
        x[m] = 1.0
        solve_lower(self._U, self._start + m, x[m:])
        substitute_back(self._U, self._start, x)
        return x

    def whiten(self, u: np.ndarray) -> Whitening:
        """Return an input u (d,) against the samples. O(n^2 / 2 + n k p)."""
        kernel = self._kernel
        if kernel is None:
            return Whitening(_NOTHING, _NOTHING, np.zeros(self._shape), 0.0, 0.0)
        explained = np.empty(self._width)
        if self._form:
            s, v = np.empty(len(self._columns)), np.empty(self.size)
            prior = self._variance
            reduction = whiten_input(
                self._form, prior, u, self._columns, self._lengths, self._U, self._S, self._white,
                self._start, self._scales, s, v, explained,
            )  # fmt: skip
        else:
            s = kernel.scale(u[None])[0]
            v = kernel.vector(self._S[self._live], s)
            prior = float(kernel.diagonal(u[None])[0])
            reduction = whiten_vector(
                self._U, self._white, self._start, self._scales, v, explained
            )
        return Whitening(s, v, explained.reshape(self._shape), prior, reduction)

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
        row: np.ndarray = (data - whitening.explained) / (diagonal * self._scales)[:, None]
        self._start = append_row(
            self._U, self._S, self._white, self._start, self.size,
            whitening.s, whitening.v, diagonal, row.reshape(-1),
        )  # fmt: skip
        self.size += 1
        return row

    def drop(self, m: int) -> None:
        """Remove sample m. O(n^2)."""
        self._start = drop_row(
            self._U, self._S, self._white, self._start, self.size, m, self._carried, self._extra
        )
        self.size -= 1

    def absorb(self, column: np.ndarray) -> None:
        """Factor `K + noise I + column column^T` instead, for a column (n,). O(n^2)."""
        carried = self._carried[: self.size]
        carried[:] = column
        extra = np.zeros(self._width)
        absorb_column(self._U, self._start, carried, self._white[self._live], extra)

    def fill(self, U: np.ndarray, data: np.ndarray) -> None:
        """Fill a new factor from inputs U (n, d), regressors and observations (n, k, p + 1).

        O(n^3 / 3).

        Raises:
            NumericalError: the covariance is not positive definite.
        """
        n = len(U)
        if not n:
            return
        self._start, self.size = 0, n
        flat = (data / self._scales[:, None]).reshape(n, -1)
        if self._kernel is None:
            self._white[:n] = flat / math.sqrt(self._noise)
            return
        K = self._kernel.matrix(U)
        K[np.diag_indices(n)] += self._noise
        L = covariance_factor(K, may_overwrite=True)
        self._U[:n, :n] = L.T
        self._S[:n] = self._kernel.scale(U)
        self._white[:n] = linalg.solve_triangular(L, flat, lower=True)

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
        return {'L': self.lower, 'S': self._S[self._live], 'white': self._white[self._live]}

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue exactly where `state` was taken."""
        n = len(state['white'])
        self._start, self.size = 0, n
        self._white[:n], self._S[:n] = state['white'], state['S']
        if self._kernel is not None:
            self._U[:n, :n] = state['L'].T


def part_of(state: Mapping[str, np.ndarray], prefix: str) -> dict[str, np.ndarray]:
    """Return the arrays whose names begin with `prefix`, without it."""
    return {k.removeprefix(prefix): v for k, v in state.items() if k.startswith(prefix)}
