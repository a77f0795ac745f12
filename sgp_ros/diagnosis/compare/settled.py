"""Recordings of settled points: one row a pose, taken after the robot had come to rest.

Statics holds in every row by itself, and no clock is needed:

    tau = g(q) - tau_x(q, s),

where s is the direction from which the pose was approached. Dry friction then stands at its limit
against s, as in motion at vanishing speed: its equation is that of a row with v = s eps and a = 0.
What depends on speed, acceleration, time or the path between the poses does not show, and is no
candidate.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from sgp_ros.batch.acceptance import USUAL, accept
from sgp_ros.diagnosis.compare.trajectory import RawTrajectory
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.samples import Event, JointSample
from sgp_ros.errors import RecordingError
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import Place
from sgp_ros.robots.observed_motion import ObservedMotion
from sgp_ros.robots.robot import Robot

LEAST_POSES = 64
"""Poses below which nothing is decided, as rows of a stretch."""
COUNTS_BACK, NOISES_BACK = 2.5, 6.0
"""Counts of the encoder, and standard deviations of the noise of positions, that a position must
turn back by for a change of direction."""
FINE = 0.01
"""Noise of the positions of a sweep over its range; what varies more are poses here and there."""
HELD_BACK = 4
"""Without another recording each of so many poses proves what the others say."""
_OF_SECOND_DIFFERENCES = 0.6745 * math.sqrt(6.0)
"""Median size of the second differences of normal noise, over its standard deviation."""
_FASTER = 1e3
_ALIKE = 1e-6
_ROW_NS = 10**8
"""Rows stand this far apart for the intake, which refuses pauses and repeated stamps [ns]."""


def collect_settled(
    events: Iterable[Event],
    robot: Robot,
    stated: tuple[EffectAt, ...] = (),
    config: EngineConfig = USUAL,
    least: int = LEAST_POSES,
) -> RawTrajectory:
    """Return settled points as numbered rows, whatever their stamps say.

    Velocities of one size are the directions from which they were approached.

    Args:
        events: of the recording; states carry measured efforts.
        robot: names, actuated joints and gains.
        stated: effects that the nominal robot has, beside those of its tree.
        config: settings of the intake.
        least: poses that there must be.

    Raises:
        RecordingError: too few poses, or no measured efforts.
    """
    taken = [e for e in events if isinstance(e, JointSample)]
    numbered = [replace(e, stamp_ns=i * _ROW_NS) for i, e in enumerate(taken)]
    accepted = accept(numbered, robot, replace(config, effort_source='state'))
    rows = np.flatnonzero(accepted.is_measured)
    if len(rows) < least:
        raise RecordingError(
            f'{len(rows)} poses with a measured effort', f'at least {least}',
            'record more poses, with the effort that holds each',
        )  # fmt: skip
    position = accepted.position[rows]
    n, k = position.shape
    approach = None if accepted.velocity is None else _told(accepted.velocity[rows])
    if approach is None:
        approach = np.column_stack([approaches(position[:, j]) for j in range(k)])
    return RawTrajectory(
        np.arange(n, dtype=float), 1.0, position, None, accepted.effort[rows], None,
        (slice(0, n),), dict(accepted.counts.refused), np.zeros(k),
        taken[0].stamp_ns, stated, (), approach=approach,
    )  # fmt: skip


def _told(velocity: np.ndarray) -> np.ndarray | None:
    """Return the directions that velocities of one size are; None of others."""
    speed = np.abs(velocity)
    return np.sign(velocity) if (speed > 0.0).all() and np.ptp(speed) == 0.0 else None


def approaches(position: np.ndarray) -> np.ndarray:
    """Return the direction from which each position was approached, (n,) of -1 and 1.

    A flicker of the encoder is not a change of direction: the position must turn back by
    `COUNTS_BACK` of its least steps, and by `NOISES_BACK` of the noise about a sweep.

    Args:
        position: (n,) in the order in which they were taken [rad or m].
    """
    steps = np.abs(np.diff(position))
    least = COUNTS_BACK * float(steps[steps > 0.0].min(initial=0.0 if not steps.any() else np.inf))
    noise = float(np.median(np.abs(np.diff(position, 2)))) / _OF_SECOND_DIFFERENCES
    if noise < FINE * np.ptp(position):
        least = max(least, NOISES_BACK * noise)
    moved = np.flatnonzero(np.abs(position - position[0]) >= least)
    direction = 1.0 if not len(moved) or position[moved[0]] >= position[0] else -1.0
    furthest, found = position[0], np.empty(len(position))
    for i, q in enumerate(position):
        if direction * (q - furthest) > 0.0:
            furthest = q
        elif direction * (furthest - q) >= least > 0.0:
            direction, furthest = -direction, q
        found[i] = direction
    return found


def every_fourth(raw: RawTrajectory) -> tuple[RawTrajectory, RawTrajectory]:
    """Return three poses in four, to learn from, and the others."""
    is_held = np.arange(len(raw.time)) % HELD_BACK == HELD_BACK - 1
    return _poses(raw, ~is_held), _poses(raw, is_held)


def _poses(raw: RawTrajectory, which: np.ndarray) -> RawTrajectory:
    n = int(which.sum())
    assert raw.effort is not None
    assert raw.approach is not None
    return replace(
        raw, time=np.arange(n, dtype=float), position=raw.position[which],
        effort=raw.effort[which], approach=raw.approach[which], segments=(slice(0, n),),
    )  # fmt: skip


def shows(effect: Effect, place: Place, motion: ObservedMotion) -> bool:
    """Return whether a recording can show an effect; settled points show only static ones.

    Its force must neither vanish nor change when poses are approached faster and later.
    """
    if not motion.is_static:
        return True
    if effect.has_memory:
        return False
    faster = replace(
        motion, velocity=_FASTER * motion.velocity, time=_FASTER * motion.time, step=_FASTER
    )
    starts = effect.starts(motion, place)
    if not len(starts):
        return False
    for shape in (starts[0], starts[len(starts) // 2], starts[-1]):
        slow, fast = (_columns(effect, place, shape, m) for m in (motion, faster))
        size = float(np.abs(slow).max(initial=0.0))
        if size == 0.0 or np.abs(fast - slow).max() > _ALIKE * size:
            return False
    return True


def _columns(
    effect: Effect, place: Place, shape: np.ndarray, motion: ObservedMotion
) -> np.ndarray:
    bins = effect.bins(motion, place)
    if bins is not None:
        return bins[0]
    law = effect.columns if effect.small is None else effect.small.columns
    return law(motion, place, shape)
