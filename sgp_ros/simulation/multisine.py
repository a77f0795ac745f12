"""Smooth reference motions: sums of sinusoids about a centre."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True, eq=False)
class Multisine:
    """`r(t) = centre + sum amplitude sin(rate t + phase)` for m joints with c sinusoids each.

    Attributes:
        centre: (m,) [rad or m].
        amplitude: (m, c) [rad or m].
        rate: (m, c) [rad/s].
        phase: (m, c) [rad].
    """

    centre: np.ndarray
    amplitude: np.ndarray
    rate: np.ndarray
    phase: np.ndarray

    def at(self, t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return position, velocity and acceleration at time t [s], (m,) each."""
        angle = self.rate * t + self.phase
        wave = self.amplitude * np.sin(angle)
        slope = self.amplitude * self.rate * np.cos(angle)
        bend = -wave * self.rate**2
        return self.centre + wave.sum(axis=1), slope.sum(axis=1), bend.sum(axis=1)


def random_multisine(
    rng: np.random.Generator,
    centre: np.ndarray,
    span: np.ndarray,
    *,
    lowest_hz: float = 0.08,
    highest_hz: float = 1.6,
    count: int = 6,
) -> Multisine:
    """Return sinusoids of random frequencies and phases whose amplitudes fall with frequency.

    The frequencies are spread over the band, so that two references of equal band move a robot
    alike.

    Args:
        rng: source of the numbers.
        centre: (m,) [rad or m].
        span: (m,) largest distance from the centre [rad or m].
        lowest_hz: of the frequencies [Hz].
        highest_hz: of the frequencies [Hz].
        count: sinusoids per joint.
    """
    shape = (len(centre), count)
    place = (np.arange(count) + rng.random(shape)) / count  # one in each part of the band
    hz = lowest_hz * (highest_hz / lowest_hz) ** place
    weight = rng.uniform(0.3, 1.0, shape) / (0.3 + hz)
    amplitude = span[:, np.newaxis] * weight / weight.sum(axis=1, keepdims=True)
    phase = rng.uniform(0.0, 2.0 * math.pi, shape)
    return Multisine(centre, amplitude, 2.0 * math.pi * hz, phase)
