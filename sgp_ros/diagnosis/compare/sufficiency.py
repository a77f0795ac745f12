"""Sufficiency of a recording: what must be there before anything can be decided.

An encoder at rest still shows positions: white noise, or a count that flickers. A joint moves
where its positions range over many units of that noise; the unit is the standard deviation of it,
read off the upper third of the spectrum where no robot moves, or the count of the encoder,
whichever is larger.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from sgp_ros.diagnosis.compare.bandwidth import choose_bandwidth
from sgp_ros.diagnosis.compare.grid import noise_density
from sgp_ros.diagnosis.compare.trajectory import Bandwidth, RawTrajectory, observe, parallel_filter
from sgp_ros.diagnosis.criteria import (
    LEAST_MOTION,
    LEAST_ROWS,
    MOST_MISSED,
    UNSIGNED_LOW,
    UNSIGNED_SHARE,
    UNSIGNED_ZERO,
)
from sgp_ros.engine.samples import Event, JointSample
from sgp_ros.errors import RecordingError
from sgp_ros.rigid.tree import Tree

_FEW = 16
"""Positions below which no spectrum is taken."""
_ROUNDING = 1e-9
"""Least step of an encoder's counts, relative to the range."""
_LOWEST = 0.2
"""Part of what is near zero that a fold is in for at least half of this share of the time."""


def motion_to_noise(position: np.ndarray) -> float:
    """Return the range of positions in units of their noise; 0 where all are the same.

    Args:
        position: (n,) of one joint as the encoder shows it [rad or m].
    """
    extent = float(np.ptp(position))
    if not extent > 0.0:
        return 0.0
    steps = np.abs(np.diff(position))
    count = float(steps[steps > _ROUNDING * extent].min(initial=extent))
    if len(position) < _FEW:
        return extent / count
    (density,) = noise_density(position[:, None], [slice(0, len(position))], 1.0)
    return extent / max(count, float(np.sqrt(0.5 * density)))


def still_joints(events: Iterable[Event], names: Sequence[str]) -> tuple[str, ...]:
    """Return the joints that are seen but do not move more than the noise of their encoders.

    Args:
        events: of a recording; states are taken in the order in which they come.
        names: of the joints.
    """
    columns: dict[tuple[str, ...], list[int]] = {}
    rows = []
    for event in events:
        if isinstance(event, JointSample):
            own = event.names
            if own not in columns:
                columns[own] = [own.index(name) if name in own else -1 for name in names]
            at = columns[own]
            rows.append((np.append(event.position, np.nan) if -1 in at else event.position)[at])
    found = []
    for name, shown in zip(names, np.array(rows).reshape(-1, len(names)).T, strict=True):
        known = shown[np.isfinite(shown)]
        if len(known) and motion_to_noise(known) < LEAST_MOTION:
            found.append(name)
    return tuple(found)


def require_motion(events: Iterable[Event], robot: str, names: Sequence[str]) -> tuple[str, ...]:
    """Return the joints that do not move, of a recording in which another one does.

    Args:
        events: of the recording.
        robot: its name.
        names: of the joints.

    Raises:
        RecordingError: no joint moves.
    """
    still = still_joints(events, names)
    if len(still) == len(names):
        raise RecordingError(
            f'no joint of {robot} moves',
            f'a motion of {LEAST_MOTION:g} times the encoder noise on at least one joint '
            f'({", ".join(still)})',
            'use a recording in which the robot moves',
        )
    return still


def at_rest(raw: RawTrajectory, is_still: np.ndarray) -> RawTrajectory:
    """Return a trajectory in which still joints (k,) of bool rest at the median position.

    What their encoders show is noise, and it explains nothing.
    """
    rest = np.median(raw.position, axis=0)
    return replace(raw, position=np.where(is_still, rest, raw.position))


def require_signed(raw: RawTrajectory, names: Sequence[str]) -> None:
    """Refuse measured efforts that have lost their sign, |tau| in place of tau.

    It is never negative while the joint moves to and fro, and yet comes down to zero again and
    again: a load that is always positive keeps away from it. A fold does not, for efforts pass
    zero as they pass any other value near it.

    Args:
        raw: the recording.
        names: of the joints.

    Raises:
        RecordingError: with the joints.
    """
    if raw.effort is None or raw.drive is not None or raw.approach is not None:
        return
    found = []
    for j, name in enumerate(names):
        effort, steps = raw.effort[:, j], np.diff(raw.position[:, j])
        size = float(np.sqrt((effort**2).mean()))
        turns = min(float((steps > 0.0).mean()), float((steps < 0.0).mean()))
        low, lowest = ((effort < x * UNSIGNED_ZERO * size).mean() for x in (1.0, _LOWEST))
        is_fold = low >= UNSIGNED_LOW and lowest >= 0.5 * _LOWEST * low
        if effort.min() >= 0.0 and turns >= UNSIGNED_SHARE and is_fold:
            found.append(name)
    if found:
        raise RecordingError(
            f'the effort of {", ".join(found)} is never negative in either direction of motion',
            'signed efforts',
            'record signed efforts, or lock these joints in a robot YAML',
        )  # fmt: skip


def without_motors(raw: RawTrajectory, tree: Tree) -> tuple[Tree, tuple[str, ...]]:
    """Return the robot with joints as passive that nothing drives, and a remark if there are some.

    Their recorded effort is zero throughout, and their motion is nearly that of the robot without
    any effort. It is not where efforts were not recorded: then nothing is changed.

    Args:
        raw: the recording.
        tree: nominal robot.
    """
    if raw.effort is None or raw.drive is not None or raw.approach is not None:
        return tree, ()
    driven = tree.is_actuated.copy()
    driven[: tree.size] &= raw.effort.any(axis=0)
    if (driven == tree.is_actuated).all():
        return tree, ()
    idle = replace(tree, is_actuated=driven)
    bandwidth = choose_bandwidth(raw, idle)
    motion, low = observe(raw, idle, bandwidth), parallel_filter(raw, bandwidth)
    needed = low(motion.nominal_effort - motion.effort - motion.stated_force)
    inertial = low(motion.mass_diagonal * motion.acceleration)
    is_free = (needed**2).mean(axis=0) < MOST_MISSED * (inertial**2).mean(axis=0)
    driven[: tree.size] |= tree.is_actuated[: tree.size] & ~(is_free & motion.moves)
    names = [n for j, n in enumerate(tree.moving_names) if driven[j] != tree.is_actuated[j]]
    if not names:
        return tree, ()
    said = (
        f'The recorded effort of {", ".join(names)} is zero throughout, and the motion is nearly '
        'that of a robot without motors there: taken as passive. All forces are then relative to '
        'the bodies of the robot file.'
    )
    return replace(tree, is_actuated=driven), (said,)


def require_rows(raw: RawTrajectory, bandwidth: Bandwidth) -> None:
    """Refuse a trajectory that is too short to say anything.

    Args:
        raw: that is to be learned from.
        bandwidth: of its filters.

    Raises:
        RecordingError: the filters leave fewer than `LEAST_ROWS` independent rows.
    """
    rows = len(parallel_filter(raw, bandwidth).rows)
    if rows < LEAST_ROWS:
        seconds = len(raw.time) * raw.step
        raise RecordingError(
            f'{seconds:.3g} s give {rows} independent rows below {bandwidth.cutoff:.2g} Hz, the '
            'cut-off chosen from motion and noise',
            f'at least {LEAST_ROWS} rows',
            'use a longer recording',
        )
