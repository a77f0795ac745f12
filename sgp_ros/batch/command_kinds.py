"""Kind of held commands as the motion shows it: efforts, or targets of position."""

from __future__ import annotations

from collections.abc import Iterable
from operator import itemgetter

import numpy as np

from sgp_ros.batch.acceptance import USUAL, Accepted, HeldCommands, accept
from sgp_ros.engine.samples import EFFORT, POSITION, VELOCITY, CommandSample, Event
from sgp_ros.errors import RecordingError
from sgp_ros.robots.gains import Gains
from sgp_ros.robots.robot import Robot

_COMMON_SHARE = 0.5
_LONGEST_LAG_S, _LAGS = 0.2, 41
_LEAST_EXPLAINED = 0.5
_GAINS = (0.25, 1.5)
"""Of a measured effort on an effort commanded: dead zone and saturation lower it."""

_NEAR_TARGET = 0.9
"""Share of a position on its target, where gains of a file say that there are targets."""
_UNIT, _NEAR, _MOST_EXPLAINED = (0.95, 1.05), 0.2, 0.995
"""Slope, distance of the means in standard deviations, and share of a position on its target."""


def hold_targets(events: Iterable[Event], robot: Robot) -> bool:
    """Return whether the commands of a recording are targets of position or velocity.

    The type of the messages says so. Numbers without names may be anything: these are targets
    where positions follow them, delayed by at most 0.2 s, nearer than they would by chance.
    """
    known = list(events)
    commands = [e for e in known if isinstance(e, CommandSample)]
    named = [c.kind for c in commands if c.names is not None]
    if named:
        return all(kind != EFFORT for kind in named)
    if not commands or len(commands[0].effort) != sum(j.is_actuated for j in robot.joints):
        return False
    return are_positions(accept(known, robot, USUAL, POSITION), robot, _NEAR_TARGET)


def require_gains_of_velocity(events: Iterable[Event], gains: Gains) -> None:
    """Refuse targets of velocity beside gains of a position, which they do not state.

    Raises:
        RecordingError: with what to write.
    """
    if gains.is_recorded:
        return
    kinds = {e.kind for e in events if isinstance(e, CommandSample) and e.names is not None}
    if VELOCITY in kinds and gains.kp.any():
        raise RecordingError(
            'the commands are velocity targets, but kp is not 0',
            'kp 0 and the velocity gain as kd', 'write both into the file given with --gains',
        )  # fmt: skip


def has_gains(events: Iterable[Event]) -> bool:
    """Return whether targets come with gains."""
    return any(isinstance(e, CommandSample) and e.gains is not None for e in events)


def with_recorded_gains(
    targets: HeldCommands, events: Iterable[Event], robot: Robot
) -> HeldCommands:
    """Return targets (c, 2 k) with the recorded gains behind them, (c', 4 k).

    Args:
        targets: of position and velocity.
        events: of the recording.
        robot: whose driven joints must have both gains.

    Raises:
        RecordingError: a recording without gains, or gains of other joints.
    """
    given = [e for e in events if isinstance(e, CommandSample) and e.gains is not None]
    driven = {j.name for j in robot.joints if j.is_actuated}
    names = {name for e in given for name in e.gains or ()}
    if not given or not driven <= names or any(set(e.gains or ()) != names for e in given):
        raise RecordingError(
            f'the targets come with gains of {sorted(names) or "no joint"}',
            f'kp and kd of each of {sorted(driven)} with each target',
            'give the gains of the drives with --gains gains.yaml',
        )  # fmt: skip
    given.sort(key=lambda e: e.stamp_ns)
    none = (0.0, 0.0)
    rows = np.array([[(e.gains or {}).get(j.name, none) for j in robot.joints] for e in given])
    stamps = np.array([e.stamp_ns for e in given], dtype=np.int64)
    stamps, last = np.unique(stamps[::-1], return_index=True)  # of equal stamps the last
    values = rows.transpose(0, 2, 1).reshape(len(given), -1)[len(given) - 1 - last]
    gains = HeldCommands(stamps, values)
    both = np.union1d(targets.stamps_ns, stamps)
    return HeldCommands(both, np.column_stack([targets.at(both), gains.at(both)]))


