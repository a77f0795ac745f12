"""Noise of measured efforts below the cut-off of a diagnosis."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from sgp_ros.diagnosis.compare.grid import spectral_levels
from sgp_ros.diagnosis.compare.parallel_filter import ParallelFilter
from sgp_ros.diagnosis.compare.trajectory import Bandwidth, RawTrajectory
from sgp_ros.robots.observed_motion import ObservedMotion

_EFFORTS = 0.225, 0.32
"""Frequencies below which noise of efforts is looked for at the latest, and at the most: a
recording that was thinned has less above."""
_MEDIAN = 3.0
"""Relative variance of the median of a spectrum, times its lines, with that of the window."""
_ABOVE = 1.5
"""Cut-offs from which it is looked for."""
_RANK = 1e-8
"""Relative singular value from which columns are determined [1]."""


def measured_noise(raw: RawTrajectory, motion: ObservedMotion, bandwidth: Bandwidth) -> np.ndarray:
    """Return the mean square of the noise that measured efforts have in the band, (k,)."""
    if motion.drive is not None or motion.is_static:
        return np.zeros(motion.tree.size)
    return effort_noise(motion.effort, raw.segments, raw.step, bandwidth.cutoff, raw.blur)


def effort_noise(
    effort: np.ndarray, segments: Sequence[slice], step: float, cutoff: float, blur: float = 0.0
) -> np.ndarray:
    """Return the mean square that noise of measured efforts may have below a cut-off, (k,).

    It is taken for white, at the lowest level that the spectra have in a quarter of the band
    above: motion, ripple and the noise of a current loop there are not noise of the measurement.
    Two standard deviations of that level, and of the chance of so many rows, are added. Between
    two samples with the weights 1 - a and a there is `1 - 2 a (1 - a) (1 - cos 2 pi f)` of the
    power of noise of f periods of the samples: at a quarter of the rate as little as half of it.

    Args:
        effort: (n, k) [N m or N].
        segments: stretches of rows without a pause; the longest is looked at.
        step: of the grid [s].
        cutoff: [Hz].
        blur: mean of `a (1 - a)`.
    """
    latest, highest = _EFFORTS
    edges = np.linspace(min(_ABOVE * cutoff * step, latest), highest, 5)
    rows = 2.0 * cutoff * step * sum(s.stop - s.start for s in segments)
    lines = (edges[1] - edges[0]) * max(s.stop - s.start for s in segments)
    chance = math.sqrt(2.0 / rows + _MEDIAN / lines)
    middle = 0.5 * (edges[1:] + edges[:-1])
    passed = 1.0 - 2.0 * blur * (1.0 - np.cos(2.0 * np.pi * middle))
    level = (spectral_levels(effort, segments, step, edges) / passed[:, None]).min(axis=0)
    return np.asarray(cutoff * level * (1.0 + 2.0 * chance))


def noise_beside_laws(
    noise: np.ndarray, d: np.ndarray, bases: Sequence[np.ndarray], motion: ObservedMotion,
    low: ParallelFilter,
) -> np.ndarray:  # fmt: skip
    """Return the noise of efforts, at most what bodies and friction leave of them, (k,).

    Friction that turns with a slow motion has a spectrum far above the cut-off, which at a low
    rate hides that of the noise. What is left holds all of the noise but what columns take.

    Args:
        noise: by the spectra, (k,).
        d: discrepancy from the nominal robot, (N, k).
        bases: of the bodies by joint, (N, p) each.
        motion: whose friction may be Coulomb and viscous, with a constant load.
        low: filter of the rows.
    """
    if not noise.any():  # as of commands
        return noise
    v, found = motion.velocity, noise.copy()
    laws = low(np.sign(v)), low(v)
    count = 2.0 * motion.bandwidth * motion.step * len(v)  # independent rows
    for j in np.flatnonzero(noise > 0.0).tolist():
        A = np.column_stack([bases[j], *(x[:, j] for x in laws), np.ones(len(d))])
        A /= np.maximum(np.linalg.norm(A, axis=0), 1e-300)
        c, _, rank, _ = np.linalg.lstsq(A, d[:, j], rcond=_RANK)
        free = count - rank
        if free > rank:
            left = float(np.mean((d[:, j] - A @ c) ** 2)) * count / free
            found[j] = min(found[j], left * (1.0 + 2.0 * math.sqrt(2.0 / free)))
    return found
