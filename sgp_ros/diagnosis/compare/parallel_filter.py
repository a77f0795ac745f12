"""One symmetric low-pass for the target and every column, thinned out in the same pass."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy  # its parts load when they are used
from numba import njit


@dataclass(frozen=True)
class ParallelFilter:
    """A Kaiser-windowed low-pass of linear phase that keeps every `decimation`-th row.

    Attributes:
        rate: of the rows that come in [Hz].
        cutoff: half of the gain [Hz].
        segments: stretches of rows without a pause.
    """

    rate: float
    cutoff: float
    segments: tuple[slice, ...]

    @property
    def decimation(self) -> int:
        """Rows in per row out: about two and a half rows per period of the cut-off stay."""
        return max(1, int(self.rate / (2.5 * self.cutoff)))

    @cached_property
    def taps(self) -> np.ndarray:
        """Symmetric weights, (2 m + 1,), of unit sum."""
        half = max(2, round(1.6 * self.rate / self.cutoff))
        if self.cutoff >= 0.45 * self.rate:
            return np.ones(1)
        return np.asarray(
            scipy.signal.firwin(2 * half + 1, self.cutoff, window=('kaiser', 5.0), fs=self.rate)
        )

    def correlations(self, count: int) -> np.ndarray:
        """Return the correlation of white noise between rows out, 0 to `count` rows apart."""
        full = np.correlate(self.taps, self.taps, mode='full')[len(self.taps) - 1 :]
        lags = np.arange(count + 1) * self.decimation
        inside = lags < len(full)
        return np.asarray(np.where(inside, full[np.where(inside, lags, 0)], 0.0) / full[0])

    @cached_property
    def kept(self) -> tuple[np.ndarray, ...]:
        """Rows in the middle of the filter for each row out, a part per segment."""
        return tuple(
            np.arange(s.start + self.margin, s.stop - self.margin, self.decimation)
            for s in self.segments
        )

    @property
    def margin(self) -> int:
        """Rows in that are lost at either end of a stretch."""
        return len(self.taps) // 2 + 4

    @property
    def rows(self) -> np.ndarray:
        """All kept rows, (N,)."""
        return np.concatenate(self.kept)

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Return x (n, ...) filtered and thinned out, (N, ...)."""
        found = _weighed(self.taps, x.reshape(len(x), -1), self.rows - len(self.taps) // 2)
        return found.reshape(len(found), *x.shape[1:])

    def at(self, rows: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return x (n, c) filtered, at rows (N,) that lie half a filter within their stretch."""
        return _weighed(self.taps, x, rows - len(self.taps) // 2)

    def blocks(self, most: int) -> Iterator[tuple[slice, slice]]:
        """Yield rows in, and the rows out that follow from them, `most` of these at a time."""
        half, at = len(self.taps) // 2, 0
        for kept in self.kept:
            for first in range(0, len(kept), most):
                part = kept[first : first + most]
                yield slice(part[0] - half, part[-1] + half + 1), slice(at, at + len(part))
                at += len(part)

    def piece(self, x: np.ndarray, out: slice) -> np.ndarray:
        """Return the rows out of one of the blocks with the rows in x (m, c)."""
        return _weighed(self.taps, x, self.decimation * np.arange(out.stop - out.start))


def _weighed(taps: np.ndarray, x: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Return the weighted sums of the windows of x (n, c) that begin at `first`, (N, c)."""
    found = np.empty((len(first), x.shape[1]))
    _weigh(taps, np.ascontiguousarray(x, dtype=np.float64), first, found)
    return found


@njit(cache=True, fastmath={'reassoc'})
def _weigh(taps: np.ndarray, x: np.ndarray, first: np.ndarray, out: np.ndarray) -> None:
    for i in range(len(first)):
        a = first[i]
        if x.shape[1] == 1:
            total = 0.0
            for t in range(len(taps)):
                total += taps[t] * x[a + t, 0]
            out[i, 0] = total
            continue
        for c in range(x.shape[1]):
            out[i, c] = 0.0
        for t in range(len(taps)):
            for c in range(x.shape[1]):
                out[i, c] += taps[t] * x[a + t, c]
