"""A stretch of a recording on a uniform grid, with the noise and the instants of its signals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy  # its parts load when they are used

from sgp_ros.batch.acceptance import Accepted

INSTANT_SPREAD = 12**-0.5
"""Prior standard deviation of the instant of a measured effort, in periods: uniform over one."""
_COARSER = 1.5
"""Steps of a grid, in those of the samples, from which it is coarser than these."""
_POSITIONS = 0.3, 0.48
"""Frequencies at which no robot moves, in parts of the rate."""


@dataclass(frozen=True, eq=False)
class Stretch:
    """The arrays of `RawTrajectory` for one stretch, and its blur."""

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray | None
    effort: np.ndarray | None
    blur: float

    @classmethod
    def of(cls, accepted: Accepted, rows: np.ndarray, seconds: np.ndarray, step: float) -> Stretch:
        """Return the states of some rows on a grid.

        Args:
            accepted: states of a recording.
            rows: those of the stretch.
            seconds: (m,) stamps of all states [s].
            step: of the grid [s].
        """
        known = seconds[rows]
        n = int((known[-1] - known[0]) / step + 1e-6) + 1
        t = known[0] + step * np.arange(n)
        inner = np.minimum(t, known[-1])
        path = scipy.interpolate.CubicSpline(known, accepted.position[rows])
        velocity, effort = None, None
        if accepted.velocity is not None:
            velocity = path(inner, 1)
            has = np.isfinite(accepted.velocity[rows]).all(axis=1)
            if has.any():
                velocity = _lines(inner, known[has], accepted.velocity[rows][has])
        if accepted.is_measured[rows[0]]:
            effort = _lines(inner, known, accepted.effort[rows])
        return cls(t, path(inner), velocity, effort, _blur(inner, known))


def _lines(t: np.ndarray, known: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.column_stack([np.interp(t, known, column) for column in values.T])


def _blur(t: np.ndarray, known: np.ndarray) -> float:
    """Return the mean product of the weights of the two samples around each time, 0 to 1/4.

    Of a coarser grid than that of the samples 0: noise above its band folds into it, and is white.
    """
    if t[-1] - t[0] > _COARSER * (known[-1] - known[0]) / len(known) * len(t):
        return 0.0
    after = np.clip(np.searchsorted(known, t, side='right'), 1, len(known) - 1)
    part = np.clip((t - known[after - 1]) / (known[after] - known[after - 1]), 0.0, 1.0)
    return float(np.mean(part * (1.0 - part)))


def noise_density(position: np.ndarray, segments: Sequence[slice], step: float) -> np.ndarray:
    """Return the level of the spectra where no robot moves: the upper third, (k,).

    Args:
        position: (n, k) [rad or m].
        segments: stretches of rows without a pause; the longest is looked at.
        step: of the grid [s].
    """
    return spectral_levels(position, segments, step, np.array(_POSITIONS))[0]


def spectral_levels(
    x: np.ndarray, segments: Sequence[slice], step: float, edges: np.ndarray
) -> np.ndarray:
    """Return the one-sided spectral densities of x (n, k) between edges (b + 1,), (b, k).

    Edges are in parts of the rate.
    """
    longest = max(segments, key=lambda s: s.stop - s.start)
    x = x[longest]
    window = np.hanning(len(x))[:, None]
    spectrum = np.abs(np.fft.rfft((x - x.mean(axis=0)) * window, axis=0)) ** 2
    density = 2.0 * spectrum * step / np.sum(window**2)
    frequency = np.fft.rfftfreq(len(x))
    bands = [(frequency > a) & (frequency < b) for a, b in pairwise(edges)]
    # the median of an exponential variable is ln 2 of its mean
    return np.array([np.median(density[band], axis=0) for band in bands]) / math.log(2.0)


def effort_change(effort: np.ndarray, starts: Sequence[int]) -> np.ndarray:
    """Return by how much measured efforts change in one deviation of their instant, (n, k).

    States and efforts of one stamp are read up to half a period apart, either one first.

    Args:
        effort: (n, k) [N m or N].
        starts: rows at which the grid begins anew after a pause.
    """
    parts = [effort[start:stop] for start, stop in pairwise((*starts, len(effort)))]
    return INSTANT_SPREAD * np.concatenate([np.gradient(part, axis=0) for part in parts])
