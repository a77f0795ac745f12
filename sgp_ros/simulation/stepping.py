"""A simulated robot that is advanced sample by sample, live or for a recording.

At each sample the sensors are read, the controller is asked, and its command holds until the next
sample. Time is an integer number of nanoseconds; nothing looks at a clock, so a live node may step
by the time that really passed and a recording by the nominal period.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sgp_ros.simulation.held_commands import HeldCommands
from sgp_ros.simulation.integration import integrate
from sgp_ros.simulation.plant import Inputs, Plant
from sgp_ros.simulation.truth import describe_truth

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sgp_ros.simulation.scenario import Scenario

LONGEST_SUBSTEP_NS = 1_000_000
"""Steps of the integration are at most this long [ns]."""


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedSample:
    """One sample of k joints with m commands.

    Attributes:
        stamp_ns: time of the state, from which the command holds [ns].
        position: (k,) measured [rad or m].
        velocity: (k,) measured [rad/s or m/s]; None when it is not.
        command: (m,) given at this sample [unit of the command].
        true_position: (k,) [rad or m].
        true_velocity: (k,) [rad/s or m/s].
        true_acceleration: (k,) right after the command was given, without the noise of the
            surroundings: what a perfect model predicts [rad/s^2 or m/s^2].
    """

    stamp_ns: int
    position: np.ndarray
    velocity: np.ndarray | None
    command: np.ndarray
    true_position: np.ndarray
    true_velocity: np.ndarray
    true_acceleration: np.ndarray


class Simulation:
    """A robot in motion. Build it with `make_simulation`.

    Args:
        scenario: everything that determines it.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        simulator = scenario.simulator
        seeds = np.random.SeedSequence(scenario.seed).spawn(4)
        self._process, self._sensing, controlling, self._timing = map(np.random.default_rng, seeds)
        actions = scenario.actions()
        self._plant = Plant(scenario.mechanism, len(simulator.joints), actions)
        delays = [
            sum(round(1e9 * a.delay_s) for a in actions if simulator.joint_names[a.joint] == joint)
            for joint in simulator.command_joints
        ]
        self._commands = HeldCommands(delays)
        choice = simulator.controllers[scenario.controller]
        self._control = choice.build(scenario.mechanism, controlling, 1e-9 * scenario.period_ns)
        self._y = self._plant.initial(scenario.position, scenario.velocity)
        self._time_ns = 0
        self._tick_ns = 0
        self._last: SimulatedSample | None = None

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the k joints, in the order of all arrays."""
        return self.scenario.simulator.joint_names

    @property
    def command_joints(self) -> tuple[str, ...]:
        """Names of the m joints that are commanded."""
        return self.scenario.simulator.command_joints

    def truth(self) -> dict[str, object]:
        """Return what is true of this simulation, in a form that JSON can hold."""
        return describe_truth(self.scenario)

    def hold(self, command: Sequence[float] | np.ndarray) -> None:
        """Give a command (m,) that holds from now on, as a controller outside does.

        Raises:
            ValueError: another number of values than commands, or values that are not finite.
        """
        values = np.array(command, dtype=np.float64)
        if values.shape != (len(self.command_joints),) or not np.all(np.isfinite(values)):
            raise ValueError(f'command {values} for the joints {self.command_joints}')
        values.setflags(write=False)
        self._commands.hold(self._time_ns, values)

    def advance(self, elapsed_ns: int) -> None:
        """Let time pass under the command that holds; O(elapsed time).

        Args:
            elapsed_ns: how much [ns].

        Raises:
            ValueError: time that runs backwards.
        """
        if elapsed_ns < 0:
            raise ValueError(f'elapsed time {elapsed_ns} ns is negative')
        end_ns = self._time_ns + elapsed_ns
        self._tick_ns += elapsed_ns
        for switch_ns in [*self._commands.switches(self._time_ns, end_ns), end_ns]:
            self._advance_under(self._commands.arrived(self._time_ns), switch_ns)

    def step(self, elapsed_ns: int | None = None) -> SimulatedSample:
        """Let one period pass, read the sensors, ask the controller.

        The first step returns the state at the start, unless time is given to it.

        Args:
            elapsed_ns: since the last sample or `advance` [ns]; None for the nominal period with
                the jitter of the sensors.
        """
        if elapsed_ns is not None:
            self.advance(elapsed_ns)
        elif self._last is not None:
            self._advance_period()
        position, velocity = self._read()
        if self._control is not None:
            self.hold(
                self._control(1e-9 * self._time_ns, position, self._rate(position, velocity))
            )
        self._last = self._sample(position, velocity)
        return self._last

    def _advance_period(self) -> None:
        tick_ns = self._tick_ns + self.scenario.period_ns
        spread_ns = 1e9 * self.scenario.sensors.jitter_s
        shift_ns = round(self._timing.uniform(-spread_ns, spread_ns)) if spread_ns else 0
        self.advance(tick_ns + shift_ns - self._time_ns)
        self._tick_ns = tick_ns

    def _advance_under(self, command: np.ndarray, end_ns: int) -> None:
        length_ns = end_ns - self._time_ns
        count = -(-length_ns // LONGEST_SUBSTEP_NS)
        if count:
            h = 1e-9 * length_ns / count
            scale = np.divide(self.scenario.torque_noise, math.sqrt(h))
            noise = scale * self._process.normal(size=(count, len(scale)))
            for i in range(count):
                time_s = 1e-9 * self._time_ns + i * h
                inputs = Inputs(command, noise[i])
                self._y = integrate(self._plant, time_s, self._y, h, inputs)
        self._time_ns = end_ns

    def _read(self) -> tuple[np.ndarray, np.ndarray | None]:
        seen = self._plant.seen(
            1e-9 * self._time_ns, self._y, self._commands.arrived(self._time_ns)
        )
        return self.scenario.sensors.read(*seen, self._sensing)

    def _rate(self, position: np.ndarray, velocity: np.ndarray | None) -> np.ndarray:
        """Return the velocity as the controller knows it: measured, or a backward difference."""
        if velocity is not None:
            return velocity
        if self._last is None:
            return np.zeros_like(position)
        elapsed_ns = self.scenario.start_ns + self._time_ns - self._last.stamp_ns
        rate: np.ndarray = (position - self._last.position) / (1e-9 * max(elapsed_ns, 1))
        return rate

    def _sample(self, position: np.ndarray, velocity: np.ndarray | None) -> SimulatedSample:
        k, time_s = len(self.joint_names), 1e-9 * self._time_ns
        arrived = self._commands.arrived(self._time_ns)
        sample = SimulatedSample(
            self.scenario.start_ns + self._time_ns,
            position,
            velocity,
            self._commands.latest,
            self._y[:k].copy(),
            self._y[k : 2 * k].copy(),
            self._plant.acceleration(time_s, self._y, arrived),
        )
        for array in (sample.true_position, sample.true_velocity, sample.true_acceleration):
            array.setflags(write=False)
        return sample
