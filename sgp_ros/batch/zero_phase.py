"""A low-pass without phase: a Butterworth filter run forwards, then backwards."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import signal

from sgp_ros.batch.stencils import REACH, first_derivative, second_derivative
from sgp_ros.errors import ConfigError

_DECAYED = 1e-3


@dataclass(frozen=True, slots=True)
class ZeroPhase:
    """A Butterworth low-pass without phase.

    Run both ways its gain is `1 / (1 + (f / cutoff)^(2 order))`: one half at the cut-off. Source:
    Gustafsson 1996 for the idea of filtering both ways.

    Attributes:
        rate: of the samples [Hz].
        cutoff: [Hz], below half of the rate.
        order: of the filter that is run twice.
    """

    rate: float
    cutoff: float
    order: int = 4

    def __post_init__(self) -> None:
        """Refuse a filter that cannot exist.

        Raises:
            ConfigError: a cut-off that is not between 0 and half of the rate.
        """
        if not 0.0 < self.cutoff < 0.5 * self.rate:
            raise ConfigError(
                f'cut-off {self.cutoff:g} Hz at {self.rate:g} Hz',
                f'above 0 and below {0.5 * self.rate:g} Hz',
            )

    @property
    def trim(self) -> int:
        """Samples at either end to leave out: there the transient is above a thousandth.

        The slowest pole decays as `exp(-2 pi cutoff sin(pi / (2 order)) t)`.
        """
        decay = 2.0 * math.pi * self.cutoff * math.sin(0.5 * math.pi / self.order)
        return REACH + math.ceil(-math.log(_DECAYED) / decay * self.rate)

    def gain(self, frequency: np.ndarray) -> np.ndarray:
        """Return the factor on a sinusoid of `frequency` [Hz]; the bilinear warp included."""
        warped = np.tan(math.pi * np.asarray(frequency) / self.rate)
        ratio = warped / math.tan(math.pi * self.cutoff / self.rate)
        return 1.0 / (1.0 + ratio ** (2 * self.order))

    def smooth(self, x: np.ndarray) -> np.ndarray:
        """Return x (n, ...) filtered along its first axis.

        Beyond either end the signal is continued by its point reflection.
        """
        sections = signal.butter(self.order, self.cutoff, fs=self.rate, output='sos')
        padding = min(3 * self.trim, len(x) - 1)
        return np.asarray(signal.sosfiltfilt(sections, x, axis=0, padlen=padding))

    def states(
        self, position: np.ndarray, velocity: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return position, velocity and acceleration that passed one and the same filter.

        The filtered signal is differentiated by central differences of eighth order; their gain
        is exact to 5e-5 up to a tenth of the rate, so they add nothing to the filter.

        Args:
            position: (n, k) [rad or m].
            velocity: (n, k) measured; None to differentiate the position.
        """
        smooth = self.smooth(position)
        if velocity is None:
            return (
                smooth,
                first_derivative(smooth, self.rate),
                second_derivative(smooth, self.rate),
            )
        speed = self.smooth(velocity)
        return smooth, speed, first_derivative(speed, self.rate)
