"""A recording as signals on one uniform grid of time.

Alignment: everything that stands in row i belongs to the time `time[i]`. Positions are joined by
a cubic spline, measured velocities and efforts by straight lines. (A monotone cubic would flatten
every extremum, which costs several tenths of a per cent of the acceleration.) A command holds
until the next one; its effort at a grid point is the exact average with the hat that reaches one
step to either side, sharpened, which is what the second derivative of the position does to the
acceleration (see `stencils.sharpened`). So no side of the equation of motion lags behind the
other.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import interpolate

from sgp_ros.batch.acceptance import Accepted, accept
from sgp_ros.batch.stencils import sharpened
from sgp_ros.engine.samples import Event
from sgp_ros.errors import RecordingError
from sgp_ros.robots.effect_terms import EffortMap
from sgp_ros.robots.robot import Robot

SHORTEST_SEGMENT = 16
"""Fewest states of a stretch that is used."""


@dataclass(frozen=True, slots=True, eq=False)
class Signals:
    """n rows of k joints on uniform grids, one grid per segment.

    Attributes:
        time: (n,) since `start_ns` [s].
        position: (n, k) [rad or m].
        velocity: (n, k) measured [rad/s or m/s]; None without.
        effort: (n, k) measured, or commanded as the module says; 0 for a passive joint.
        command: (n, k) mean of the held commands from each row's time to the next; None without.
        segments: stretches without gaps, as rows.
        refused: states by reason.
        commands_refused: commands by reason.
        rate: of the grid [Hz].
        start_ns: stamp of the first accepted state [ns].
    """

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray | None
    effort: np.ndarray
    command: np.ndarray | None
    segments: tuple[slice, ...]
    refused: dict[str, int]
    commands_refused: dict[str, int]
    rate: float
    start_ns: int


def collect_signals(
    events: Iterable[Event],
    robot: Robot,
    *,
    max_gap: float,
    effort_source: str = 'auto',
    command_timeout: float = 1.0,
    command_joints: Sequence[str] | None = None,
) -> Signals:
    """Bring the states and commands of a recording to a uniform grid at their median rate.

    Args:
        events: in any order.
        robot: whose joints are taken, in its order.
        max_gap: a longer pause between states ends a segment [s].
        effort_source: `state` for the measured effort, `command` for the held command, `auto` for
            the measured one where more than half of the states carry it.
        command_timeout: a command older than this pairs with no state [s].
        command_joints: joints of a command without names; None for the actuated joints.

    Raises:
        ConfigError: an effort source that does not exist.
        RecordingError: nothing usable is left.
    """
    accepted = accept(events, robot, effort_source, command_timeout, command_joints)
    gaps = np.flatnonzero(np.diff(accepted.stamps_ns) > max_gap * 1e9) + 1
    stretches = np.split(np.arange(len(accepted.stamps_ns)), gaps)
    used = [rows for rows in stretches if len(rows) >= SHORTEST_SEGMENT]
    accepted.refused['gap'] += sum(len(rows) for rows in stretches) - sum(map(len, used))
    if not used:
        raise RecordingError(
            f'{len(accepted.stamps_ns)} states, nowhere {SHORTEST_SEGMENT} of them without a pause'
            f' above {max_gap:g} s',
            'a recording without such pauses',
            'record longer, and more states per second',
        )
    steps = np.concatenate([np.diff(accepted.stamps_ns[rows]) for rows in used])
    step = 1e-9 * float(np.median(steps))
    parts = [_Part.of(accepted, rows, step) for rows in used]
    if robot.effort_map is not None:
        parts = [part.acting(robot.effort_map, is_measured=accepted.effort is not None)
                 for part in parts]  # fmt: skip
    ends = np.cumsum([len(part.time) for part in parts])
    starts = [0, *ends[:-1]]
    return Signals(
        np.concatenate([part.time for part in parts]),
        np.concatenate([part.position for part in parts]),
        _joined([part.velocity for part in parts]),
        np.concatenate([part.effort for part in parts]),
        _joined([part.command for part in parts]),
        tuple(slice(int(a), int(b)) for a, b in zip(starts, ends, strict=True)),
        accepted.refused,
        accepted.commands_refused,
        1.0 / step,
        int(accepted.stamps_ns[0]),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """The arrays of `Signals` for one segment."""

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray | None
    effort: np.ndarray
    command: np.ndarray | None

    @classmethod
    def of(cls, accepted: Accepted, rows: np.ndarray, step: float) -> _Part:
        stamps = accepted.stamps_ns[rows]
        known = (stamps - stamps[0]) * 1e-9
        n = int(known[-1] / step + 1e-6) + 1
        grid = np.minimum(np.arange(n) * step, known[-1])
        position = interpolate.CubicSpline(known, accepted.position[rows])(grid)
        velocity, effort, command = None, None, None
        if accepted.velocity is not None:
            velocity = _linear(grid, known, accepted.velocity[rows])
        if accepted.effort is not None:
            effort = _linear(grid, known, accepted.effort[rows])
        if accepted.commands is not None:
            centred, command = accepted.commands.averages(int(stamps[0]), step, n)
            effort = sharpened(centred) if effort is None else effort
        assert effort is not None
        start = (int(stamps[0]) - int(accepted.stamps_ns[0])) * 1e-9
        return cls(start + np.arange(n) * step, position, velocity, effort, command)

    def acting(self, effort_map: EffortMap, *, is_measured: bool) -> _Part:
        """Return the segment with the efforts that act in place of the recorded ones."""
        v = self.velocity
        if v is None:
            v = np.gradient(self.position, self.time, axis=0)
        command = self.command
        if command is not None:
            command = effort_map(command, v, is_measured=False)
        return replace(
            self, effort=effort_map(self.effort, v, is_measured=is_measured), command=command
        )


def _linear(grid: np.ndarray, known: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.column_stack([np.interp(grid, known, column) for column in values.T])


def _joined(parts: list[np.ndarray | None]) -> np.ndarray | None:
    arrays = [part for part in parts if part is not None]
    return np.concatenate(arrays) if arrays else None
