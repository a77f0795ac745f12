"""Policies by which a sample leaves a full buffer: oldest, least informative, of a close pair.

No policy looks at an observation: what Z is conditioned on is chosen by inputs alone, so the
choice does not bias it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

import numpy as np
from scipy import linalg

from sgp_ros.gp.factor import GrowingFactor
from sgp_ros.gp.kernel import Kernel
from sgp_ros.gp.model import Model


class Retention(Protocol):
    """Policy by which a sample leaves."""

    def rebuild(self, model: Model, factors: Sequence[GrowingFactor], U: np.ndarray) -> None:
        """Start over with the buffered inputs U (n, d), factored under `model`."""

    def append(self, factors: Sequence[GrowingFactor], u: np.ndarray) -> None:
        """Take note of input u (d,), which the factors hold last."""

    def choose(self, factors: Sequence[GrowingFactor]) -> int:
        """Return the index of the sample that goes, of those the factors hold."""

    def drop(self, factors: Sequence[GrowingFactor], m: int) -> None:
        """Take note that sample m goes; the factors still hold it."""

    def state(self) -> dict[str, np.ndarray]:
        """Return what `restore` needs, as arrays."""

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue exactly where `state` was taken."""


class Oldest:
    """The sample that came first goes. O(1)."""

    def rebuild(self, model: Model, factors: Sequence[GrowingFactor], U: np.ndarray) -> None:
        """Keep nothing."""

    def append(self, factors: Sequence[GrowingFactor], u: np.ndarray) -> None:
        """Keep nothing."""

    def choose(self, factors: Sequence[GrowingFactor]) -> int:
        """Return the first."""
        del factors
        return 0

    def drop(self, factors: Sequence[GrowingFactor], m: int) -> None:
        """Keep nothing."""

    def state(self) -> dict[str, np.ndarray]:
        """Return no array."""
        return {}

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Take no array."""


class LeastInformative:
    """The sample is dropped whose observation holds the least information on Z beside the others.

    With `C = (K + noise I)^-1` the variance of an observation given all others is `1 / C_ii`
    (Sundararajan and Keerthi 2001), so it tells `-1/2 log(noise C_ii)` nat of Z; these add up over
    the components of X. Appending and dropping change C by `c c^T / c_m` with its column c of that
    sample: two triangular solves, O(n^2) a factor. Outputs that share a factor gain the same, so
    it counts as often. Where Z is zero the oldest goes.
    """

    def __init__(self) -> None:
        self._precision = np.zeros((0, 0))

    def rebuild(self, model: Model, factors: Sequence[GrowingFactor], U: np.ndarray) -> None:
        """Invert each factored covariance once. O(k n^3)."""
        del model, U
        held = [factor for factor in factors if factor.lower.size]
        rows = [np.diag(linalg.lapack.dpotri(factor.lower, lower=True)[0]) for factor in held]
        self._precision = np.array(rows) if rows else np.zeros((0, 0))

    def append(self, factors: Sequence[GrowingFactor], u: np.ndarray) -> None:
        """Add the column of the new sample."""
        del u
        columns = _columns(factors, -1)
        if not len(self._precision):
            self._precision = np.zeros((len(columns), 0))
        grown = np.pad(self._precision, ((0, 0), (0, 1)))
        self._precision = grown + _squares(columns, -1)

    def choose(self, factors: Sequence[GrowingFactor]) -> int:
        """Return the sample with the largest product of `C_ii`; the first of equals.

        A precision that rounding left without a logarithm is of a sample beside its copy.
        """
        if not self._precision.size:
            return 0
        outputs = np.array([factor.outputs for factor in factors if factor.lower.size])
        known = np.where(self._precision > 0.0, self._precision, np.inf)
        return int((outputs[:, None] * np.log(known)).sum(axis=0).argmax())

    def drop(self, factors: Sequence[GrowingFactor], m: int) -> None:
        """Take the column of sample m off."""
        left = self._precision - _squares(_columns(factors, m), m)
        self._precision = np.delete(left, m, axis=1) if left.size else left

    def state(self) -> dict[str, np.ndarray]:
        """Return the diagonals of C."""
        return {'precision': self._precision}

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Take the diagonals of C."""
        self._precision = np.array(state['precision'])


