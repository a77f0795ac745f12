"""Tracking of a smooth reference by a single axis with proportional and derivative action."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from sgp_ros.simulation.controllers import Controller
    from sgp_ros.simulation.mechanism import Mechanism

_COUNT = 5
_LOWEST_HZ, _HIGHEST_HZ = 0.1, 0.8
_RMS_M = 0.08
_BANDWIDTH = 15.0


def pd_reference(
    mechanism: Mechanism, rng: np.random.Generator, _period_s: float
) -> Controller | None:
    """Build the tracking of a random multi-sine that starts at rest at the origin.

    The reference is the sum of `+-A (1 - cos(2 pi f t))` with f between 0.1 and 0.8 Hz, 0.08 m rms
    about its mean; the gains give critical damping at 15 rad/s.
    """
    mass = next(c.value for c in mechanism.coefficients() if c.name == 'M')
    rate = 2.0 * math.pi * rng.uniform(_LOWEST_HZ, _HIGHEST_HZ, _COUNT)
    amplitude = rng.choice([-1.0, 1.0], _COUNT) * _RMS_M * math.sqrt(2.0 / _COUNT)
    stiffness, damping = mass * _BANDWIDTH**2, 2.0 * mass * _BANDWIDTH

    def control(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        position = float(np.sum(amplitude * (1.0 - np.cos(rate * t))))
        velocity = float(np.sum(amplitude * rate * np.sin(rate * t)))
        return np.array([stiffness * (position - q[0]) + damping * (velocity - v[0])])

    return control
