"""The accepted states and held commands of a whole recording.

The intake of the engine decides what is accepted. A whole recording can be sorted, so no sample is
late; where its clock was set back, what follows is taken as another recording.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.batch.continuity import braked, jumps, unwrapped
from sgp_ros.engine.clock import on_one_clock
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.intake import Intake, State
from sgp_ros.engine.ordering import in_order
from sgp_ros.engine.results import Counts
from sgp_ros.engine.samples import EFFORT, CommandSample, Event, JointSample
from sgp_ros.errors import RecordingError
from sgp_ros.robots.robot import Robot

USUAL = EngineConfig()
"""Settings of the intake where none are given: those of the engine."""
_COMMON_SHARE = 0.5
_BRAKED = '{} states with no effort of any drive, at rest: brakes may hold the robot; left out.'
_SHOWN_JUMPS = 5


@dataclass(frozen=True, slots=True, eq=False)
class HeldCommands:
    """c commands to the robot's k joints, each of which holds until the next one.

    Attributes:
        stamps_ns: (c,) int64, from which each holds, strictly increasing [ns].
        effort: (c, k) [unit of the commands]; targets of position and velocity are (c, 2 k).
    """

    stamps_ns: np.ndarray
    effort: np.ndarray

    def at(self, stamps_ns: np.ndarray) -> np.ndarray:
        """Return the commands in force, (n, k); before the first one that one."""
        index = np.searchsorted(self.stamps_ns, stamps_ns, side='right') - 1
        return np.asarray(self.effort[np.maximum(index, 0)])

    def averages(self, start_ns: int, step: float, n: int) -> tuple[np.ndarray, np.ndarray]:
        """Average the commands over a grid of n points, exactly for any times of change.

        Args:
            start_ns: stamp of the first point [ns].
            step: between two points [s].
            n: number of points.

        Returns:
            centred (n, k), averaged about each point with the hat that reaches one step to either
            side, and following (n, k), the mean from each point to the next. Before the first
            command the first one holds.
        """
        changes = (self.stamps_ns - start_ns) * 1e-9 / step  # in steps after the first point
        edges = np.arange(-1.0, n + 1.0)
        inside = changes[(changes > edges[0]) & (changes < edges[-1])]
        bounds = np.union1d(edges, inside)
        left, right = bounds[:-1], bounds[1:]
        cell = np.searchsorted(edges, left, side='right') - 1  # cell i ends at point i
        index = np.searchsorted(changes, left, side='right') - 1
        value = self.effort[np.maximum(index, 0)]  # (pieces, k)
        a, b = left - edges[cell], right - edges[cell]
        rising = 0.5 * (b * b - a * a)
        width = b - a
        mean = _sums(cell, width[:, None] * value, n + 1)
        before = _sums(cell, rising[:, None] * value, n + 1)
        after = mean - before
        return before[:n] + after[1:], mean[1:]


@dataclass(frozen=True, slots=True, eq=False)
class Accepted:
    """The m accepted states of a recording in the order of their stamps, and the commands.

    Attributes:
        stamps_ns: (m,) int64, strictly increasing [ns].
        position: (m, k) [rad or m].
        velocity: (m, k) [rad/s or m/s], NaN where a state has none; None where most have none.
        effort: (m, k) measured, NaN where the commands count.
        is_measured: (m,) whether the measured effort counts.
        commands: None without.
        counts: what was read, used and refused.
        start_ns: stamp of the first state that was read [ns].
    """

    stamps_ns: np.ndarray
    position: np.ndarray
    velocity: np.ndarray | None
    effort: np.ndarray
    is_measured: np.ndarray
    commands: HeldCommands | None
    counts: Counts
    start_ns: int

    def stretches(self, max_gap: float) -> list[np.ndarray]:
        """Return the rows of stretches of one source each, without pause or jump of positions.

        What brakes hold with all drives off is left out.

        Args:
            max_gap: longest time between two states without a pause [s].
        """
        ends = np.diff(self.stamps_ns) > max_gap * 1e9
        ends |= np.diff(self.is_measured)
        ends |= jumps(self.stamps_ns, self.position)
        held = self._braked
        ends |= np.diff(held)
        parts = np.split(np.arange(len(self.stamps_ns)), np.flatnonzero(ends) + 1)
        return [rows for rows in parts if not held[rows[0]]]

    @property
    def _braked(self) -> np.ndarray:
        return braked(self.stamps_ns, self.position, self.effort)

    def remarks(self, max_gap: float, start_ns: int) -> tuple[str, ...]:
        """Say that the clock was set back, what brakes hold, and where positions jump.

        Times count from `start_ns`.
        """
        said = []
        if times := self.counts.clock_jumps:
            said.append(f'The stamps go back: treated as {times + 1} recordings.')
        if held := int(self._braked.sum()):
            said.append(_BRAKED.format(held))
        found = jumps(self.stamps_ns, self.position)
        found &= np.diff(self.stamps_ns) <= max_gap * 1e9
        places = 1e-9 * (self.stamps_ns[1:][found] - start_ns)
        if len(places):
            more = len(places) - _SHOWN_JUMPS
            shown = ', '.join(f'{t:.6g}' for t in places[:_SHOWN_JUMPS])
            shown += f' and {more} more' if more > 0 else ''
            said.append(
                f'Positions jump at t = {shown} s: treated as {len(places) + 1} recordings.'
            )
        return tuple(said)

    def unwrapped(self, robot: Robot) -> Accepted:
        """Return the states with the turns of the robot's joints without limits counted on."""
        turning = [
            j for j, joint in enumerate(robot.joints)
            if joint.kind == 'revolute' and not np.isfinite([joint.lower, joint.upper]).any()
        ]  # fmt: skip
        position = self.position.copy()
        position[:, turning] = unwrapped(self.stamps_ns, self.position[:, turning])
        return replace(self, position=position)


