"""Where the joints of a recording rest."""

from __future__ import annotations

import numpy as np

from sgp_ros.diagnosis.compare.trajectory import Bandwidth, RawTrajectory
from sgp_ros.robots.observed_motion import ObservedMotion


def resting(raw: RawTrajectory, motion: ObservedMotion, bandwidth: Bandwidth) -> np.ndarray:
    """Return where joints rest: slower than the noise of the velocity for some time, (n, k)."""
    noise = np.sqrt((2 * np.pi) ** 2 * raw.noise_density * bandwidth.state_cutoff**3 / 3.0)
    speed = np.abs(motion.velocity)
    threshold = np.maximum(4.0 * noise, 1e-3 * np.sqrt((speed**2).mean(axis=0)))
    shortest = max(4, round(0.03 / raw.step))
    rests = np.zeros(speed.shape, dtype=bool)
    for j in range(speed.shape[1]):
        wide = np.concatenate([[False], speed[:, j] < 3.0 * threshold[j], [False]])
        edges = np.flatnonzero(np.diff(wide.astype(int)))
        for start, stop in zip(edges[::2], edges[1::2], strict=True):
            if np.sum(speed[start:stop, j] < threshold[j]) >= shortest:
                rests[start:stop, j] = True
    return rests
