"""Disturbances in which the motion has no part, behind the filter of a recording."""

from __future__ import annotations

import numpy as np
from scipy import signal


def disturbance(equations, seed):
    """Return white noise behind the filter, (N, k), made red (AR(1), 0.9) by odd seeds."""
    shape = equations.motion.position.shape
    noise = equations.filter(np.random.default_rng(seed).standard_normal(shape))
    return signal.lfilter([1.0], [1.0, -0.9], noise, axis=0) if seed % 2 else noise