def accept(
    events: Iterable[Event],
    robot: Robot,
    config: EngineConfig = USUAL,
    commands_are: str = EFFORT,
) -> Accepted:
    """Return what the intake of the engine accepts of a recording.

    Args:
        events: in the order in which they came; that of a few seconds does not matter.
        robot: whose joints are taken, in its order.
        config: settings of the intake.
        commands_are: what commands ask for, see `Intake`.

    Raises:
        RecordingError: no state is accepted.
    """
    counts = Counts()
    intake = Intake(robot, config, counts, commands_are)
    states: list[State] = []
    events = list(events)
    require_joints(events, robot)
    admitted = [event for event in events if intake.admit(event)]
    admitted, wrong, counts.clock_jumps = on_one_clock(admitted, config)
    for event in wrong:
        intake.refuse(event, 'clock')
    for event in in_order(admitted):
        if isinstance(event, CommandSample):
            intake.take_command(event)
        elif isinstance(event, JointSample):
            state = intake.take_state(event)
            states += [] if state is None else [state]
    if not states:
        raise _none_accepted(robot, config, counts, commands_are, admitted)
    known = admitted if counts.clock_jumps else events
    start_ns = min(event.stamp_ns for event in known if isinstance(event, JointSample))
    return _table(states, intake, counts, start_ns)


def _table(states: list[State], intake: Intake, counts: Counts, start_ns: int) -> Accepted:
    missing = np.full(states[0].position.shape, np.nan)
    velocity = np.array([missing if s.velocity is None else s.velocity for s in states])
    has_velocity = np.mean([s.velocity is not None for s in states]) > _COMMON_SHARE
    held = intake.commands
    return Accepted(
        np.array([s.stamp_ns for s in states], dtype=np.int64),
        np.array([s.position for s in states]),
        velocity if has_velocity else None,
        np.array([missing if s.effort is None else s.effort for s in states]),
        np.array([s.effort is not None for s in states]),
        HeldCommands(np.array(held.stamps_ns, dtype=np.int64), np.array(held.efforts))
        if held.stamps_ns
        else None,
        counts,
        start_ns,
    )


