"""Waves over the position of a joint: where their periods are, by one Fourier transform.

A ripple has as many local optima as there are periods in the range of motion. So periods are not
searched from a grid of starts: what a model leaves is transformed over the position, up to the
shortest wave that the rows resolve (Scargle 1982, for unevenly spaced abscissae).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sgp_ros.physics.motion import SeenMotion

PEAKS = 6
_ROWS_A_WAVE = 5.0
"""Rows along the way that resolve a wave."""
_BINS_A_WAVE = 8
_FINER = 4
"""Rates per width of a peak."""
_LEAST_SIZE, _SIZE_A_ROW = 1 << 20, 8
"""Of the transform, below which none is too long; rows that resolve a wave need 6.4 a row."""


def per_turn(motion: SeenMotion, joint: int) -> float:
    """Return the phase per position and period, 1 on a revolute and 2 pi on a prismatic joint."""
    return 2.0 * math.pi if motion.tree.is_prismatic[joint] else 1.0


def peak_width(motion: SeenMotion, joint: int) -> float:
    """Return by how many periods two waves differ that differ by one in the range of motion."""
    span = float(np.ptp(motion.position[:, joint])) * per_turn(motion, joint)
    return 2.0 * math.pi / max(span, 1e-9)


def most_periods(motion: SeenMotion, joint: int) -> float:
    """Return the periods per turn, or per metre, of the shortest wave that the rows resolve."""
    way = float(np.abs(np.diff(motion.position[:, joint])).sum()) * per_turn(motion, joint)
    return 2.0 * math.pi * len(motion.time) / _ROWS_A_WAVE / max(way, 1e-9)


@dataclass(frozen=True, slots=True, eq=False)
class Wave:
    """Forces `Im z` and `Re z` per coefficient, `z = sum_m (i r)^m amplitudes[m] exp(i r phase)`.

    Attributes:
        phase: of one period per turn, (n,) [rad].
        amplitudes: (n, k) each [N m or N per unit of the coefficient].
        low: least r, periods per turn.
        high: greatest r.
    """

    phase: np.ndarray
    amplitudes: tuple[np.ndarray, ...]
    low: float
    high: float

    @property
    def width(self) -> float:
        """Periods per turn by which two waves differ that differ by one over the rows."""
        return 2.0 * math.pi / max(float(np.ptp(self.phase)), 1e-9)

    def strongest(self, rows: np.ndarray, residual: np.ndarray, sigma: np.ndarray) -> np.ndarray:
        """Return the periods that explain most of a residual, strongest first, (peaks, 1).

        Args:
            rows: (N,) that the residual is of.
            residual: (N, k) in units of sigma.
            sigma: (k,) [N m or N].
        """
        phase = self.phase[rows] - self.phase[rows].min()
        parts = [a[rows] / sigma for a in self.amplitudes]
        width = 2.0 * math.pi / max(float(phase.max()), 1e-9)
        bin_width = 2.0 * math.pi / (_BINS_A_WAVE * self.high)
        wanted = _FINER * (2.0 * math.pi / width / bin_width + 2.0)
        if not wanted < max(_LEAST_SIZE, _SIZE_A_ROW * len(phase)):
            return np.array([[self.low], [self.high]])  # rows are far too few for such waves
        bins = np.rint(phase / bin_width).astype(int)
        size = _FINER * int(np.ceil(2.0 * math.pi / width / bin_width) + 1)
        step = 2.0 * math.pi / (size * bin_width)
        first, last = math.ceil(self.low / step), math.floor(self.high / step)
        if last < first:
            return np.array([[self.low], [self.high]])
        rates = step * np.arange(first, last + 1)
        product = np.zeros(len(rates), dtype=np.complex128)
        for m, part in enumerate(parts):
            weights = np.bincount(bins, (part * residual).sum(axis=1), size)
            product += (1j * rates) ** m * np.conj(np.fft.rfft(weights)[first : last + 1])
        power = np.abs(product) ** 2 / np.maximum(_mean_square(parts, rates), 1e-300)
        found = []
        for _ in range(PEAKS):
            best = int(np.argmax(power))
            if power[best] <= 0.0:
                break
            found.append(rates[best])
            power[np.abs(rates - rates[best]) < width] = 0.0
        return np.array(found)[:, None]


def _mean_square(parts: list[np.ndarray], rates: np.ndarray) -> np.ndarray:
    """Return half the sum of |z|^2 over rows and joints, for each rate."""
    total = np.zeros(len(rates))
    for m, a in enumerate(parts):
        for o, b in enumerate(parts):
            if (m - o) % 2 == 0:
                total += (-1.0) ** ((m - o) // 2) * rates ** (m + o) * float((a * b).sum())
    return 0.5 * total
