"""Controllers that any simulated robot may use.

A controller is a function of time and of the measured state; it is asked once a sample and its
command holds until the next one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from sgp_ros.simulation.mechanism import Mechanism

_LOWEST_HZ, _HIGHEST_HZ = 0.1, 3.0

Controller = Callable[[float, np.ndarray, np.ndarray], np.ndarray]
"""From time [s], measured position (k,) and velocity (k,) to the command (m,)."""

ControllerBuild = Callable[['Mechanism', np.random.Generator, float], 'Controller | None']
"""From mechanism, generator and sampling period [s] to a controller; None leaves the command to
whoever steps the simulation."""


@dataclass(frozen=True, slots=True, eq=False)
class ControllerChoice:
    """A controller of a robot with the state from which it starts.

    Attributes:
        build: makes the controller.
        position: (k,) at the start [rad or m].
        velocity: (k,) at the start [rad/s or m/s].
    """

    build: ControllerBuild
    position: tuple[float, ...]
    velocity: tuple[float, ...]


def sinusoids(
    rms: Sequence[float], *, count: int = 8, avoided_hz: tuple[float, float] = (0.0, 0.0)
) -> ControllerBuild:
    """Build a mix of sinusoids of random phases and of random frequencies from 0.1 to 3 Hz.

    Source: Wu and Movellan, section IV.B, who give neither number nor range.

    Args:
        rms: (m,) root mean square of each command [unit of the command].
        count: number of sinusoids per command.
        avoided_hz: a band without frequencies, such as a resonance that leads far away.
    """
    start_hz, end_hz = avoided_hz
    highest_hz = _HIGHEST_HZ - (end_hz - start_hz)

    def build(
        _mechanism: Mechanism, rng: np.random.Generator, _period_s: float
    ) -> Controller | None:
        shape = (len(rms), count)
        frequency = rng.uniform(_LOWEST_HZ, highest_hz, shape)
        frequency = frequency + (end_hz - start_hz) * (frequency > start_hz)
        rate = 2.0 * math.pi * frequency
        phase = rng.uniform(0.0, 2.0 * math.pi, shape)
        amplitude = np.asarray(rms, dtype=np.float64)[:, np.newaxis] * math.sqrt(2.0 / count)
        return lambda t, _q, _v: np.sum(amplitude * np.sin(rate * t + phase), axis=1)

    return build


def zero(m: int) -> ControllerBuild:
    """Build a controller that commands nothing, for m commands."""
    return lambda _mechanism, _rng, _period_s: lambda _t, _q, _v: np.zeros(m)


def external(
    _mechanism: Mechanism, _rng: np.random.Generator, _period_s: float
) -> Controller | None:
    """Leave the command to whoever steps the simulation."""
    return None