def are_efforts(accepted: Accepted, robot: Robot) -> bool:
    """Return whether the measured efforts follow the commands as a drive lets them follow.

    On most of the actuated joints a straight line on the command, delayed by at most 0.2 s, must
    explain half of the variance of the measured effort, with a slope of about one, and more than
    it explains of the variance of the position, which is what a commanded position would do.
    Delay, lag, dead zone and saturation of a drive leave that much.

    Args:
        accepted: with commands, and measured efforts in some states.
        robot: whose joints they are.
    """
    rows = np.flatnonzero(accepted.is_measured)
    assert accepted.commands is not None
    stamps, effort, position = (
        x[rows] for x in (accepted.stamps_ns, accepted.effort, accepted.position)
    )
    follows = []
    for j, joint in enumerate(robot.joints):
        u = _delayed(accepted.commands, j, stamps)
        if joint.is_actuated and (np.ptp(u) > 0.0 or np.ptp(effort[:, j]) > 0.0):
            explained, slope = best_line(u, effort[:, j])
            rival, _ = best_line(u, position[:, j])
            is_unit = _GAINS[0] <= slope <= _GAINS[1]
            follows.append(is_unit and explained > max(_LEAST_EXPLAINED, rival))
    return bool(follows) and float(np.mean(follows)) > _COMMON_SHARE


def are_positions(accepted: Accepted, robot: Robot, least_explained: float | None = None) -> bool:
    """Return whether the commands are targets of position: the positions themselves follow them.

    On most of the actuated joints the position is the delayed command, on a line of slope one
    through zero, which an effort is only by accident.

    Args:
        accepted: with commands.
        robot: whose joints they are.
        least_explained: share of the position on its target; None for what efforts never reach.
    """
    wanted = _MOST_EXPLAINED if least_explained is None else least_explained
    follows = [
        followed(accepted, j, j, wanted) for j, joint in enumerate(robot.joints)
        if joint.is_actuated and np.ptp(accepted.position[:, j]) > 0.0
    ]  # fmt: skip
    return bool(follows) and float(np.mean(follows)) > _COMMON_SHARE


def followed(accepted: Accepted, i: int, j: int, least: float = _NEAR_TARGET) -> bool:
    """Return whether the position of joint i is the target of joint j, delayed by at most 0.2 s.

    On a line of slope one through zero, which an effort is only by accident.

    Args:
        accepted: with commands.
        i: whose position is looked at.
        j: whose command.
        least: share of the position that is explained.
    """
    assert accepted.commands is not None
    stamps, q = accepted.stamps_ns, accepted.position[:, i]
    u = _delayed(accepted.commands, j, stamps)
    explained, slope = best_line(u, q)
    is_near = abs(float(u.mean() - q.mean())) < _NEAR * float(q.std())
    return _UNIT[0] <= slope <= _UNIT[1] and is_near and explained > least


def _delayed(commands: HeldCommands, j: int, stamps_ns: np.ndarray) -> np.ndarray:
    """Return the commands of joint j, delayed by up to 0.2 s, at some times (n,), (m, n)."""
    own = HeldCommands(commands.stamps_ns, commands.effort[:, [j]])
    delays = np.round(np.linspace(0.0, _LONGEST_LAG_S * 1e9, _LAGS)).astype(np.int64)
    return np.array([own.at(stamps_ns - delay)[:, 0] for delay in delays])


def best_line(u: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """Return the share of the variance of y (n,) that a line on a row of u (m, n) explains.

    The best row is taken, and its slope returned. Each row in turn, for u of a long recording is
    large.
    """
    dy = y - y.mean()
    power = float(dy @ dy)
    best = 0.0, 0.0
    for row in u:
        du = row - row.mean()
        square, product = float(du @ du), float(du @ dy)
        if square > 0.0 and power > 0.0:
            slope = product / square
            best = max(best, (slope * product / power, slope), key=itemgetter(0))
    return best
