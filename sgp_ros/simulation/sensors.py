"""Sensors of the true state: noise, quantisation, uneven sampling."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sgp_ros.errors import ConfigError


def encoder_resolution(bits: int) -> float:
    """Return the step of an encoder with 2^bits counts a revolution [rad]."""
    return float(2.0 * math.pi / 2**bits)


@dataclass(frozen=True, slots=True)
class Sensors:
    """The sensors of a robot; one number of a tuple holds for all joints.

    Attributes:
        resolution: per joint, step of the encoder, 0 for none [rad or m].
        position_noise: per joint, standard deviation before the quantisation [rad or m].
        measures_velocity: whether velocity is measured at all.
        velocity_noise: per joint, standard deviation [rad/s or m/s].
        jitter_s: a state is taken up to this much earlier or later than the clock says, uniformly;
            its stamp is right all the same [s].
        measures_effort: whether the currents of the motors are measured.
        command_latency_s: from a state to the command that answers it [s].
    """

    resolution: tuple[float, ...] = (0.0,)
    position_noise: tuple[float, ...] = (0.0,)
    measures_velocity: bool = False
    velocity_noise: tuple[float, ...] = (0.0,)
    jitter_s: float = 0.0
    measures_effort: bool = False
    command_latency_s: float = 0.0

    def checked(self, k: int, period_s: float) -> Sensors:
        """Return these sensors if they suit k joints sampled every `period_s`.

        Raises:
            ConfigError: wrong lengths, negative or infinite numbers, jitter that swaps states.
        """
        problems = []
        for name in ('resolution', 'position_noise', 'velocity_noise'):
            numbers = getattr(self, name)
            if len(numbers) not in (1, k) or not all(0.0 <= x < math.inf for x in numbers):
                problems.append(f'{name} = {numbers}')
        if not 0.0 <= self.jitter_s < 0.5 * period_s:
            problems.append(f'jitter_s = {self.jitter_s}')
        if not 0.0 <= self.command_latency_s < period_s:
            problems.append(f'command_latency_s = {self.command_latency_s}')
        if problems:
            raise ConfigError(
                'sensors with ' + ', '.join(problems),
                f'1 or {k} finite numbers of at least 0, jitter_s below {0.5 * period_s:g} s, '
                f'command_latency_s below {period_s:g} s',
            )
        return self

    def read(
        self, position: np.ndarray, velocity: np.ndarray, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray | None]:
        """Return measured position (k,) and velocity (k,) or None, from what the sensors see."""
        seen = position + np.multiply(self.position_noise, rng.normal(size=len(position)))
        steps = np.broadcast_to(self.resolution, seen.shape)
        counts = np.round(seen / np.where(steps > 0.0, steps, 1.0)) * steps
        seen = np.where(steps > 0.0, counts, seen)
        if not self.measures_velocity:
            return seen, None
        noise = rng.normal(size=len(velocity))
        return seen, velocity + np.multiply(self.velocity_noise, noise)
