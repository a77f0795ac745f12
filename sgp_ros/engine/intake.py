"""Decides of every state and command whether it is used, and for which reason it is not."""

from __future__ import annotations

import numpy as np

from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.pairing import CommandHistory
from sgp_ros.engine.results import Counts
from sgp_ros.engine.samples import CommandSample, Event, JointSample
from sgp_ros.engine.windows import Equation, State, WindowFilter
from sgp_ros.robots.robot import Robot


class Intake:
    """Checks ordered samples, pairs states with commands and filters them.

    Attributes:
        commands: the commands of the recent past.
        windows: the states of the recent past.
        last_state_ns: stamp of the last state that was released [ns], None before the first.
    """

    def __init__(self, robot: Robot, config: EngineConfig, counts: Counts) -> None:
        self._robot = robot
        self._counts = counts
        self._is_driven = any(joint.is_actuated for joint in robot.joints)
        self._actuated = np.array([joint.is_actuated for joint in robot.joints])
        self._gains = np.array([joint.effort_gain for joint in robot.joints])
        self._last_order: tuple[tuple[str, ...], np.ndarray | None] = ((), None)
        self.commands = CommandHistory()
        self.last_state_ns: int | None = None
        self.configure(config)

    def configure(self, config: EngineConfig) -> None:
        """Take new settings; a changed filter starts a new window."""
        self.configure_limits(config)
        self.windows = WindowFilter(self._robot, config)

    def configure_limits(self, config: EngineConfig) -> None:
        """Take new settings that leave the filter as it is."""
        self._config = config
        order = config.command_joints
        self._command_joints = tuple(
            joint.name for joint in self._robot.joints if joint.is_actuated
        ) if order == ('',) else order  # fmt: skip

    def refuse_early(self, event: Event) -> bool:
        """Refuse what no order can mend: unknown joints, bad numbers, wrong lengths.

        Returns:
            Whether the event was refused and counted.
        """
        if isinstance(event, JointSample):
            reason = self._state_problem(event)
            if reason:
                self._counts.refused[reason] += 1
            return reason is not None
        if isinstance(event, CommandSample):
            reason = self._command_problem(event)
            if reason:
                self._counts.commands_refused[reason] += 1
            return reason is not None
        return False

    def take_command(self, command: CommandSample) -> None:
        """Let a released command hold from its stamp on; joints it leaves out keep theirs."""
        names = command.names or self._command_joints
        held = self.commands.efforts
        effort = held[-1].copy() if held else np.zeros(len(self._robot.joints))
        for name, value in zip(names, command.effort, strict=True):
            if name in self._robot.joint_names:
                joint = self._robot.joint_names.index(name)
                effort[joint] = value * self._gains[joint]
        self.commands.add(command.stamp_ns, effort)

    def take_state(self, sample: JointSample) -> list[Equation]:
        """Return the equations that a released state completes."""
        last, self.last_state_ns = self.last_state_ns, sample.stamp_ns
        if last is not None and sample.stamp_ns - last > self._config.max_gap * 1e9:
            self._counts.refused['gap'] += 1
            self.windows.restart()
            return []
        state = self._state(sample)
        if state is None:
            self._counts.refused['unpaired'] += 1
            self.windows.restart()
            return []
        return self.windows.push(state, self.commands)

    def _state(self, sample: JointSample) -> State | None:
        """Return the state in the robot's order; None where no effort belongs to it."""
        order = self._order(sample.names)
        velocity = _chosen(sample.velocity, order)
        if velocity is not None and not np.isfinite(velocity).all():
            velocity = None
        effort = _chosen(sample.effort, order)
        if effort is not None and not np.isfinite(effort[self._actuated]).all():
            effort = None
        if self._config.effort_source == 'command':
            effort = None
        if effort is not None:
            effort = np.where(self._actuated, effort * self._gains, 0.0)
        elif self._is_driven and not self._has_command(sample.stamp_ns):
            return None
        return State(sample.stamp_ns, sample.position[order], velocity, effort)

    def _has_command(self, stamp_ns: int) -> bool:
        if self._config.effort_source == 'state':
            return False
        age = self.commands.age_ns(stamp_ns)
        return age is not None and age <= self._config.command_timeout * 1e9

    def _state_problem(self, sample: JointSample) -> str | None:
        order = self._order(sample.names)
        if order is None:
            return 'unknown_joint'
        if not np.isfinite(sample.position[order]).all():
            return 'nonfinite'
        velocity, effort = _chosen(sample.velocity, order), _chosen(sample.effort, order)
        if velocity is not None and np.isinf(velocity).any():
            return 'nonfinite'
        if effort is not None and np.isinf(effort[self._actuated]).any():
            return 'nonfinite'
        is_missing = velocity is None or np.isnan(velocity).any()
        if self._config.filter_velocity == 'measured' and is_missing:
            return 'nonfinite'
        return None

    def _order(self, names: tuple[str, ...]) -> np.ndarray | None:
        """Return the places of the robot's joints among `names`, (k,); None where one is missing.

        Sources keep their order, so the last one is kept.
        """
        if names != self._last_order[0]:
            wanted = self._robot.joint_names
            is_whole = set(wanted) <= set(names)
            order = np.array([names.index(name) for name in wanted]) if is_whole else None
            self._last_order = names, order
        return self._last_order[1]

    def _command_problem(self, command: CommandSample) -> str | None:
        if len(command.effort) != len(command.names or self._command_joints):
            return 'wrong_length'
        if command.names and not set(command.names) & set(self._robot.joint_names):
            return 'unknown_joint'
        if not np.all(np.isfinite(command.effort)):
            return 'nonfinite'
        return None


def _chosen(values: np.ndarray | None, order: np.ndarray | None) -> np.ndarray | None:
    return None if values is None else values[order]
