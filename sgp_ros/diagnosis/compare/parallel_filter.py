"""One symmetric low-pass for the target and every column, thinned out in the same pass."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import signal


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
            signal.firwin(2 * half + 1, self.cutoff, window=('kaiser', 5.0), fs=self.rate)
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
        half = len(self.taps) // 2 + 4
        return tuple(
            np.arange(s.start + half, s.stop - half, self.decimation) for s in self.segments
        )

    @property
    def rows(self) -> np.ndarray:
        """All kept rows, (N,)."""
        return np.concatenate(self.kept)

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Return x (n, ...) filtered and thinned out, (N, ...)."""
        flat = x.reshape(len(x), -1)
        found = np.empty((sum(map(len, self.kept)), flat.shape[1]))
        for inside, out in self.blocks(len(found) or 1):
            found[out] = self.piece(flat[inside], out)
        return found.reshape(len(found), *x.shape[1:])

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
        return _decimated(self.taps, x, self.decimation, out.stop - out.start)


def _decimated(taps: np.ndarray, x: np.ndarray, step: int, count: int) -> np.ndarray:
    """Return the weighted sums of every `step`-th window of x, (count, m)."""
    windows = np.lib.stride_tricks.sliding_window_view(x, len(taps), axis=0)[::step][:count]
    return windows @ taps
