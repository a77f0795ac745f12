"""Measured, nominal and diagnosed motion over each other, in open and in closed loop.

In open loop a model moves under the efforts of the recording; it starts anew from the measured
state every half second, every two seconds, or once. In closed loop the recorded targets act
through the drives, whose errors are those of the moving model: with `tau = kp (q_des - q) +
kd (dq_des - dq) + tau_ff` along the recording, its effort at (q', dq') is `tau + kp (q - q') +
kd (dq - dq')`. That is what users of position control see.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sgp_ros.batch.zero_phase import ZeroPhase
from sgp_ros.diagnosis.compare.equations import resting
from sgp_ros.diagnosis.compare.trajectory import (
    Bandwidth,
    RawTrajectory,
    observe,
    parallel_filter,
)
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.locate.remainder import Remainder
from sgp_ros.diagnosis.prove.prediction import FinalModel
from sgp_ros.diagnosis.prove.rollouts import RolloutWindows, cut, roll_out
from sgp_ros.diagnosis.shown import Overlay, Replay
from sgp_ros.rigid.tree import Tree
from sgp_ros.robots.gains import Gains
from sgp_ros.robots.observed_motion import ObservedMotion

_HORIZONS_S = {'open_0.5': 0.5, 'open_2': 2.0}
_LONGEST_S = 10.0
"""Of a replay of the whole recording: it is integrated step by step."""
_KEPT_S = 60.0
_FAR = 10.0
"""Ranges of the recording beyond which a replay is not stable."""


@dataclass(frozen=True, slots=True)
class _Side:
    """One of the two models."""

    model: Model
    remainders: tuple[Remainder, ...]


def overlays(
    final: FinalModel, parts: Mapping[str, RawTrajectory], tree: Tree
) -> dict[str, Overlay]:
    """Return the motions of both models over each recording that is a motion, by stem."""
    found = {stem: overlay(final, part, tree) for stem, part in parts.items()}
    return {stem: x for stem, x in found.items() if x is not None}


def overlay(
    final: FinalModel, raw: RawTrajectory, tree: Tree,
    names: Sequence[str] = ('nominal', 'diagnosed'),
) -> Overlay | None:  # fmt: skip
    """Return the motions of both models over that of a recording; None of settled points.

    Args:
        final: nominal and final model.
        raw: any recording of the robot.
        tree: nominal robot.
        names: of both models; of one name, that of the nominal one alone.
    """
    if raw.approach is not None:
        return None
    cutoff, rate = final.equations.filter.cutoff, 1.0 / raw.step
    bandwidth = Bandwidth(min(cutoff, 0.3 * rate), min(2.5 * cutoff, 0.4 * rate))
    motion, low = observe(raw, tree, bandwidth), parallel_filter(raw, bandwidth)
    rows = low.rows[motion.time[low.rows] <= motion.time[0] + _KEPT_S]
    if not len(rows):
        return None
    rests = resting(raw, motion, bandwidth)
    trim = ZeroPhase(rate, bandwidth.state_cutoff).trim
    both = _Side(final.nominal, ()), _Side(final.model, final.remainders)
    sides = dict(zip(names, both, strict=False))
    effort = low(motion.effort)[: len(rows)]
    efforts = {
        name: effort + low(final.imbalance(s.model, motion, rests, s.remainders))[: len(rows)]
        for name, s in sides.items()
    }
    known = None if raw.gains is None or raw.gains.is_recorded else raw.gains
    replays = {
        mode: {name: _replayed(final, s, windows, rows, gains) for name, s in sides.items()}
        for mode, windows, gains in _modes(motion, trim, known)
    }
    return Overlay(
        motion.time[rows], motion.position[rows], effort, efforts, replays,
        float(motion.time[-1] - motion.time[0]),
    )  # fmt: skip


def _modes(
    motion: ObservedMotion, trim: int, gains: Gains | None
) -> list[tuple[str, RolloutWindows, Gains | None]]:
    """Return name, windows and, in closed loop, gains of each replay that has a window."""
    end = motion.starts[1] if len(motion.starts) > 1 else len(motion.time)
    whole = min((end - 2 * trim - 2) * motion.step, _LONGEST_S)
    found: list[tuple[str, RolloutWindows, Gains | None]] = []
    for name, horizon in _HORIZONS_S.items():
        found.append((name, cut(motion, trim, horizon), None))
    if whole > 0.0:
        windows = cut(motion, trim, whole)
        one = RolloutWindows(motion, windows.first[:1], windows.stride, windows.steps)
        # under the efforts of a drive alone, every model soon leaves what that drive followed
        found.append(('open_whole' if gains is None else 'closed_whole', one, gains))
    return [(name, windows, g) for name, windows, g in found if len(windows.first)]


def _replayed(
    final: FinalModel, side: _Side, windows: RolloutWindows, rows: np.ndarray, gains: Gains | None
) -> Replay:
    """Return the positions of a model at the rows (N, k) until it leaves, and their errors."""
    motion = windows.motion
    rolled, ends = roll_out(windows, side.model, final.equations, side.remainders, gains)
    spread = np.ptp(motion.position, axis=0)
    low, high = motion.position.min(axis=0), motion.position.max(axis=0)
    near = (rolled > low - _FAR * spread) & (rolled < high + _FAR * spread)  # not NaN either
    shown = np.full((len(rows), motion.position.shape[1]), np.nan)
    seen = np.where(np.logical_and.accumulate(near, axis=1), rolled, np.nan)
    for w, nodes in enumerate(windows.nodes):
        inside = (rows >= nodes[0]) & (rows <= nodes[-1])
        for j in range(shown.shape[1]):
            shown[inside, j] = np.interp(rows[inside], nodes, seen[w, :, j])
    if not (ends & near.all(axis=(1, 2))).all():
        return Replay(shown, np.full(shown.shape[1], math.nan))
    steps = windows.squared(rolled).sum(axis=0) / (len(windows.first) * windows.steps)
    return Replay(shown, np.sqrt(steps))
