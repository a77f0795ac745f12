"""A recording on one uniform grid, as the diagnosis sees it.

Positions are joined by a cubic spline, commands are averaged as exactly as `Drive` does it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.batch.acceptance import USUAL, Accepted, HeldCommands, accept
from sgp_ros.batch.command_kinds import are_efforts, are_positions, with_recorded_gains
from sgp_ros.batch.zero_phase import ZeroPhase
from sgp_ros.diagnosis.compare.grid import Stretch, noise_density
from sgp_ros.diagnosis.compare.parallel_filter import ParallelFilter
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.samples import EFFORT, POSITION, Event
from sgp_ros.errors import RecordingError
from sgp_ros.physics.drive import Drive
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.motion import RecordedCommands
from sgp_ros.physics.ripple import Ripple
from sgp_ros.physics.servo import Servo
from sgp_ros.rigid.rigid_body import mass_matrix
from sgp_ros.rigid.tree import Tree
from sgp_ros.robots.gains import Gains
from sgp_ros.robots.observed_motion import ObservedMotion
from sgp_ros.robots.robot import Robot

SHORTEST_ROWS = 64
_COMMON_SHARE = 0.5
_NO_EFFORTS = (
    'The commands are not efforts: the measured effort does not follow them. It is used instead, '
    'so nothing can be said about delay, dead zone, saturation and lag of the drive.'
)
VANISHING = 1e-9
"""Speed at which settled points are approached [rad/s or m/s]: only its direction counts."""
HIGHEST_CUTOFF_HZ = 25.0


@dataclass(frozen=True, eq=False)
class RawTrajectory:
    """n rows on a uniform grid before any smoothing.

    Attributes:
        time: (n,) [s] since the first state of the recording.
        step: [s].
        position: (n, k) [rad or m].
        velocity: (n, k) measured; None without.
        effort: (n, k) measured; None without.
        drive: commands, of efforts or, with gains, targets (c, 2 k) of position and velocity; None
            without.
        segments: stretches without a pause or a jump of positions.
        refused: states by reason.
        noise_density: (k,) of the positions, one-sided [rad^2/Hz or m^2/Hz].
        start_ns: stamp of the first state of the recording.
        stated: effects that the nominal robot has, beside those of its tree.
        remarks: what is odd about efforts and positions.
        gains: of drives that hold position targets; None where commands are efforts.
        recording: (n,) index of the recording of each row, of several; None of one.
        approach: (n, k) direction from which each settled point was approached; None of motion.
        blur: mean product of the weights of the two samples between which an effort lies, 0 to 1/4
            of one period; see `effort_noise`.
    """

    time: np.ndarray
    step: float
    position: np.ndarray
    velocity: np.ndarray | None
    effort: np.ndarray | None
    drive: RecordedCommands | None
    segments: tuple[slice, ...]
    refused: dict[str, int]
    noise_density: np.ndarray
    start_ns: int
    stated: tuple[EffectAt, ...] = ()
    remarks: tuple[str, ...] = ()
    gains: Gains | None = None
    recording: np.ndarray | None = None
    approach: np.ndarray | None = None
    blur: float = 0.0


def collect(
    events: Iterable[Event],
    robot: Robot,
    stated: tuple[EffectAt, ...] = (),
    config: EngineConfig = USUAL,
    gains: Gains | None = None,
    least_step: float = 0.0,
) -> RawTrajectory:
    """Bring a recording to its uniform grid.

    Where states carry a measured effort and there are commands too, the commands act if the
    measured effort follows them: then the laws of the drive can be identified from them. Commands
    of another kind never take the place of measured efforts.

    Args:
        events: of the recording.
        robot: names, actuated joints and gains.
        stated: effects that the nominal robot has, beside those of its tree.
        config: settings of the intake.
        gains: of drives that hold position targets; None where commands are efforts.
        least_step: of the grid, which is otherwise that of the states [s].

    Raises:
        RecordingError: too little is left.
    """
    has_recorded_gains = gains is not None and gains.is_recorded
    events = list(events) if has_recorded_gains else events  # these are passed twice
    accepted = accept(events, robot, config, EFFORT if gains is None else POSITION)
    if gains is None:  # position targets wrap with the positions
        accepted = accepted.unwrapped(robot)
    start_ns = accepted.start_ns
    seconds = (accepted.stamps_ns - start_ns) * 1e-9
    measured = bool(accepted.is_measured.mean() > _COMMON_SHARE)
    stretches = [
        rows for rows in accepted.stretches(config.max_gap)
        if len(rows) >= SHORTEST_ROWS and accepted.is_measured[rows[0]] == measured
    ]  # fmt: skip
    if not stretches:
        raise RecordingError(
            f'{len(seconds)} states, nowhere {SHORTEST_ROWS} of them without a pause above '
            f'{config.max_gap:g} s',
            'at least a few seconds of motion', 'use a longer recording, or one without pauses',
        )  # fmt: skip
    steps = np.concatenate([np.diff(seconds[rows]) for rows in stretches])
    step = max(float(np.median(steps)), least_step)
    parts = [Stretch.of(accepted, rows, seconds, step) for rows in stretches]
    ends = np.cumsum([len(part.time) for part in parts])
    segments = tuple(
        slice(int(end) - len(part.time), int(end)) for end, part in zip(ends, parts, strict=True)
    )
    drive, remarks = _drive(accepted, robot, config, gains, measured=measured)
    if drive is not None and has_recorded_gains:
        drive = with_recorded_gains(drive, events, robot)
    remarks += accepted.remarks(config.max_gap, start_ns)
    position = np.concatenate([part.position for part in parts])
    return RawTrajectory(
        np.concatenate([part.time for part in parts]), step, position,
        _joined([part.velocity for part in parts]), _joined([part.effort for part in parts]),
        None if drive is None else Drive(
            (drive.stamps_ns - start_ns) * 1e-9, drive.effort,
            tuple((float(part.time[0]), len(part.time)) for part in parts), step,
        ),
        segments, dict(accepted.counts.refused), noise_density(position, segments, step),
        start_ns, stated, remarks, None if drive is None else gains,
        blur=float(np.mean([part.blur for part in parts])),
    )  # fmt: skip


def _joined(parts: Sequence[np.ndarray | None]) -> np.ndarray | None:
    arrays = [part for part in parts if part is not None]
    return np.concatenate(arrays) if arrays else None


def _drive(
    accepted: Accepted, robot: Robot, config: EngineConfig, gains: Gains | None, *, measured: bool
) -> tuple[HeldCommands | None, tuple[str, ...]]:
    """Return the commands that act, None where the measured effort does; and what to remark."""
    commands = accepted.commands
    if commands is None or len(commands.stamps_ns) <= 1 or config.effort_source == 'state':
        return None, ()
    if not measured and gains is None and are_positions(accepted, robot):
        raise RecordingError(
            'the positions follow the commands, so these are position targets',
            'effort commands, or targets with the gains of the drives',
            'give the gains of the drives with --gains gains.yaml',
        )  # fmt: skip
    if not measured or (gains is None and are_efforts(accepted, robot)):
        return commands, ()
    return None, () if gains is not None else (_NO_EFFORTS,)


@dataclass(frozen=True)
class Bandwidth:
    """Filters of a diagnosis.

    Attributes:
        cutoff: of the parallel filter [Hz].
        state_cutoff: of the light smoothing of the states [Hz].
    """

    cutoff: float
    state_cutoff: float

    def up_to(self, most_hz: float) -> Bandwidth:
        """Return filters of no more than a cut-off [Hz]."""
        share = min(most_hz / self.cutoff, 1.0)
        return Bandwidth(share * self.cutoff, share * self.state_cutoff)


def observe(raw: RawTrajectory, tree: Tree, bandwidth: Bandwidth) -> ObservedMotion:
    """Return the lightly smoothed motion of a trajectory; settled points as they are.

    Their speed of approach has a meaning only by its direction.
    """
    if raw.approach is not None:
        assert raw.effort is not None
        return ObservedMotion(
            tree, raw.time, raw.step, raw.position, VANISHING * raw.approach,
            np.zeros_like(raw.position), np.where(tree.is_actuated[: tree.size], raw.effort, 0.0),
            None, (0,), raw.stated, sign=np.sign, is_static=True,
        )  # fmt: skip
    light = ZeroPhase(1.0 / raw.step, bandwidth.state_cutoff)
    states = [light.states(raw.position[s]) for s in raw.segments]
    position, velocity, acceleration = (np.concatenate(x) for x in zip(*states, strict=True))
    motion = ObservedMotion(
        tree, raw.time, raw.step, position, velocity, acceleration, np.zeros_like(position), None,
        tuple(s.start for s in raw.segments), raw.stated, raw.recording,
        bandwidth=bandwidth.cutoff,
    )  # fmt: skip
    drive = raw.drive
    if raw.drive is not None and raw.gains is not None:
        drive = _servo(raw.drive, raw.gains, motion)
    driven = tree.is_actuated[: tree.size]
    effort = np.zeros_like(position)
    if drive is not None:
        for j in np.flatnonzero(driven):
            effort[:, j] = drive.effort(int(j))
    elif raw.effort is not None:
        effort = np.where(driven, raw.effort, 0.0)
    return replace(motion, effort=effort, drive=drive)


def _servo(targets: RecordedCommands, gains: Gains, motion: ObservedMotion) -> Servo:
    still = np.zeros_like(motion.position)
    held = motion.effort_for(motion.position, still, still) if gains.holds_gravity else still
    ripple = None
    if (
        isinstance(targets, Drive)
        and not gains.is_recorded
        and motion.tree.is_actuated[: motion.tree.size].all()
    ):
        tree, k = motion.tree, motion.tree.size
        mass = mass_matrix(tree, tree.parameters, motion.position)
        mass = mass + np.diag(np.zeros(k) if gains.rotors is None else gains.rotors)
        wanted, pair = targets.values[:, :k], (gains.kp, gains.kd)
        ripple = Ripple.of(targets.times, wanted, motion.time, motion.step, pair, mass)
    return Servo(
        targets, motion.step, motion.starts, gains.kp, gains.kd, motion.position,
        motion.velocity, held, gains.is_recorded, ripple,
    )  # fmt: skip


def smoothing_error(
    raw: RawTrajectory, motion: ObservedMotion, low: ParallelFilter, bandwidth: Bandwidth
) -> np.ndarray:
    """Return the mean square by which the nominal efforts depend on the light smoothing, (k,)."""
    less = replace(bandwidth, state_cutoff=0.7 * bandwidth.state_cutoff)
    other = observe(raw, motion.tree, less)
    change = low(
        (motion.nominal_effort - motion.stated_force) - (other.nominal_effort - other.stated_force)
    )
    return np.asarray((change**2).mean(axis=0))


def parallel_filter(raw: RawTrajectory, bandwidth: Bandwidth) -> ParallelFilter:
    """Return the filter for target and columns."""
    return ParallelFilter(1.0 / raw.step, bandwidth.cutoff, raw.segments)
