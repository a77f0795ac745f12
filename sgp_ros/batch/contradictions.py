"""Contradictions of a recording with its robot or within its own numbers: units and targets.

Only numbers that no robot can have are refused. What a diagnosis can name, such as a recording in
degrees or a drive in saturation, is said and goes on.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from sgp_ros.batch.acceptance import USUAL, accept
from sgp_ros.batch.command_kinds import best_line, followed
from sgp_ros.engine.samples import POSITION, CommandSample, Event, JointSample
from sgp_ros.errors import RecordingError
from sgp_ros.physics.term import Joint
from sgp_ros.robots.gains import Gains
from sgp_ros.robots.robot import Robot

_TURNING = (('degrees', 180.0 / math.pi), ('turns', 0.5 / math.pi))
_SLIDING = (('millimetres', 1e3),)
_EFFORTS = {
    'revolute': (('kgf cm', 100.0 / 9.80665), ('N cm', 100.0), ('N mm', 1e3)),
    'prismatic': (('kgf', 1.0 / 9.80665), ('mN', 1e3)),
}
_RATES = {'revolute': (*_TURNING, ('rpm', 30.0 / math.pi)), 'prismatic': _SLIDING}
"""Names of units and their numbers per SI unit."""
_FARTHEST = {'revolute': 1e5, 'prismatic': 1e4}
"""Range of positions beyond which they are hardly SI: 16 000 turns, 10 km [rad or m]."""
_OUTSIDE = 0.5
"""Ranges beyond the limits from which on positions are in another unit: stops give way by less."""
_BEYOND = 5.0
"""Times the limit of the effort from which on efforts are: the nearest unit is ten times off."""
_NEAR = 1.4
"""Factor within which a slope is that of a unit: filters and noise of velocities make less."""
_FOLLOWS = 0.5
"""Share of a velocity or position from which on it is explained by another signal."""
_MISSED = 0.01
"""Share of the range of a target by which a joint that never reaches it misses it."""
_FEW = 10
"""Rows below which no slope is taken."""
_SHORT = 0.5
"""Share of the range of a target below which a joint falls short of it."""


def unit_contradictions(
    states: Sequence[JointSample], joint: Joint, ends: tuple[float, float], most_effort: float
) -> tuple[list[str], list[str]]:
    """Return which numbers of a joint are in a wrong unit, and which may be.

    Args:
        states: of the recording.
        joint: with its limits.
        ends: least and greatest recorded position.
        most_effort: the largest effort without sign, [N m or N] if it is in SI.
    """
    sure: list[str] = []
    open_ones: list[str] = []
    unit = _unit_of_positions(joint, *ends)
    if unit:
        sure.append(
            f'the positions of {joint.name} go from {ends[0]:.3g} to {ends[1]:.3g}, but its '
            f'limits are {joint.lower:.3g} to {joint.upper:.3g} {joint.unit("position")}: '
            f'they would fit in {unit}'
        )
    elif not (span := ends[1] - ends[0]) < _FARTHEST[joint.kind]:
        said = f'the positions of {joint.name} span {span:.3g} {joint.unit("position")}'
        open_ones.append(f'{said}: counts or {_RATES[joint.kind][0][0]}?')
    slope = _slope_of_velocity(states, joint.name)
    if not 1.0 / _NEAR < slope < _NEAR:
        said = f'the velocity of {joint.name} is {slope:.3g} times the slope of its position'
        units = [
            name for name, per in _RATES[joint.kind]
            if 1.0 / _NEAR < slope / per < _NEAR or 1.0 / _NEAR < slope * per < _NEAR
        ]  # fmt: skip
        said += f': one of the two is in {units[0]}' if units else ''
        (sure if units else open_ones).append(said)
    unit = _unit_of_efforts(joint, most_effort)
    if unit:
        open_ones.append(
            f'the effort of {joint.name} reaches {most_effort:.3g}, but its limit is '
            f'{joint.effort_limit:.3g} {joint.unit("effort")}: it would fit in {unit}'
        )
    return sure, open_ones


def require_units(events: Iterable[Event], robot: Robot) -> None:
    """Refuse positions and velocities in other units than those that were stated.

    Args:
        events: of a table.
        robot: whose joints they are.

    Raises:
        RecordingError: with the joints.
    """
    states = [e for e in events if isinstance(e, JointSample)]
    wrong: list[str] = []
    for joint in robot.joints:
        own = [s.position[s.names.index(joint.name)] for s in states if joint.name in s.names]
        if own:
            ends = float(np.nanmin(own)), float(np.nanmax(own))
            wrong += unit_contradictions(states, joint, ends, 0.0)[0]
    if wrong:
        raise RecordingError(
            '; '.join(wrong), 'the units stated by the map or by the column names',
            'state unit or gear ratio (`scale`) in a map, or omit --robot if its limits are wrong',
        )  # fmt: skip


def _unit_of_positions(joint: Joint, lower: float, upper: float) -> str:
    """Return the unit in which positions lie within the limits; empty if they may be SI."""
    width = joint.upper - joint.lower
    if not (math.isfinite(width) and width > 0.0):
        return ''
    low, high = joint.lower - _OUTSIDE * width, joint.upper + _OUTSIDE * width
    if low <= lower and upper <= high:
        return ''
    units = _SLIDING if joint.kind == 'prismatic' else _TURNING
    fitting = [u for u, per in units if low <= lower / per and upper / per <= high]
    return fitting[0] if fitting else ''


def _unit_of_efforts(joint: Joint, largest: float) -> str:
    """Return the unit in which efforts stay within the limit; empty if they may be SI."""
    limit = joint.effort_limit
    if joint.effort_unit or not (math.isfinite(limit) and limit > 0.0):
        return ''
    if largest <= _BEYOND * limit:
        return ''
    fitting = [u for u, per in _EFFORTS[joint.kind] if largest / per <= limit]
    return fitting[0] if fitting else ''


def _slope_of_velocity(states: Sequence[JointSample], name: str) -> float:
    """Return the velocity over the slope of the position; 1 where that tells nothing.

    Noise of the position lowers the slope of a line on it, noise of the velocity that of its
    inverse: the truth lies between the two, and the end nearer to 1 is returned.
    """
    rows = [
        (s.stamp_ns, s.position[s.names.index(name)], s.velocity[s.names.index(name)])
        for s in states
        if name in s.names and s.velocity is not None
    ]
    if len(rows) < _FEW:
        return 1.0
    stamps, q, v = (np.array(x) for x in zip(*rows, strict=True))
    step = np.diff(stamps.astype(np.int64)).astype(np.float64) * 1e-9
    mean = 0.5 * (v[1:] + v[:-1])
    good = (step > 0.0) & np.isfinite(np.diff(q)) & np.isfinite(mean)
    if good.sum() < _FEW:
        return 1.0
    rate = np.diff(q)[good] / step[good]
    explained, slope = best_line(rate[None], mean[good])
    if explained < _FOLLOWS or slope <= 0.0:
        return 1.0
    return float(np.clip(1.0, slope, slope / explained))


def target_contradictions(
    events: Sequence[Event], robot: Robot, gains: Gains | None
) -> tuple[list[str], list[str]]:
    """Return oddities of the position targets, and errors that rule out a diagnosis.

    Args:
        events: of a recording whose commands are targets of position.
        robot: whose joints they are.
        gains: of its drives; None where they are not known.
    """
    accepted = accept(events, robot, USUAL, POSITION)
    k = len(robot.joints)
    if accepted.commands is None:
        return [], []
    target, q = accepted.commands.at(accepted.stamps_ns)[:, :k], accepted.position
    own = [best_line(target[:, j][None], q[:, j])[0] for j in range(k)]
    said, wrong = [], []
    for j, joint in enumerate(robot.joints):
        wide, moved = float(np.ptp(target[:, j])), float(np.ptp(q[:, j]))
        if not joint.is_actuated or not wide > 0.0:
            continue
        is_followed = own[j] >= _FOLLOWS
        others = [i for i in range(k) if not is_followed and i != j and followed(accepted, i, j)]
        if others:
            wrong.append(f'the target of {joint.name} is followed by '
                         f'{robot.joints[others[0]].name} and not by {joint.name}')  # fmt: skip
            continue
        unit = _unit_of_target(joint, target[:, j], q[:, j])
        if unit:
            wrong.append(f'the target of {joint.name} is in {unit}, its position is not')
            continue
        away = target[:, j] - q[:, j]
        nearest = float(np.abs(away).min())
        if nearest > _MISSED * wide and (away > 0.0).all() | (away < 0.0).all():
            how = f'stays at least {nearest:.3g} {joint.unit("position")} away from its target'
        elif moved < _SHORT * wide:
            how = (f'moves {moved:.3g} of the {wide:.3g} {joint.unit("position")} that '
                   'its target spans')  # fmt: skip
        else:
            continue
        said.append(f'{joint.name} {how}{_why(joint, away, gains, j)}.')
    return said, wrong


def _unit_of_target(joint: Joint, target: np.ndarray, q: np.ndarray) -> str:
    """Return the unit of targets (n,) that positions follow in another one; empty for the same."""
    explained, slope = best_line(target[None], q)
    if explained < _FOLLOWS or slope <= 0.0:
        return ''
    units = _SLIDING if joint.kind == 'prismatic' else _TURNING
    fitting = [u for u, per in units if 1.0 / _NEAR < slope * per < _NEAR and per > 2.0]
    return fitting[0] if fitting else ''


def _why(joint: Joint, away: np.ndarray, gains: Gains | None, j: int) -> str:
    """Say why a target is not reached, as far as the gains of the drive tell."""
    limit = joint.effort_limit
    if gains is None or gains.is_recorded or not (math.isfinite(limit) and limit > 0.0):
        return (
            ': possible causes are a load that the gains cannot hold, saturation or a wrong zero'
        )
    asked = float(np.median(np.abs(gains.kp[j] * away)))
    unit = joint.unit('effort')
    if asked > limit:
        return (f': its gains would need {asked:.3g} {unit}, the limit is {limit:.3g} '
                f'{unit}: the drive saturates, or drives another joint')  # fmt: skip
    return f': a load of {asked:.3g} {unit} that the gains cannot hold, or a wrong zero'


def require_sense(recording: str, refusals: Sequence[str]) -> None:
    """Refuse a recording that contradicts itself.

    Args:
        recording: its name.
        refusals: why.

    Raises:
        RecordingError: there is a reason.
    """
    if refusals:
        raise RecordingError(
            f'{recording}: {"; ".join(refusals)}',
            'the targets of the joints that follow them, in SI units',
            'correct the columns or names of the commands',
        )  # fmt: skip


def has_targets(events: Sequence[Event], gains: Gains | None) -> bool:
    """Return whether commands are targets of position, by their type or as gains are given."""
    commands = [e for e in events if isinstance(e, CommandSample)]
    named = [c.kind for c in commands if c.names is not None]
    if named:
        return all(kind == POSITION for kind in named)
    return gains is not None and bool(commands)


def require_shared_motion(
    machine: Sequence[Mapping[str, tuple[float, float]]],
    simulation: Mapping[str, tuple[float, float]],
) -> list[str]:
    """Return what machine and simulation do not share, of which nothing can be compared.

    Args:
        machine: least and greatest position of each joint that moves, of each recording.
        simulation: likewise.

    Raises:
        RecordingError: no joint moves on both, or no joint passes the same positions on both.
    """
    moved = {name: [x[name] for x in machine if name in x] for x in machine for name in x}
    ours = {n: (min(a for a, _ in x), max(b for _, b in x)) for n, x in moved.items()}
    both = [name for name in ours if name in simulation]
    if not both:
        raise RecordingError(
            f'the machine moves {", ".join(ours) or "nothing"}, the simulation '
            f'{", ".join(simulation) or "nothing"}', 'a joint that moves in both',
            'run the simulation with the commands of the machine',
        )  # fmt: skip
    apart = [
        name for name in both
        if ours[name][1] < simulation[name][0] or simulation[name][1] < ours[name][0]
    ]  # fmt: skip
    ranges = {
        name: f'{name} {ours[name][0]:.3g} to {ours[name][1]:.3g}, in the simulation '
        f'{simulation[name][0]:.3g} to {simulation[name][1]:.3g}'
        for name in apart
    }
    if len(apart) == len(both):
        raise RecordingError(
            'no joint reaches the same positions on the machine and in the simulation: '
            f'{", ".join(ranges.values())}', 'motions that overlap',
            'run the simulation with the commands of the machine',
        )  # fmt: skip
    said = [f'Machine and simulation reach different positions: {x}.' for x in ranges.values()]
    alone = [n for n in (*ours, *simulation) if n not in both]
    if alone:
        said.append(f'Moving only on the machine or only in the simulation: {", ".join(alone)}.')
    return said
