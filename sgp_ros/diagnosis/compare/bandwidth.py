"""The band of a diagnosis, which follows from the noise of the encoders.

Noise of density S in the position becomes a force of variance `M^2 (2 pi)^4 S f^5 / 5` below f.
The cut-off is the frequency at which that reaches `NOISE_SHARE` of the effort, or the highest that
the rate justifies. Where that is below `USUAL_CUTOFF_HZ`, more noise is accepted before motion is
given up: only as much of the band goes as makes the noise small enough not to be taken for
physics, and only where the noise becomes less than the effort that goes with it.
"""

from __future__ import annotations

import math

import numpy as np

from sgp_ros.diagnosis.compare.parallel_filter import ParallelFilter
from sgp_ros.diagnosis.compare.trajectory import (
    HIGHEST_CUTOFF_HZ,
    Bandwidth,
    RawTrajectory,
    observe,
)
from sgp_ros.diagnosis.criteria import INDEPENDENT_ROWS, SLIGHT_REST
from sgp_ros.rigid.tree import Tree
from sgp_ros.robots.observed_motion import ObservedMotion

NOISE_SHARE = 3e-6
"""Share of the mean square of the effort that noise may take below the cut-off."""
USUAL_CUTOFF_HZ, LOWEST_CUTOFF_HZ = 3.0, 0.1
_NARROWER = 1.25
_LEAST_ROWS = 3.0 * INDEPENDENT_ROWS
"""Rows that a narrower band must leave."""


def choose_bandwidth(raw: RawTrajectory, tree: Tree) -> Bandwidth:
    """Return the filters that noise, rate and motion of a recording require.

    Rows of settled points are independent: nothing is filtered.
    """
    rate = 1.0 / raw.step
    if raw.approach is not None:
        return Bandwidth(0.45 * rate, 0.45 * rate)
    highest = min(HIGHEST_CUTOFF_HZ, 0.15 * rate)
    motion = observe(raw, tree, Bandwidth(highest, min(2.0 * highest, 0.4 * rate)))
    inertia = motion.mass_diagonal.mean(axis=0)
    is_driven = tree.is_actuated[: tree.size]
    driven = np.where(is_driven, motion.effort, motion.mass_diagonal * motion.acceleration)
    noise = inertia**2 * (2.0 * math.pi) ** 4 * raw.noise_density / 5.0
    limits = (
        NOISE_SHARE * np.maximum(driven.var(axis=0), 1e-30) / np.maximum(noise, 1e-30)
    ) ** 0.2
    limits = limits[motion.moves] if motion.moves.any() else limits
    cutoff = float(np.clip(limits.min(), USUAL_CUTOFF_HZ, highest))
    if limits.min() < cutoff:
        cutoff = _narrowed(raw, motion, driven, noise, cutoff)
    return Bandwidth(cutoff, min(2.5 * cutoff, 0.4 * rate))


def _narrowed(
    raw: RawTrajectory,
    motion: ObservedMotion,
    driven: np.ndarray,
    noise: np.ndarray,
    cutoff: float,
) -> float:
    """Return a cut-off below which noise is small, if there is one, at most the given one [Hz].

    Args:
        raw: the recording.
        motion: that it shows.
        driven: (n, k) forces that drive the joints [N m or N].
        noise: (k,) variance that the encoders' noise gives them, over the fifth power of the
            cut-off.
        cutoff: usual one [Hz].
    """
    found, least = cutoff, math.inf
    while cutoff > LOWEST_CUTOFF_HZ:
        low = ParallelFilter(1.0 / raw.step, cutoff, raw.segments)
        if len(low.rows) < _LEAST_ROWS:
            break
        share = noise * cutoff**5 / np.maximum(low(driven).var(axis=0), 1e-300)
        worst = float(share[motion.moves].max(initial=0.0))
        if worst >= least:
            break
        found, least = cutoff, worst
        if worst <= SLIGHT_REST:
            break
        cutoff /= _NARROWER
    return found
