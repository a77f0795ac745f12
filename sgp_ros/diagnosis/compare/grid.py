"""A stretch of a recording on a uniform grid, and the noise of positions there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import interpolate

from sgp_ros.batch.acceptance import Accepted


@dataclass(frozen=True, eq=False)
class Stretch:
    """The arrays of `RawTrajectory` for one stretch."""

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray | None
    effort: np.ndarray | None

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
        path = interpolate.CubicSpline(known, accepted.position[rows])
        velocity, effort = None, None
        if accepted.velocity is not None:
            velocity = path(inner, 1)
            has = np.isfinite(accepted.velocity[rows]).all(axis=1)
            if has.any():
                velocity = _lines(inner, known[has], accepted.velocity[rows][has])
        if accepted.is_measured[rows[0]]:
            effort = _lines(inner, known, accepted.effort[rows])
        return cls(t, path(inner), velocity, effort)


def _lines(t: np.ndarray, known: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.column_stack([np.interp(t, known, column) for column in values.T])


def noise_density(position: np.ndarray, segments: Sequence[slice], step: float) -> np.ndarray:
    """Return the level of the spectra where no robot moves: the upper third, (k,).

    Args:
        position: (n, k) [rad or m].
        segments: stretches of rows without a pause; the longest is looked at.
        step: of the grid [s].
    """
    longest = max(segments, key=lambda s: s.stop - s.start)
    q = position[longest]
    window = np.hanning(len(q))[:, None]
    spectrum = np.abs(np.fft.rfft((q - q.mean(axis=0)) * window, axis=0)) ** 2
    density = 2.0 * spectrum * step / np.sum(window**2)
    frequency = np.fft.rfftfreq(len(q), step)
    upper = (frequency > 0.3 / step) & (frequency < 0.48 / step)
    # the median of an exponential variable is ln 2 of its mean
    return np.asarray(np.median(density[upper], axis=0) / math.log(2.0))