def _none_accepted(
    robot: Robot, config: EngineConfig, counts: Counts, commands_are: str,
    events: Iterable[object],
) -> RecordingError:  # fmt: skip
    if counts.commands_refused['wrong_kind']:
        kind = 'efforts' if commands_are == EFFORT else 'positions'
        return RecordingError(
            f'no state has an effort: the commands are not {kind}', kind,
            'give the gains of the drives with --gains gains.yaml' if commands_are == EFFORT
            else 'omit --gains',
        )  # fmt: skip
    if counts.refused['unpaired']:
        silent = _without_effort(robot, events)
        some = 'has an effort' if len(silent) == len(robot.joint_names) else (
            f'has an effort of {", ".join(silent)}'
        )  # fmt: skip
        return RecordingError(
            f'none of {counts.read} states {some}, effort source {config.effort_source!r}',
            'an effort of each motor in the states, or commands before them',
            'name the command topic with --command, or choose another --effort; for joints '
            'without a motor give a robot YAML in place of the URDF: '
            f'{{schema: 1, urdf: robot.urdf, passive: [{", ".join(silent)}]}}',
        )
    reasons = [f'{count} {reason}' for reason, count in counts.refused.items() if count]
    return RecordingError(
        f'no usable states for robot {robot.name}: {", ".join(reasons or ["there is none"])}',
        f'states of the joints {list(robot.joint_names)}',
        'check the refused states, or use another recording',
    )


def _without_effort(robot: Robot, events: Iterable[object]) -> list[str]:
    """Return the joints with a motor of which no state has a finite effort."""
    known = {
        name
        for event in events
        if isinstance(event, JointSample) and event.effort is not None
        for name, effort in zip(event.names, event.effort, strict=False)
        if np.isfinite(effort)
    }
    return [j.name for j in robot.joints if j.is_actuated and j.name not in known]


def require_joints(
    events: Iterable[Event], robot: Robot, recording: str = 'the recording'
) -> None:
    """Refuse states of other joints before anything else is said.

    Args:
        events: of a recording.
        robot: whose joints are taken.
        recording: its name.

    Raises:
        RecordingError: no message names all joints of the robot; it says which come nearest.
    """
    names = {event.names for event in events if isinstance(event, JointSample)}
    wanted = robot.joint_names
    if not names or any(set(wanted) <= set(seen) for seen in names):
        return
    shown = sorted({name for seen in names for name in seen})
    missing = [name for name in wanted if name not in shown]
    moving = [name for name in wanted if name in shown]
    if missing and moving:
        others = ', '.join(name for name in shown if name not in wanted)
        renamed = f'; if one of {others} is meant, rename it in the robot file' if others else ''
        raise RecordingError(
            f'{recording} lacks {", ".join(missing)} of {robot.name}',
            'states of all of its joints',
            'if the others do not move, leave them out: give --robot a robot YAML of three lines, '
            f'"schema: 1", "urdf: FILE", "joints: [{", ".join(moving)}]"{renamed}',
        )  # fmt: skip
    near = {name: difflib.get_close_matches(name, shown, 1, 0.0) for name in missing}
    pairs = ', '.join(f'{name} is closest to {found[0]}' for name, found in near.items())
    raise RecordingError(
        f'{recording} contains the joints {shown}'
        if missing
        else f'no message in {recording} contains all joints; found {shown}',
        f'states of the joints {list(wanted)} of {robot.name}' + (f' ({pairs})' if pairs else ''),
        'rename the joints in a robot file, or use the robot of this recording',
    )


def _sums(cell: np.ndarray, x: np.ndarray, cells: int) -> np.ndarray:
    """Add the rows of x (m, k) that fall into the same cell, (cells, k)."""
    columns = [np.bincount(cell, weights=column, minlength=cells) for column in x.T]
    return np.column_stack(columns)
