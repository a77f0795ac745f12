"""The one intake of states and commands, which live, replay, identify and diagnose share.

It decides of every event whether it is used, and for which reason it is not. What follows from the
accepted states is not decided here: online they fill windows, offline whole stretches.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.results import Counts
from sgp_ros.engine.samples import EFFORT, POSITION, CommandSample, Event, JointSample
from sgp_ros.engine.weak_form import WeakForm
from sgp_ros.physics.drive import WindowDrive
from sgp_ros.robots.robot import Robot

_GREATEST = 1e150
"""From here on a number has no square, so nothing can be computed of it."""


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


class CommandHistory:
    """Zero-order hold over commands: each holds until the next one.

    Args:
        memory_s: how long a command matters after the next one [s].

    Attributes:
        stamps_ns: times at which commands began [ns], increasing.
        efforts: one (k,) per command.
    """

    def __init__(self, memory_s: float = 0.0) -> None:
        self._memory_ns = round(memory_s * 1e9)
        self.stamps_ns: list[int] = []
        self.efforts: list[np.ndarray] = []

    def add(self, stamp_ns: int, effort: np.ndarray) -> None:
        """Let `effort` (k,) hold from `stamp_ns` on, which is not before the last one."""
        if self.stamps_ns and self.stamps_ns[-1] == stamp_ns:
            self.efforts[-1] = effort
            return
        self.stamps_ns.append(stamp_ns)
        self.efforts.append(effort)

    def age_ns(self, stamp_ns: int) -> int | None:
        """Return how old the command in force at `stamp_ns` is [ns]; None without one."""
        index = bisect_right(self.stamps_ns, stamp_ns)
        return None if index == 0 else stamp_ns - self.stamps_ns[index - 1]

    def average(
        self,
        first_ns: int,
        last_ns: int,
        cumulative: Callable[[np.ndarray], np.ndarray],
        acting: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None,
    ) -> np.ndarray:
        """Integrate the held commands against a kernel, exactly.

        Args:
            first_ns: start of the kernel's support, where a command is in force [ns].
            last_ns: its end [ns].
            cumulative: integral of the kernel from `first_ns` to times given in seconds after it.
            acting: from held commands (pieces, k) and the middles of their times (pieces,) [s
                after `first_ns`] to what acts; None for the commands themselves.

        Returns:
            (k,) [unit of the commands].
        """
        start = bisect_right(self.stamps_ns, first_ns) - 1
        stop = bisect_right(self.stamps_ns, last_ns)
        changes = [first_ns, *self.stamps_ns[start + 1 : stop], last_ns]
        seconds = np.array([stamp - first_ns for stamp in changes]) * 1e-9
        shares = np.diff(cumulative(seconds))  # (pieces,)
        held = np.array(self.efforts[start:stop])  # (pieces, k)
        if acting is not None:
            held = acting(held, 0.5 * (seconds[1:] + seconds[:-1]))
        return shares @ held

    def drive(self, first_ns: int, form: WeakForm) -> WindowDrive:
        """Return the commands as drives receive them, for the window that begins at `first_ns`."""
        offsets = [stamp - first_ns for stamp in self.stamps_ns]
        samples = form.times - form.times[0]
        return WindowDrive(
            np.array(offsets) * 1e-9, np.array(self.efforts), samples, form.left, form.right
        )

    def forget_before(self, stamp_ns: int) -> None:
        """Drop commands that do not matter any more from `stamp_ns` on."""
        keep = max(bisect_right(self.stamps_ns, stamp_ns - self._memory_ns) - 1, 0)
        del self.stamps_ns[:keep]
        del self.efforts[:keep]


class Intake:
    """Checks events, pairs states with efforts, counts what it refuses.

    `admit` takes events as they arrive, `take_command` and `take_state` take the admitted ones in
    the order of their stamps. With `effort.source: auto` commands count until the first state
    that carries a measured effort; from there on a state without one is refused as unpaired.

    Args:
        robot: whose joints are taken, in its order.
        config: settings of the intake.
        counts: where reads and refusals are counted.
        commands_are: what commands ask for, `EFFORT` or `POSITION`; with the latter targets of
            position and velocity, (2 k,), are held instead of efforts.

    Attributes:
        commands: those taken.
        last_state_ns: stamp of the last state that was not a duplicate [ns]; None before.
        is_measured: whether a state with a measured effort has been accepted.
    """

    def __init__(
        self, robot: Robot, config: EngineConfig, counts: Counts, commands_are: str = EFFORT
    ) -> None:
        self._robot = robot
        self._commands_are = commands_are
        self._counts = counts
        self._actuated = np.array([joint.is_actuated for joint in robot.joints])
        self._gains = np.array([joint.effort_gain for joint in robot.joints])
        self._last_order: tuple[tuple[str, ...], np.ndarray | None] = ((), None)
        self.commands = CommandHistory(robot.effort_map.memory_s if robot.effort_map else 0.0)
        self.last_state_ns: int | None = None
        self.is_measured = False
        self.configure(config)

    def configure(self, config: EngineConfig) -> None:
        """Take new settings, in force from the next event on."""
        self._config = config
        order = config.command_joints
        self._command_joints = tuple(
            joint.name for joint in self._robot.joints if joint.is_actuated
        ) if order == ('',) else order  # fmt: skip

    def admit(self, event: Event) -> bool:
        """Count an event that arrives; refuse what no order can mend.

        Returns:
            Whether joints, numbers and lengths are as they should be.
        """
        if isinstance(event, JointSample):
            self._counts.read += 1
            reason = self._state_problem(event)
            refused = self._counts.refused
        elif isinstance(event, CommandSample):
            self._counts.commands_read += 1
            reason = self._command_problem(event)
            refused = self._counts.commands_refused
        else:
            return True
        if reason:
            refused[reason] += 1
        return reason is None

    def refuse_late(self, event: Event) -> None:
        """Count an event that came after a later one had been taken."""
        if isinstance(event, JointSample):
            self._counts.refused['late'] += 1
        elif isinstance(event, CommandSample):
            self._counts.commands_refused['late'] += 1

    def take_command(self, command: CommandSample) -> None:
        """Let a command hold from its stamp on; joints it leaves out keep theirs."""
        names = command.names or self._command_joints
        held, k = self.commands.efforts, len(self._robot.joints)
        is_target = self._commands_are == POSITION
        effort = held[-1].copy() if held else np.zeros(2 * k if is_target else k)
        for i, name in enumerate(names):
            if name not in self._robot.joint_names:
                continue
            joint = self._robot.joint_names.index(name)
            if is_target:
                effort[joint] = command.effort[i]
                effort[k + joint] = 0.0 if command.velocity is None else command.velocity[i]
            else:
                effort[joint] = command.effort[i] * self._gains[joint]
        self.commands.add(command.stamp_ns, effort)

    def take_state(self, sample: JointSample) -> State | None:
        """Return a state in the robot's order; None where it is refused, for one reason."""
        last = self.last_state_ns
        if sample.stamp_ns == last:
            self._counts.refused['duplicate'] += 1
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
        if velocity is not None and not np.isfinite(velocity).all():
            velocity = None
        self._counts.used += 1
        return State(sample.stamp_ns, sample.position[order], velocity, effort)

    def _effort(
        self, sample: JointSample, order: np.ndarray | None
    ) -> tuple[bool, np.ndarray | None]:
        """Return whether an effort belongs to a state, and the measured one where it counts."""
        if not self._actuated.any():
            return True, np.zeros(len(self._actuated))
        source = self._config.effort_source
        effort = None if source == 'command' else _chosen(sample.effort, order)
        if effort is not None and np.isfinite(effort[self._actuated]).all():
            self.is_measured = True
            return True, np.where(self._actuated, effort * self._gains, 0.0)
        if source == 'state' or (source == 'auto' and self.is_measured):
            return False, None
        age = self.commands.age_ns(sample.stamp_ns)
        return age is not None and age <= self._config.command_timeout * 1e9, None

    def _state_problem(self, sample: JointSample) -> str | None:
        order = self._order(sample.names)
        if order is None:
            return 'unknown_joint'
        if not _is_usable(sample.position[order]).all():
            return 'nonfinite'
        velocity, effort = _chosen(sample.velocity, order), _chosen(sample.effort, order)
        if velocity is not None and not (np.isnan(velocity) | _is_usable(velocity)).all():
            return 'nonfinite'
        if effort is not None:
            own = effort[self._actuated]
            if not (np.isnan(own) | _is_usable(own)).all():
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
        if command.names is not None and command.kind != self._commands_are:
            return 'wrong_kind'
        if len(command.effort) != len(command.names or self._command_joints):
            return 'wrong_length'
        if command.names and not set(command.names) & set(self._robot.joint_names):
            return 'unknown_joint'
        if not _is_usable(command.effort).all():
            return 'nonfinite'
        return None


def _chosen(values: np.ndarray | None, order: np.ndarray | None) -> np.ndarray | None:
    return None if values is None else values[order]


def _is_usable(values: np.ndarray) -> np.ndarray:
    """Return which numbers are finite and have a square, (n,) of bool."""
    return np.abs(values) < _GREATEST
