"""Check of a raw recording before any processing: clock, channels, commands, excitation.

All numbers are of the raw samples in the order in which they come; nothing is refused or filtered
here, so that a reader sees what the later stages will meet.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from sgp_ros.batch.contradictions import (
    has_targets,
    target_contradictions,
    unit_contradictions,
)
from sgp_ros.engine.samples import CommandSample, Event, JointSample
from sgp_ros.errors import RecordingError
from sgp_ros.robots.gains import Gains
from sgp_ros.robots.robot import Robot

GAP = 5.0
"""Usual steps without a state that count as a gap."""
_JITTER = 0.25
"""Of a step, as share of the usual one, from which on stamps are called uneven."""
_STILL = 20.0
"""Range of positions in units of their noise below which a joint is called still."""
_COPY = 1e-9


@dataclass(frozen=True, slots=True)
class JointCheck:
    """Check of one joint in a recording.

    Attributes:
        lower, upper: least and greatest position [rad or m].
        range_share: of the limits of the robot, NaN without limits.
        speed: root mean square of the slope of the position [rad/s or m/s].
        reversals: changes of the direction of motion.
        resolution: least step of the encoder, 0 where none shows [rad or m].
        motion_to_noise: range over the noise of the position.
        velocity, effort: share of the states with one.
        effort_rms: without its mean [N m or N], NaN without.
        effort_most: without sign, less one of a hundred [N m or N], 0 without.
    """

    lower: float
    upper: float
    range_share: float
    speed: float
    reversals: int
    resolution: float
    motion_to_noise: float
    velocity: float
    effort: float
    effort_rms: float
    effort_most: float

    @property
    def moves(self) -> bool:
        """Whether the joint moves beyond its noise."""
        return self.motion_to_noise >= _STILL


@dataclass(frozen=True, slots=True)
class RecordingCheck:
    """Contents of a recording.

    Attributes:
        states, commands: numbers of them.
        seconds: from the first stamp to the last.
        rate_hz: from the median step of the states.
        jitter: standard deviation of the steps without gaps over the median one.
        gaps, backward, repeated: of the stamps of states.
        command_rate_hz: from the median step of the commands, 0 without.
        command_kinds: what named commands are, or `unnamed`.
        missing, unknown: joints of the robot that no state names; joints that it does not know.
        joints: by name, of those that were seen.
        remarks: what should be looked at.
        refusals: contradictions that no diagnosis could stand on.
    """

    states: int
    commands: int
    seconds: float
    rate_hz: float
    jitter: float
    gaps: int
    backward: int
    repeated: int
    command_rate_hz: float
    command_kinds: tuple[str, ...]
    missing: tuple[str, ...]
    unknown: tuple[str, ...]
    joints: dict[str, JointCheck] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    refusals: tuple[str, ...] = ()

    @property
    def moving(self) -> dict[str, tuple[float, float]]:
        """Least and greatest position of each joint that moves."""
        return {name: (j.lower, j.upper) for name, j in self.joints.items() if j.moves}

    def content(self) -> dict[str, Any]:
        """Return the check as JSON holds it; what is not known is None."""

        def plain(x: Any) -> Any:
            return None if isinstance(x, float) and not math.isfinite(x) else x

        joints = {
            name: {key: plain(getattr(j, key)) for key in JointCheck.__slots__}
            | {'moves': j.moves}
            for name, j in self.joints.items()
        }
        keys = [k for k in self.__slots__ if k not in {'joints', 'remarks'}]
        found = {k: plain(getattr(self, k)) for k in keys}
        lists = {k: list(x) if isinstance(x, tuple) else x for k, x in found.items()}
        return {**lists, 'joints': joints, 'remarks': list(self.remarks)}


def check_recording(
    events: Iterable[Event], robot: Robot, gains: Gains | None = None
) -> RecordingCheck:
    """Return what a recording holds of a robot. O(n k).

    Args:
        events: in the order in which they come.
        robot: whose joints are looked for.
        gains: of drives whose commands are targets; None where they are not known.
    """
    known = list(events)
    states = [e for e in known if isinstance(e, JointSample)]
    commands = [e for e in known if isinstance(e, CommandSample)]
    stamps = np.array([s.stamp_ns for s in states], dtype=np.int64)
    steps = np.diff(stamps).astype(np.float64) * 1e-9
    forward = steps[steps > 0.0]
    usual = float(np.median(forward)) if len(forward) else 0.0
    plain = forward[forward <= GAP * usual]
    jitter = float(plain.std() / usual) if len(plain) and usual > 0.0 else 0.0
    seen = {name for s in states[:1000] for name in s.names}
    joints = {
        joint.name: _joint(states, joint.name, (joint.lower, joint.upper))
        for joint in robot.joints
        if joint.name in seen
    }
    asked_ns = np.array([c.stamp_ns for c in commands], dtype=np.int64)
    command_steps = np.diff(asked_ns).astype(np.float64) * 1e-9
    asked = command_steps[command_steps > 0.0]
    found = RecordingCheck(
        len(states), len(commands),
        float(stamps.max() - stamps.min()) * 1e-9 if len(stamps) else 0.0,
        1.0 / usual if usual > 0.0 else 0.0, jitter, int((forward > GAP * usual).sum()),
        int((steps < 0.0).sum()), int((steps == 0.0).sum()),
        1.0 / float(np.median(asked)) if len(asked) else 0.0,
        tuple(sorted({'unnamed' if c.names is None else c.kind for c in commands})),
        tuple(n for n in robot.joint_names if n not in seen),
        tuple(sorted(seen - set(robot.joint_names))), joints,
    )  # fmt: skip
    said, refusals = _followed(known, robot, gains)
    remarks = (
        *_clock(found), *_motion(found, robot), *_units(states, found, robot),
        *_targets(states, commands, robot), *said,
    )  # fmt: skip
    return replace(found, remarks=remarks, refusals=tuple(refusals))


def _joint(states: Sequence[JointSample], name: str, limits: tuple[float, float]) -> JointCheck:
    rows = [(s, s.names.index(name)) for s in states if name in s.names]
    q = np.array([s.position[i] for s, i in rows])
    t = np.array([s.stamp_ns for s, _ in rows], dtype=np.int64) * 1e-9
    v = [s.velocity[i] for s, i in rows if s.velocity is not None]
    u = np.array([s.effort[i] for s, i in rows if s.effort is not None])
    u = u[np.isfinite(u)]
    good = np.isfinite(q)
    q, t = q[good], t[good]
    change, step = np.diff(q), np.diff(t)
    slope = change[step > 0.0] / step[step > 0.0]
    moved = change[np.abs(change) > 1e-9 * max(float(np.ptp(q)) if len(q) else 0.0, 1e-300)]
    noise = float(np.sqrt(np.mean(np.diff(q, 3) ** 2) / 20.0)) if len(q) > 8 else 0.0
    resolution = float(np.abs(moved).min()) if len(moved) else 0.0
    extent = float(np.ptp(q)) if len(q) else 0.0
    width = limits[1] - limits[0]
    lagged = q[:: max(1, len(q) // 2000)]
    turns = np.sign(np.diff(lagged))
    turns = turns[turns != 0.0]
    return JointCheck(
        float(q.min()) if len(q) else math.nan, float(q.max()) if len(q) else math.nan,
        extent / width if math.isfinite(width) and width > 0.0 else math.nan,
        float(np.sqrt(np.mean(slope**2))) if len(slope) else 0.0,
        int((np.diff(turns) != 0.0).sum()), resolution,
        extent / max(noise, 1e-12 * max(extent, 1e-300)) if extent > 0.0 else 0.0,
        float(np.isfinite(v).mean()) * len(v) / len(rows) if v else 0.0,
        len(u) / len(rows) if rows else 0.0, float(u.std()) if len(u) else math.nan,
        float(np.quantile(np.abs(u), 0.99)) if len(u) else 0.0,
    )  # fmt: skip


def _clock(found: RecordingCheck) -> list[str]:
    said = []
    if found.gaps:
        said.append(f'{found.gaps} gaps of more than {GAP:g} periods: treated as pauses.')
    if found.backward or found.repeated:
        said.append(
            f'{found.backward} backward and {found.repeated} repeated stamps: such states are '
            'refused or sorted, or start a new segment.'
        )
    if found.jitter > _JITTER:
        said.append(
            f'The stamps are uneven: sampling periods vary by {100.0 * found.jitter:.0f} %.'
        )
    return said


def _motion(found: RecordingCheck, robot: Robot) -> list[str]:
    said = []
    if found.missing:
        said.append(f'No states for {", ".join(found.missing)}.')
    if found.unknown:
        said.append(f'Not joints of {robot.name}, ignored: {", ".join(found.unknown)}.')
    still = [name for name, j in found.joints.items() if not j.moves]
    if still:
        said.append(f'No motion above the noise, so not diagnosed: {", ".join(still)}.')
    driven = {joint.name for joint in robot.joints if joint.is_actuated}
    none = [n for n, j in found.joints.items() if n in driven and j.effort == 0.0]
    if none and not found.commands:
        said.append(f'Neither effort nor command for {", ".join(none)}.')
    one = [n for n, j in found.joints.items() if j.moves and j.reversals < 2]
    if one:
        said.append(
            f'Moving in one direction only: {", ".join(one)}. Friction and a constant load cannot '
            'be separated there.'
        )
    return said


def _units(states: Sequence[JointSample], found: RecordingCheck, robot: Robot) -> list[str]:
    """Say which numbers the limits of the robot, or each other, contradict."""
    said = []
    for joint in robot.joints:
        check = found.joints.get(joint.name)
        if check is None or not math.isfinite(check.lower):
            continue
        ends, most = (check.lower, check.upper), check.effort_most * joint.effort_gain
        for texts in unit_contradictions(states, joint, ends, most):
            said += [f'{text[0].upper()}{text[1:]}.' for text in texts]
    return said


def _followed(
    events: Sequence[Event], robot: Robot, gains: Gains | None
) -> tuple[list[str], list[str]]:
    """Return oddities of the position targets, and errors that are refused."""
    if not has_targets(events, gains):
        return [], []
    try:
        return target_contradictions(events, robot, gains)
    except RecordingError:  # nothing is accepted, which is said where it is needed
        return [], []


def _targets(
    states: Sequence[JointSample], commands: Sequence[CommandSample], robot: Robot
) -> list[str]:
    """Say which targets are the measured positions themselves."""
    measured = {s.stamp_ns: s for s in states}
    copies = []
    for name in robot.joint_names:
        pairs = [
            (c.effort[c.names.index(name)], s.position[s.names.index(name)])
            for c in commands[:2000]
            if c.names is not None and name in c.names
            and (s := measured.get(c.stamp_ns)) is not None and name in s.names
        ]  # fmt: skip
        x = np.array(pairs)
        if len(x) > 10 and np.ptp(x[:, 1]) > 0.0 and np.abs(x[:, 0] - x[:, 1]).max() < _COPY:
            copies.append(name)
    if not copies:
        return []
    return [
        f'The command of {", ".join(copies)} equals the measured position: not used as a target.'
    ]
