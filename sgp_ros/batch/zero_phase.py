"""Filters on a uniform grid: a low-pass without phase, and central differences.

The low-pass is a Butterworth filter run forwards, then backwards. The differences are of eighth
order. With the central difference `delta`, `h^2 d^2/dt^2 = delta^2 - delta^4/12 + delta^6/90 -
delta^8/560 + ...` (Fornberg 1988). Up to the tenth of the sampling rate the relative error of the
frequency response is below 5e-5 for both derivatives, so no compensation is needed there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy  # its parts load when they are used

from sgp_ros.errors import ConfigError

_SECOND_DIFFERENCE = np.array([1.0, -2.0, 1.0])
_FIRST = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0.0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])


def _sharpening() -> np.ndarray:
    """Return `1 - delta^2/12 + delta^4/90 - delta^6/560` as weights, (7,)."""
    weights = np.zeros(7)
    power = np.ones(1)
    for factor in (1.0, -1 / 12, 1 / 90, -1 / 560):
        margin = (7 - len(power)) // 2
        weights[margin : 7 - margin] += factor * power
        power = np.convolve(power, _SECOND_DIFFERENCE)
    return weights


_SHARPEN = _sharpening()
_SECOND = np.convolve(_SHARPEN, _SECOND_DIFFERENCE)

REACH = 4
"""Samples beside a sample that its derivative depends on."""


def first_derivative(x: np.ndarray, rate: float) -> np.ndarray:
    """Return the time derivative of x (n, ...) sampled at `rate` [Hz].

    `REACH` samples at either end see values repeated beyond the end.
    """
    return scipy.ndimage.correlate1d(x, _FIRST, axis=0, mode='nearest') * rate


def second_derivative(x: np.ndarray, rate: float) -> np.ndarray:
    """Return the second time derivative of x (n, ...) sampled at `rate` [Hz]; ends as above."""
    return scipy.ndimage.correlate1d(x, _SECOND, axis=0, mode='nearest') * rate**2


def sharpened(average: np.ndarray) -> np.ndarray:
    """Undo the average of a signal with the hat of one step on either side, (n, ...).

    The second difference of a position over h^2 is its acceleration averaged with that hat.
    `second_derivative` is the same second difference, sharpened by these weights. A force that
    was averaged with the hat and sharpened has therefore passed exactly the filter that the
    acceleration has passed, at every frequency.
    """
    return scipy.ndimage.correlate1d(average, _SHARPEN, axis=0, mode='nearest')


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
        sections = scipy.signal.butter(self.order, self.cutoff, fs=self.rate, output='sos')
        padding = min(3 * self.trim, len(x) - 1)
        return np.asarray(scipy.signal.sosfiltfilt(sections, x, axis=0, padlen=padding))

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
