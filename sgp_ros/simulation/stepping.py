"""A simulated robot that is advanced sample by sample, live or for a recording.

At each sample the sensors are read, the controller is asked, and its command holds until the next
sample. Time is an integer number of nanoseconds; nothing looks at a clock, so a live node may step
by the time that really passed and a recording by the nominal period.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sgp_ros.errors import NumericalError
from sgp_ros.simulation.integration import integrate
from sgp_ros.simulation.plant import Inputs, Plant, Shown
from sgp_ros.simulation.scenario import Scenario, describe_truth


class HeldCommands:
    """Zero-order hold with a pure delay per channel; before the first command there is 0.

    Args:
        delays_ns: per channel, m of them [ns].
    """

    def __init__(self, delays_ns: Sequence[int]) -> None:
        self._delays_ns = tuple(delays_ns)
        self._entries: list[tuple[int, np.ndarray]] = []

    @property
    def latest(self) -> np.ndarray:
        """The command given last, (m,)."""
        return self._entries[-1][1] if self._entries else np.zeros(len(self._delays_ns))

    def hold(self, time_ns: int, command: np.ndarray) -> None:
        """Give a command (m,) that holds from `time_ns`, not earlier than the one before."""
        self._entries.append((time_ns, command))

    def arrived(self, time_ns: int) -> np.ndarray:
        """Return the command that is in force at `time_ns`, (m,); time never runs backwards."""
        oldest = time_ns - max(self._delays_ns, default=0)
        while len(self._entries) > 1 and self._entries[1][0] <= oldest:
            del self._entries[0]
        command = np.zeros(len(self._delays_ns))
        for channel, delay_ns in enumerate(self._delays_ns):
            for given_ns, values in self._entries:
                if given_ns + delay_ns <= time_ns:
                    command[channel] = values[channel]
        return command

    def switches(self, start_ns: int, end_ns: int) -> list[int]:
        """Return the times strictly between start and end at which the command changes [ns]."""
        times = {given + delay for given, _ in self._entries for delay in self._delays_ns}
        return sorted(time for time in times if start_ns < time < end_ns)


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
        true_acceleration: (k,) of the encoders under the command that has arrived, without the
            noise of the surroundings: what a perfect model predicts [rad/s^2 or m/s^2].
        shown_position: (k,) of the encoders before noise and quantisation [rad or m].
        shown_velocity: (k,) of the encoders before noise [rad/s or m/s].
        effort: (k,) that the currents of the motors stand for [N m or N, by the robot's
            `effort_gain`]; None when it is not measured.
        command_stamp_ns: time from which the command holds [ns].
    """

    stamp_ns: int
    position: np.ndarray
    velocity: np.ndarray | None
    command: np.ndarray
    true_position: np.ndarray
    true_velocity: np.ndarray
    true_acceleration: np.ndarray
    shown_position: np.ndarray
    shown_velocity: np.ndarray
    effort: np.ndarray | None
    command_stamp_ns: int


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
        self._plant = Plant(scenario.moving(), len(simulator.joints), actions)
        delays = [
            sum(round(1e9 * a.delay_s) for a in actions if simulator.joint_names[a.joint] == joint)
            for joint in simulator.command_joints
        ]
        self._commands = HeldCommands(delays)
        choice = simulator.controllers[scenario.controller]
        self._control = choice.build(scenario.mechanism, controlling, 1e-9 * scenario.period_ns)
        self._y = self._plant.initial(scenario.position, scenario.velocity)
        steps_s = (simulator.longest_substep_s, *(action.substep_s for action in actions))
        self._longest_ns = round(1e9 * min(steps_s))
        self._latency_ns = round(1e9 * scenario.sensors.command_latency_s)
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
        self._commands.hold(self._time_ns + self._latency_ns, values)

    def advance(self, elapsed_ns: int) -> None:
        """Let time pass under the command that holds; O(elapsed time).

        Args:
            elapsed_ns: how much [ns].

        Raises:
            ValueError: time that runs backwards.
            NumericalError: a motion that ends in infinity.
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
        shown = self._shown()
        position, velocity = self.scenario.sensors.read(
            shown.position, shown.measured_velocity, self._sensing
        )
        if self._control is not None:
            self.hold(
                self._control(1e-9 * self._time_ns, position, self._rate(position, velocity))
            )
            if not self._latency_ns:
                shown = self._shown()
        self._last = self._sample(shown, position, velocity)
        return self._last

    def _advance_period(self) -> None:
        tick_ns = self._tick_ns + self.scenario.period_ns
        spread_ns = 1e9 * self.scenario.sensors.jitter_s
        shift_ns = round(self._timing.uniform(-spread_ns, spread_ns)) if spread_ns else 0
        self.advance(tick_ns + shift_ns - self._time_ns)
        self._tick_ns = tick_ns

    def _advance_under(self, command: np.ndarray, end_ns: int) -> None:
        length_ns = end_ns - self._time_ns
        count = -(-length_ns // self._longest_ns)
        if count:
            h = 1e-9 * length_ns / count
            scale = np.divide(self.scenario.torque_noise, math.sqrt(h))
            noise = scale * self._process.normal(size=(count, len(scale)))
            for i in range(count):
                time_s = 1e-9 * self._time_ns + i * h
                inputs = Inputs(command, noise[i])
                self._y = integrate(self._plant, time_s, self._y, h, inputs)
        self._time_ns = end_ns
        if not np.all(np.isfinite(self._y)):
            raise NumericalError(
                f'the motion of {self.scenario.simulator.name} is not finite after '
                f'{1e-9 * end_ns:.3f} s',
                'a stable motion',
                'choose another controller, rate or effect',
            )

    def _shown(self) -> Shown:
        return self._plant.shown(
            1e-9 * self._time_ns, self._y, self._commands.arrived(self._time_ns)
        )

    def _rate(self, position: np.ndarray, velocity: np.ndarray | None) -> np.ndarray:
        """Return the velocity as the controller knows it: measured, or a backward difference."""
        if velocity is not None:
            return velocity
        if self._last is None:
            return np.zeros_like(position)
        elapsed_ns = self.scenario.start_ns + self._time_ns - self._last.stamp_ns
        rate: np.ndarray = (position - self._last.position) / (1e-9 * max(elapsed_ns, 1))
        return rate

    def _measured(self, effort: np.ndarray) -> np.ndarray:
        """Return efforts (k,) in the unit in which they are measured."""
        gains = self.scenario.simulator.effort_gain
        return effort / gains if gains else effort

    def _sample(
        self, shown: Shown, position: np.ndarray, velocity: np.ndarray | None
    ) -> SimulatedSample:
        k, moving, now_ns = (
            len(self.joint_names),
            self._plant.k,
            self.scenario.start_ns + self._time_ns,
        )
        sample = SimulatedSample(
            now_ns,
            position,
            velocity,
            self._commands.latest,
            self._y[:k].copy(),
            self._y[moving : moving + k].copy(),
            shown.acceleration,
            shown.position,
            shown.velocity,
            self._measured(shown.effort) if self.scenario.sensors.measures_effort else None,
            now_ns + self._latency_ns,
        )
        for array in (sample.true_position, sample.true_velocity, sample.true_acceleration):
            array.setflags(write=False)
        return sample
