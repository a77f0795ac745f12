"""A recording as signals on one uniform grid of time.

Alignment: everything that stands in row i belongs to the time `time[i]`. Positions are joined by
a cubic spline, measured velocities and efforts by straight lines. (A monotone cubic would flatten
every extremum, which costs several tenths of a per cent of the acceleration.) A command holds
until the next one; its effort at a grid point is the exact average with the hat that reaches one
step to either side, sharpened, which is what the second derivative of the position does to the
acceleration (see `zero_phase.sharpened`). So no side of the equation of motion lags behind the
other.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import scipy  # its parts load when they are used

from sgp_ros.batch.acceptance import USUAL, Accepted, accept
from sgp_ros.batch.zero_phase import sharpened
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.samples import Event
from sgp_ros.errors import RecordingError
from sgp_ros.physics.drive import Drive
from sgp_ros.robots.robot import ActingEffort, Robot

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
        segments: stretches without gaps or jumps of positions, as rows.
        refused: states by reason.
        commands_refused: commands by reason.
        rate: of the grid [Hz].
        start_ns: stamp of the first accepted state [ns].
        left_out: accepted states of stretches too short to be filtered.
        remarks: where the positions jump.
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
    left_out: int = 0
    remarks: tuple[str, ...] = ()


def collect_signals(
    events: Iterable[Event], robot: Robot, config: EngineConfig = USUAL
) -> Signals:
    """Bring the states and commands of a recording to a uniform grid at their median rate.

    Args:
        events: in the order in which they came, see `accept`.
        robot: whose joints are taken, in its order.
        config: settings of the intake; `max_gap` ends a segment too.

    Raises:
        RecordingError: nothing usable is left.
    """
    accepted = accept(events, robot, config).unwrapped(robot)
    stretches = accepted.stretches(config.max_gap)
    used = [rows for rows in stretches if len(rows) >= SHORTEST_SEGMENT]
    if not used:
        raise RecordingError(
            f'{len(accepted.stamps_ns)} states, nowhere {SHORTEST_SEGMENT} of them without a pause'
            f' above {config.max_gap:g} s',
            'a recording with fewer pauses',
            'record longer, and more states per second',
        )
    steps = np.concatenate([np.diff(accepted.stamps_ns[rows]) for rows in used])
    step = 1e-9 * float(np.median(steps))
    parts = [_Part.of(accepted, rows, step) for rows in used]
    if robot.effort_map is not None:
        parts = [
            part.acting(robot.effort_map, accepted, rows, step)
            for part, rows in zip(parts, used, strict=True)
        ]
    ends = np.cumsum([len(part.time) for part in parts])
    starts = [0, *ends[:-1]]
    return Signals(
        np.concatenate([part.time for part in parts]),
        np.concatenate([part.position for part in parts]),
        _joined([part.velocity for part in parts]),
        np.concatenate([part.effort for part in parts]),
        _joined([part.command for part in parts]),
        tuple(slice(int(a), int(b)) for a, b in zip(starts, ends, strict=True)),
        accepted.counts.refused,
        accepted.counts.commands_refused,
        1.0 / step,
        int(accepted.stamps_ns[0]),
        sum(map(len, stretches)) - sum(map(len, used)),
        accepted.remarks(config.max_gap, int(accepted.stamps_ns[0])),
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
        path = scipy.interpolate.CubicSpline(known, accepted.position[rows])
        velocity, effort, command = None, None, None
        if accepted.velocity is not None:
            velocity = _velocity(grid, known, accepted.velocity[rows], path)
        if accepted.is_measured[rows[0]]:
            effort = _linear(grid, known, accepted.effort[rows])
        if accepted.commands is not None:
            centred, command = accepted.commands.averages(int(stamps[0]), step, n)
            effort = sharpened(centred) if effort is None else effort
        assert effort is not None
        start = (int(stamps[0]) - int(accepted.stamps_ns[0])) * 1e-9
        return cls(start + np.arange(n) * step, path(grid), velocity, effort, command)

    def acting(
        self, effort_map: ActingEffort, accepted: Accepted, rows: np.ndarray, step: float
    ) -> _Part:
        """Return the segment with the efforts that act in place of the recorded ones."""
        is_measured = bool(accepted.is_measured[rows[0]])
        v = self.velocity
        if v is None:
            v = np.gradient(self.position, self.time, axis=0)
        effort, command = effort_map(self.effort, v, is_measured=is_measured), self.command
        if command is not None:
            assert accepted.commands is not None
            times = (accepted.commands.stamps_ns - accepted.stamps_ns[rows[0]]) * 1e-9
            grid = ((0.0, len(v)),)
            late = effort_map.late_effort(Drive(times, accepted.commands.effort, grid, step))
            effort = effort if is_measured else effort + late
            following = np.concatenate([0.5 * (late[1:] + late[:-1]), late[-1:]])
            command = effort_map(command, v, is_measured=False) + following
        return replace(self, effort=effort, command=command)


def _velocity(
    grid: np.ndarray, known: np.ndarray, measured: np.ndarray, path: scipy.interpolate.CubicSpline
) -> np.ndarray:
    """Return the velocity on a grid; states without one are passed over."""
    has = np.isfinite(measured).all(axis=1)
    if not has.any():
        return np.asarray(path(grid, 1))
    return _linear(grid, known[has], measured[has])


def _linear(grid: np.ndarray, known: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.column_stack([np.interp(grid, known, column) for column in values.T])


def _joined(parts: list[np.ndarray | None]) -> np.ndarray | None:
    arrays = [part for part in parts if part is not None]
    return np.concatenate(arrays) if arrays else None
