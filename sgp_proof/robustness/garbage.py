"""Streams of events with everything in them that a sensor, a clock or a caller can get wrong."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from sgp_ros.engine.config import EngineConfig, describe_settings
from sgp_ros.engine.samples import (
    POSITION,
    CommandSample,
    Event,
    JointSample,
    Reset,
    SettingsChange,
    SettingValue,
    frozen_array,
)
from sgp_ros.robots.robot import Robot

START_NS = 1_700_000_000 * 10**9
RATES_HZ = (50.0, 100.0, 200.0, 1000.0)
NUMBERS = (
    math.nan, math.inf, -math.inf, 0.0, -0.0, 5e-324, 1e-300, 1e-12, 1e3, 1e6, -1e6, 1e9, 1e12,
    1e29, -1e31, 1e75, 1e149, 1e154, -1e154, 1e200, 1e300, 1.7e308,
)  # fmt: skip
STAMPS_NS = (-1, 0, 1, -(10**18), 2**31 * 10**9 - 1, 2**31 * 10**9, 2**62, 2**63, 2**64, 10**30)
BURST = 40


class Stream:
    """An endless stream of one robot: a clean motion, and by chance what spoils it.

    Args:
        robot: whose joints move.
        seed: of everything.
        spoiled: share of the events that something is wrong with.
    """

    def __init__(self, robot: Robot, seed: int, spoiled: float) -> None:
        self._robot = robot
        self._rng = np.random.default_rng(seed)
        self._spoiled = spoiled
        k = len(robot.joints)
        self._rate = 2.0 * np.pi * self._rng.uniform(0.1, 1.5, size=(k, 2))
        self._phase = self._rng.uniform(0.0, 2.0 * np.pi, size=(k, 2))
        self._period_ns = round(1e9 / float(self._rng.choice(RATES_HZ)))
        self._carries_effort = bool(self._rng.integers(2))
        self._scale = 10.0 ** float(self._rng.choice([0.0, 0.0, 0.0, -12.0, 12.0]))
        self._settings = {s.name: s for s in describe_settings(robot)}
        self.now_ns = START_NS

    def settings(self) -> dict[str, SettingValue]:
        """Return settings that the engine accepts, so small that fits and drops are frequent."""
        rng = self._rng
        return {
            'buffer.budget': int(rng.integers(4, 60)),
            'learning.initial': int(rng.integers(4, 40)),
            'refit.period': int(rng.integers(20, 200)),
            'refit.enabled': bool(rng.integers(4) == 0),
            'filter.window': float(rng.choice([-1.0, 0.05, 0.1, 0.1, 0.3])),
            'filter.hop': float(rng.choice([0.0, 0.02, 0.05])),
            'buffer.mode': str(rng.choice(['exact', 'exact', 'basis'])),
            'buffer.policy': str(rng.choice(['oldest', 'least_informative', 'coverage'])),
            'basis.features': int(rng.integers(2, 30)),
            'forgetting.samples': float(rng.choice([0.0, 0.0, 1.0, 100.0])),
            'effort.source': str(rng.choice(['auto', 'auto', 'state', 'command'])),
        }

    def events(self, n: int) -> Iterator[Event]:
        """Yield n events."""
        made = 0
        while made < n:
            for event in self._next():
                yield event
                made += 1
                if made == n:
                    return

    def _next(self) -> list[Event]:
        self.now_ns += self._period_ns
        state, command = self._state(), self._command()
        if self._rng.random() >= self._spoiled:
            return [command, state] if self._rng.integers(2) else [state]
        return self._wrong(state, command)

    def _motion(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        angle = self._rate * (self.now_ns - START_NS) * 1e-9 + self._phase
        noise = 1e-5 * self._rng.standard_normal(len(angle))
        position = np.sin(angle).sum(axis=1) + noise
        velocity = (self._rate * np.cos(angle)).sum(axis=1)
        effort = -(self._rate**2 * np.sin(angle)).sum(axis=1) + 0.3 * velocity
        return position, velocity, effort * self._scale

    def _state(self) -> JointSample:
        position, velocity, effort = self._motion()
        return JointSample(
            self.now_ns,
            self._robot.joint_names,
            frozen_array(position),
            frozen_array(velocity) if self._rng.integers(2) else None,
            frozen_array(effort) if self._carries_effort else None,
        )

    def _command(self) -> CommandSample:
        names = tuple(joint.name for joint in self._robot.joints if joint.is_actuated)
        at = [self._robot.joint_names.index(name) for name in names]
        return CommandSample(self.now_ns, frozen_array(self._motion()[2][at]), names or ('none',))

    def _wrong(self, state: JointSample, command: CommandSample) -> list[Event]:
        kinds = (
            self._numbers, self._numbers, self._stamps, self._jump, self._names, self._lengths,
            self._change, self._stuck, self._flood, self._order, self._burst,
        )  # fmt: skip
        return kinds[self._rng.integers(len(kinds))](state, command)

    def _number(self) -> float:
        return float(self._rng.choice(NUMBERS) * self._rng.choice([1.0, -1.0, 0.3]))

    def _spoil(self, values: np.ndarray | None) -> np.ndarray | None:
        if values is None or not len(values):
            return values
        found = values.copy()
        which = self._rng.random(len(found)) < self._rng.choice([0.3, 1.0])
        found[which] = [self._number() for _ in range(int(which.sum()))]
        return frozen_array(found)

    def _numbers(self, state: JointSample, command: CommandSample) -> list[Event]:
        arrays = [state.position, state.velocity, state.effort]
        which = int(self._rng.integers(4))
        if which == 3:
            effort = self._spoil(command.effort)
            assert effort is not None
            return [CommandSample(command.stamp_ns, effort, command.names), state]
        arrays[which] = self._spoil(arrays[which])
        position, velocity, effort = arrays
        assert position is not None
        return [JointSample(state.stamp_ns, state.names, position, velocity, effort)]

    def _stamps(self, state: JointSample, command: CommandSample) -> list[Event]:
        stamp = int(self._rng.choice(len(STAMPS_NS)))
        wrong = STAMPS_NS[stamp]
        if self._rng.integers(2):
            wrong = self.now_ns + int(self._rng.normal() * 10.0 ** self._rng.integers(6, 17))
        which = [
            JointSample(wrong, state.names, state.position, state.velocity, state.effort),
            CommandSample(wrong, command.effort, command.names),
            SettingsChange(wrong, {'filter.hop': 0.02}),
        ][int(self._rng.integers(3))]
        return [which] * int(self._rng.integers(1, 4))

    def _jump(self, _state: JointSample, command: CommandSample) -> list[Event]:
        far = int(self._rng.normal() * 10.0 ** self._rng.integers(8, 16))
        self.now_ns = max(self.now_ns + far, 1)
        return [command, self._state()]

    def _names(self, state: JointSample, command: CommandSample) -> list[Event]:
        names = [*state.names]
        names[int(self._rng.integers(len(names)))] = str(
            self._rng.choice(['', 'other', names[0], 'x' * 1000])
        )
        first = JointSample(state.stamp_ns, tuple(names), state.position)
        return [first, CommandSample(command.stamp_ns, command.effort[:1], ('other',))]

    def _lengths(self, state: JointSample, command: CommandSample) -> list[Event]:
        size = int(self._rng.choice([0, 1, len(state.names) + 1, 1000]))
        numbers = frozen_array(self._rng.normal(size=size))
        which = int(self._rng.integers(4))
        if which == 0:
            return [CommandSample(command.stamp_ns, numbers, command.names)]
        if which == 1:
            return [CommandSample(command.stamp_ns, numbers, None, POSITION, numbers[:1])]
        arrays = [state.position, state.velocity, state.effort]
        arrays[int(self._rng.integers(3))] = numbers
        position, velocity, effort = arrays
        assert position is not None
        return [JointSample(state.stamp_ns, state.names, position, velocity, effort)]

    def _change(self, state: JointSample, command: CommandSample) -> list[Event]:
        name = str(self._rng.choice([*self._settings, 'no.such.setting']))
        values: list[SettingValue] = [
            -1.0, 0.0, 1e-9, 1e-3, 0.02, 0.3, 5.0, 1e30, 0, 1, 6, 40, 10**12, True, False, '',
            'state',
            'oldest', 'always', (1.0,), (0.0,), ('default',), math.nan,
        ]  # fmt: skip
        value = values[int(self._rng.integers(len(values)))]
        if self._rng.integers(20) == 0:
            return [Reset(self.now_ns), state]
        return [SettingsChange(self.now_ns, {name: value}), command, state]

    def _stuck(self, state: JointSample, command: CommandSample) -> list[Event]:
        return [state, command] * int(self._rng.integers(1, BURST))

    def _flood(self, _state: JointSample, command: CommandSample) -> list[Event]:
        found: list[Event] = []
        for _ in range(int(self._rng.integers(1, 4 * BURST))):
            self.now_ns += self._period_ns
            found.append(CommandSample(self.now_ns, command.effort, command.names))
        return found

    def _order(self, state: JointSample, _command: CommandSample) -> list[Event]:
        found: list[Event] = [state]
        for _ in range(int(self._rng.integers(1, BURST))):
            self.now_ns += self._period_ns
            found += [self._command(), self._state()]
        return [found[i] for i in self._rng.permutation(len(found))]

    def _burst(self, _state: JointSample, _command: CommandSample) -> list[Event]:
        found: list[Event] = []
        for _ in range(int(self._rng.integers(1, BURST))):
            self.now_ns += self._period_ns
            found += self._numbers(self._state(), self._command())
        return found


def make_config(robot: Robot, stream: Stream) -> EngineConfig:
    """Return a configuration with the settings of a stream."""
    return EngineConfig.from_mapping(stream.settings(), robot)