def _columns(factors: Sequence[GrowingFactor], m: int) -> np.ndarray:
    """Return column m of C per factor with a process, (r, n)."""
    columns = [factor.inverse_column(m % factor.size) for factor in factors]
    found = [column for column in columns if len(column)]
    return np.array(found) if found else np.zeros((0, 0))


def _squares(columns: np.ndarray, m: int) -> np.ndarray:
    return columns**2 / columns[:, m : m + 1 or None] if columns.size else columns


class Coverage:
    """The older sample of the closest pair goes: what stays covers the inputs that Z has seen.

    Distances are in units of the length scales, over the inputs of all components. Nearest
    neighbours are kept, O(n d) a sample and for each whose neighbour left. Unlike the information
    it does not look at signal and noise. Where Z is zero the oldest goes.
    """

    def __init__(self) -> None:
        self._kernels: tuple[Kernel, ...] = ()
        self._S = np.zeros((0, 0))
        self._gap = np.zeros(0)
        self._neighbour = np.zeros(0, dtype=np.int64)

    def rebuild(self, model: Model, factors: Sequence[GrowingFactor], U: np.ndarray) -> None:
        """Measure all distances. O(n^2 d)."""
        del factors
        self._kernels = tuple(kernel for kernel in model.kernels if kernel is not None)
        self._S = self._scaled(U) if len(U) else np.zeros((0, 0))
        self._gap = np.full(len(U), np.inf)
        self._neighbour = np.zeros(len(U), dtype=np.int64)
        for i in range(len(U)):
            self._search(i)

    def append(self, factors: Sequence[GrowingFactor], u: np.ndarray) -> None:
        """Measure the distances to the new sample."""
        del factors
        n = len(self._S)
        s = self._scaled(u[None])
        self._S = np.concatenate([self._S, s]) if n else s
        self._gap = np.append(self._gap, np.inf)
        self._neighbour = np.append(self._neighbour, 0)
        self._search(n)
        squares = self._squares(n)
        is_closer = squares < self._gap
        is_closer[n] = False
        self._gap[is_closer] = squares[is_closer]
        self._neighbour[is_closer] = n

    def choose(self, factors: Sequence[GrowingFactor]) -> int:
        """Return the older of the closest two; the first of equals."""
        del factors
        if not self._S.size:
            return 0
        i = int(self._gap.argmin())
        return min(i, int(self._neighbour[i]))

    def drop(self, factors: Sequence[GrowingFactor], m: int) -> None:
        """Search anew for those whose neighbour goes."""
        del factors
        orphans = np.delete(self._neighbour == m, m)
        self._S = np.delete(self._S, m, axis=0)
        self._gap = np.delete(self._gap, m)
        rest = np.delete(self._neighbour, m)
        self._neighbour = rest - (rest > m)
        for i in np.flatnonzero(orphans):
            self._search(int(i))

    def state(self) -> dict[str, np.ndarray]:
        """Return distances squared and neighbours."""
        return {'S': self._S, 'gap': self._gap, 'neighbour': self._neighbour}

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Take distances squared and neighbours."""
        self._S, self._gap = np.array(state['S']), np.array(state['gap'])
        self._neighbour = np.array(state['neighbour'])

    def _scaled(self, U: np.ndarray) -> np.ndarray:
        return np.concatenate(
            [np.zeros((len(U), 0)), *(kernel.scale(U) for kernel in self._kernels)], axis=1
        )

    def _squares(self, i: int) -> np.ndarray:
        difference = self._S - self._S[i]
        squares = np.einsum('ij,ij->i', difference, difference)
        squares[i] = np.inf
        return squares

    def _search(self, i: int) -> None:
        squares = self._squares(i)
        self._neighbour[i] = squares.argmin()
        self._gap[i] = squares[self._neighbour[i]]


RETENTIONS: dict[str, Callable[[], Retention]] = {
    'oldest': Oldest,
    'least_informative': LeastInformative,
    'coverage': Coverage,
}
"""Policies by name."""
