"""Decides of every state and command of a recording whether it is used, and why not.

The reasons are those of the online engine. A whole recording can be sorted, so no sample is late.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from sgp_ros.batch.held_commands import HeldCommands
from sgp_ros.engine.samples import CommandSample, Event, JointSample
from sgp_ros.errors import ConfigError, RecordingError
from sgp_ros.robots.robot import Robot

EFFORT_SOURCES = ('auto', 'state', 'command')
_REASONS = ('late', 'duplicate', 'nonfinite', 'unpaired', 'unknown_joint', 'gap')
_COMMAND_REASONS = ('wrong_length', 'unknown_joint', 'nonfinite')
_COMMON_SHARE = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Accepted:
    """The m accepted states of a recording in the order of their stamps, and the commands.

    Attributes:
        stamps_ns: (m,) int64, strictly increasing [ns].
        position: (m, k) [rad or m].
        velocity: (m, k) [rad/s or m/s]; None where most states have none.
        effort: (m, k) measured; None where the commands count.
        commands: None without.
        refused, commands_refused: by reason.
    """

    stamps_ns: np.ndarray
    position: np.ndarray
    velocity: np.ndarray | None
    effort: np.ndarray | None
    commands: HeldCommands | None
    refused: dict[str, int]
    commands_refused: dict[str, int]


def accept(
    events: Iterable[Event],
    robot: Robot,
    effort_source: str,
    command_timeout: float,
    command_joints: Sequence[str] | None,
) -> Accepted:
    """Sort, check and pair the events of a recording; arguments as for `collect_signals`."""
    if effort_source not in EFFORT_SOURCES:
        raise ConfigError(f'effort source {effort_source!r}', f'one of {list(EFFORT_SOURCES)}')
    states, commands = _Table(robot), _CommandTable(robot, command_joints)
    for event in events:
        if isinstance(event, JointSample):
            states.add(event)
        elif isinstance(event, CommandSample):
            commands.add(event)
    if not states.stamps_ns:
        raise RecordingError(
            f'no usable state of robot {robot.name}: {states.why_refused()}',
            f'states of the joints {list(robot.joint_names)}',
            'name the joints in a robot file, or take the robot of this recording',
        )
    return _paired(states, commands.held(), commands.refused, effort_source, command_timeout)


class _Table:
    """Rows of states in the robot's order, NaN for what a state lacks."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.refused = dict.fromkeys(_REASONS, 0)
        self.stamps_ns: list[int] = []
        self.rows: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        self._orders: dict[tuple[str, ...], list[int] | None] = {}
        self._missing = np.full(len(robot.joints), np.nan)
        self._gains = np.array([joint.effort_gain for joint in robot.joints])

    def add(self, sample: JointSample) -> None:
        order = self._order(sample.names)
        if order is None:
            self.refused['unknown_joint'] += 1
            return
        position = sample.position[order]
        velocity = self._missing if sample.velocity is None else sample.velocity[order]
        effort = self._missing if sample.effort is None else sample.effort[order] * self._gains
        bad = np.isinf(velocity).any() or np.isinf(effort[self.actuated]).any()
        if bad or not np.isfinite(position).all():
            self.refused['nonfinite'] += 1
            return
        self.stamps_ns.append(sample.stamp_ns)
        self.rows.append((position, velocity, effort))

    def why_refused(self) -> str:
        reasons = [f'{count} {reason}' for reason, count in self.refused.items() if count]
        strangers = [list(names) for names, order in self._orders.items() if order is None]
        return ', '.join(reasons or ['there is none']) + (
            f', the joints are {strangers[0]}' if strangers else ''
        )

    @property
    def actuated(self) -> list[int]:
        return [j for j, joint in enumerate(self.robot.joints) if joint.is_actuated]

    def _order(self, names: tuple[str, ...]) -> list[int] | None:
        if names not in self._orders:
            known = all(name in names for name in self.robot.joint_names)
            order = [names.index(name) for name in self.robot.joint_names] if known else None
            self._orders[names] = order
        return self._orders[names]


class _CommandTable:
    """Commands in the robot's order; joints that a command leaves out keep theirs."""

    def __init__(self, robot: Robot, joints: Sequence[str] | None) -> None:
        self._robot = robot
        usual = [joint.name for joint in robot.joints if joint.is_actuated]
        self._joints = tuple(usual if joints is None else joints)
        self.refused = dict.fromkeys(_COMMAND_REASONS, 0)
        self._commands: list[CommandSample] = []

    def add(self, command: CommandSample) -> None:
        reason = self._problem(command)
        if reason:
            self.refused[reason] += 1
        else:
            self._commands.append(command)

    def held(self) -> HeldCommands | None:
        effort = np.zeros(len(self._robot.joints))
        latest: dict[int, np.ndarray] = {}
        for command in sorted(self._commands, key=lambda c: c.stamp_ns):
            effort = effort.copy()
            for name, value in zip(command.names or self._joints, command.effort, strict=True):
                if name in self._robot.joint_names:
                    joint = self._robot.joint_names.index(name)
                    effort[joint] = value * self._robot.joints[joint].effort_gain
            latest[command.stamp_ns] = effort
        if not latest:
            return None
        return HeldCommands(np.array(list(latest), dtype=np.int64), np.array([*latest.values()]))

    def _problem(self, command: CommandSample) -> str | None:
        names = command.names or self._joints
        if len(command.effort) != len(names):
            return 'wrong_length'
        if not set(names) & set(self._robot.joint_names):
            return 'unknown_joint'
        return None if np.isfinite(command.effort).all() else 'nonfinite'


def _paired(
    states: _Table,
    commands: HeldCommands | None,
    commands_refused: dict[str, int],
    source: str,
    timeout: float,
) -> Accepted:
    stamps = np.array(states.stamps_ns, dtype=np.int64)
    order = np.argsort(stamps, kind='stable')
    first = np.concatenate([[True], np.diff(stamps[order]) > 0])
    states.refused['duplicate'] += int((~first).sum())
    rows = order[first]
    stamps = stamps[rows]
    position, velocity, effort = (np.array(x)[rows] for x in zip(*states.rows, strict=True))
    has_velocity = np.isfinite(velocity).all(axis=1)
    keep = np.ones(len(stamps), dtype=bool)
    uses_velocity = bool(has_velocity.mean() > _COMMON_SHARE)
    if uses_velocity:
        keep &= has_velocity
        states.refused['nonfinite'] += int((~keep).sum())
    has_effort = np.isfinite(effort[:, states.actuated]).all(axis=1)
    measured = source == 'state' or (source == 'auto' and has_effort.mean() > _COMMON_SHARE)
    if states.actuated:
        pairs = has_effort if measured else _in_force(commands, stamps, timeout)
        states.refused['unpaired'] += int((keep & ~pairs).sum())
        keep &= pairs
    if not keep.any():
        raise RecordingError(
            f'no state with an effort among {len(keep)}, effort source {source!r}',
            'an effort in the states, or commands before them',
            'give the topic of the commands with --command, or another --effort',
        )
    passive = [j for j in range(position.shape[1]) if j not in states.actuated]
    effort[:, passive] = 0.0
    return Accepted(
        stamps[keep],
        position[keep],
        velocity[keep] if uses_velocity else None,
        effort[keep] if measured or not states.actuated else None,
        commands,
        states.refused,
        commands_refused,
    )


def _in_force(commands: HeldCommands | None, stamps: np.ndarray, timeout: float) -> np.ndarray:
    if commands is None:
        return np.zeros(len(stamps), dtype=bool)
    return commands.age(stamps) <= timeout
