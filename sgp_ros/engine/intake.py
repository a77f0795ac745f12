"""The one intake of states and commands, which live, replay, identify and diagnose share.

It decides for every event whether it is used, and if not, for which reason. The use of accepted
states is decided elsewhere: online they fill windows, offline whole stretches.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sgp_ros.engine.clock import END_NS
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.held_commands import CommandHistory
from sgp_ros.engine.limits import Limits
from sgp_ros.engine.missing_messages import RepeatedNumbers
from sgp_ros.engine.results import Counts
from sgp_ros.engine.samples import (
    EFFORT,
    POSITION,
    VELOCITY,
    CommandSample,
    Event,
    JointSample,
)
from sgp_ros.robots.gains import Gains, stated_gains
from sgp_ros.robots.robot import Robot

GREATEST = 1e30
"""Numbers from here on are not measurements: products of quantities derived from them, such as
accelerations over nanoseconds, would not be finite."""


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """One accepted state of the robot's k joints, in the robot's order.

    Attributes:
        stamp_ns: header stamp [ns].
        position: (k,).
        velocity: (k,) measured, or None.
        effort: (k,) measured, or None where the command counts.
    """

    stamp_ns: int
    position: np.ndarray
    velocity: np.ndarray | None
    effort: np.ndarray | None


class Intake:
    """Checks events, pairs states with efforts, counts what it refuses.

    `admit` takes events as they arrive, `take_command` and `take_state` take the admitted ones in
    the order of their stamps. With `effort.source: auto` commands count until the first state
    that carries a measured effort; from there on a state without one is refused as unpaired.

    Targets of position or velocity become the efforts that drives with stated gains make of them
    at the time of each state, which needs measured velocities where the gains damp.

    Args:
        robot: whose joints are taken, in its order.
        config: settings of the intake.
        counts: where reads and refusals are counted.
        commands_are: what commands ask for, `EFFORT` or `POSITION`; with the latter targets of
            position and velocity, (2 k,), are held instead of efforts.

    Attributes:
        commands: those taken.
        targets: taken of a robot with stated gains, (2 k,) each.
        last_state_ns: stamp of the last state that was no repetition [ns]; None before.
        repeats: why the last state was one, `duplicate` or `stale`; empty if it was none.
        repeated: what decides on that.
        is_measured: whether a state with a measured effort has been accepted.
        limits: what the joints cannot do.
    """

    def __init__(
        self, robot: Robot, config: EngineConfig, counts: Counts, commands_are: str = EFFORT
    ) -> None:
        self._robot = robot
        self._joints = robot.joint_names
        self._commands_are = commands_are
        self._counts = counts
        self._actuated = np.array([joint.is_actuated for joint in robot.joints])
        self._is_driven = bool(self._actuated.any())
        self._gains = np.array([joint.effort_gain for joint in robot.joints])
        self._last_order: tuple[tuple[str, ...], np.ndarray | None] = ((), None)
        self.commands = CommandHistory(robot.effort_map.memory_s if robot.effort_map else 0.0)
        self.targets = CommandHistory()
        driven = [joint.name for joint in robot.joints if joint.is_actuated]
        self._drives = stated_gains(robot.source, self._joints, driven)
        self.last_state_ns: int | None = None
        self.is_measured = False
        self.repeats, self.repeated = '', RepeatedNumbers()
        self.limits = Limits(robot)
        self.configure(config)

    def configure(self, config: EngineConfig) -> None:
        """Take new settings, in force from the next event on."""
        self._config = config
        order = config.command_joints
        self._command_joints = tuple(
            joint.name for joint in self._robot.joints if joint.is_actuated
        ) if order == ('',) else order  # fmt: skip

    def admit(self, event: Event) -> bool:
        """Count an event that arrives; refuse what sorting cannot repair.

        Returns:
            Whether joints, numbers and lengths are as they should be.
        """
        reason = None if 0 <= event.stamp_ns < END_NS else 'clock'
        if isinstance(event, JointSample):
            self._counts.read += 1
            reason = reason or self._state_problem(event)
        elif isinstance(event, CommandSample):
            self._counts.commands_read += 1
            reason = reason or self._command_problem(event)
        if reason:
            self.refuse(event, reason)
        return reason is None

    def refuse_failed(self, event: Event) -> None:
        """Count an event as read and as refused, on whose way an error struck."""
        self._counts.read += isinstance(event, JointSample)
        self._counts.commands_read += isinstance(event, CommandSample)
        self.refuse(event, 'error')

    def refuse(self, event: Event, reason: str) -> None:
        """Count an event that is refused for a reason among those of `results`."""
        if isinstance(event, JointSample):
            self._counts.refused[reason] += 1
        elif isinstance(event, CommandSample):
            self._counts.commands_refused[reason] += 1
        else:
            self._counts.changes_refused[reason] += 1

    def take_command(self, command: CommandSample) -> None:
        """Let a command hold from its stamp on; joints it leaves out keep theirs."""
        names = command.names or self._command_joints
        is_converted = self._commands_are == EFFORT and command.kind != EFFORT
        history = self.targets if is_converted else self.commands
        is_target = is_converted or self._commands_are == POSITION
        held, k = history.efforts, len(self._joints)
        effort = held[-1].copy() if held else np.zeros(2 * k if is_target else k)
        for i, name in enumerate(names):
            if name not in self._joints:
                continue
            joint = self._joints.index(name)
            if is_target:
                asked, v = command.effort[i], command.velocity
                both = (asked, 0.0 if v is None else v[i])
                effort[[joint, k + joint]] = (0.0, asked) if command.kind == VELOCITY else both
            else:
                effort[joint] = command.effort[i] * self._gains[joint]
        history.add(command.stamp_ns, effort)
        self._counts.commands_used += 1

    def take_state(self, sample: JointSample) -> State | None:
        """Return a state in the robot's order; None where it is refused, for one reason."""
        last = self.last_state_ns
        self.repeats = self.repeated.reason(sample, last, self._config.max_gap)
        if self.repeats:
            self._counts.refused[self.repeats] += 1
            return None
        self.last_state_ns = sample.stamp_ns
        if last is not None and sample.stamp_ns - last > self._config.max_gap * 1e9:
            self._counts.refused['gap'] += 1
            return None
        order = self._order(sample.names)
        is_paired, effort = self._effort(sample, order)
        if not is_paired:
            self._counts.refused['unpaired'] += 1
            return None
        velocity = _chosen(sample.velocity, order)
        if velocity is not None and not (_are_numbers(velocity) or np.isfinite(velocity).all()):
            velocity = None
        position = sample.position[order]
        if not self.limits.permit(position, velocity, effort):
            self._counts.refused['implausible'] += 1
            return None
        self._counts.used += 1
        return State(sample.stamp_ns, position, velocity, effort)

    def _effort(
        self, sample: JointSample, order: np.ndarray | None
    ) -> tuple[bool, np.ndarray | None]:
        """Return whether an effort belongs to a state, and the measured one where it counts."""
        if not self._is_driven:
            return True, np.zeros(len(self._actuated))
        source = self._config.effort_source
        effort = None if source == 'command' else _chosen(sample.effort, order)
        if effort is not None and (
            _are_numbers(effort) or np.isfinite(effort[self._actuated]).all()
        ):
            self.is_measured = True
            return True, np.where(self._actuated, effort * self._gains, 0.0)
        if source == 'state' or (source == 'auto' and self.is_measured):
            return False, None
        timeout_ns = self._config.command_timeout * 1e9
        if self._drives is not None and self.targets.stamps_ns:
            held = self._held_effort(self._drives, sample, order, timeout_ns)
            return held is not None, held
        age = self.commands.age_ns(sample.stamp_ns)
        return age is not None and age <= timeout_ns, None

    def _held_effort(
        self, drives: Gains, sample: JointSample, order: np.ndarray | None, timeout_ns: float
    ) -> np.ndarray | None:
        """Return what the drives make of the target at the time of a state, (k,)."""
        age = self.targets.age_ns(sample.stamp_ns)
        if age is None or age > timeout_ns:
            return None
        self.targets.forget_before(sample.stamp_ns)
        measured = _chosen(sample.velocity, order)
        velocity = np.where(drives.kd > 0.0, np.nan if measured is None else measured, 0.0)
        effort = drives.effort(self.targets.efforts[0], sample.position[order], velocity)
        return effort if np.isfinite(effort).all() else None

    def begin_segment(self) -> None:
        """Forget stamps and commands: what follows has another time."""
        self.commands.clear()
        self.targets.clear()
        self.last_state_ns = None

    def _state_problem(self, sample: JointSample) -> str | None:
        size = (len(sample.names),)
        velocity, effort = sample.velocity, sample.effort
        if (
            sample.position.shape != size
            or (velocity is not None and velocity.shape != size)
            or (effort is not None and effort.shape != size)
        ):
            return 'wrong_length'
        order = self._order(sample.names)
        if order is None:
            return 'unknown_joint'
        if self._config.filter_velocity == 'measured' and (
            velocity is None or np.isnan(velocity[order]).any()
        ):
            return 'nonfinite'
        # Joints that are not the robot's may hold anything; numbers throughout are the usual case.
        is_number = (
            (_are_numbers(sample.position) or _are_numbers(sample.position[order]))
            and (velocity is None or _are_numbers(velocity) or _may_count(velocity[order]))
            and (effort is None or _are_numbers(effort) or self._may_act(effort[order]))
        )
        return None if is_number else 'nonfinite'

    def _may_act(self, effort: np.ndarray) -> bool:
        return _may_count(effort[self._actuated])

    def _order(self, names: tuple[str, ...]) -> np.ndarray | None:
        """Return the places of the robot's joints among `names`, (k,); None where one is missing.

        Sources keep their order, so the last one is kept.
        """
        if names != self._last_order[0]:
            wanted = self._joints
            is_whole = set(wanted) <= set(names) and len(set(names)) == len(names)
            order = np.array([names.index(name) for name in wanted]) if is_whole else None
            self._last_order = names, order
        return self._last_order[1]

    def _takes(self, kind: str) -> bool:
        if self._commands_are == POSITION:
            return kind != EFFORT
        return kind == EFFORT or self._drives is not None

    def _command_problem(self, command: CommandSample) -> str | None:
        if command.names and not self._takes(command.kind):
            return 'wrong_kind'
        size = (len(command.names or self._command_joints),)
        if command.effort.shape != size or (
            command.velocity is not None and command.velocity.shape != size
        ):
            return 'wrong_length'
        if command.names and not set(command.names) & set(self._joints):
            return 'unknown_joint'
        is_number = _are_numbers(command.effort) and (
            command.velocity is None or _are_numbers(command.velocity)
        )
        return None if is_number else 'nonfinite'


def _chosen(values: np.ndarray | None, order: np.ndarray | None) -> np.ndarray | None:
    return None if values is None else values[order]


def _are_numbers(values: np.ndarray) -> bool:
    """Return whether all numbers (m,) are below `GREATEST`; mostly, their norm decides at once."""
    return math.hypot(*values.tolist()) < GREATEST or bool((np.abs(values) < GREATEST).all())


def _may_count(values: np.ndarray) -> bool:
    """Return whether all numbers are smaller than `GREATEST`, or missing (NaN)."""
    return not (np.abs(values) >= GREATEST).any()
