"""Measured, nominal and diagnosed motion over each other, in open and in closed loop.

In open loop a model moves under the efforts of the recording; it starts anew from the measured
state every half second, every two seconds, or once. In closed loop the recorded targets act
through the drives, whose errors are those of the moving model: with `tau = kp (q_des - q) +
kd (dq_des - dq) + tau_ff` along the recording, its effort at (q', dq') is `tau + kp (q - q') +
kd (dq - dq')`. That is what users of position control see.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.batch.zero_phase import ZeroPhase
from sgp_ros.diagnosis.compare.parallel_filter import ParallelFilter
from sgp_ros.diagnosis.compare.rest import resting
from sgp_ros.diagnosis.compare.trajectory import (
    Bandwidth,
    RawTrajectory,
    observe,
    parallel_filter,
)
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.locate.remainder import Remainder
from sgp_ros.diagnosis.prove.prediction import FinalModel
from sgp_ros.diagnosis.prove.rollouts import RolloutWindows, cut, roll_outs, work
from sgp_ros.diagnosis.shown import Overlay, Replay
from sgp_ros.rigid.tree import Tree
from sgp_ros.robots.gains import Gains
from sgp_ros.robots.observed_motion import ObservedMotion

_HORIZONS_S = {'open_0.5': 0.5, 'open_2': 2.0}
_LONGEST_S = 5.0
"""Of a replay, which is integrated step by step; less of a stiff one, or one that remembers."""
_KEPT_S = 60.0
_FAR = 10.0
"""Ranges of the recording beyond which a replay is not stable."""


@dataclass(frozen=True, slots=True)
class _Side:
    """One of the two models."""

    model: Model
    remainders: tuple[Remainder, ...]


@dataclass(frozen=True, eq=False)
class _View:
    """A recording that is a motion.

    Attributes:
        raw: the recording.
        motion: n rows.
        low: filter of its equations.
        rows: (N,) that are shown.
        bandwidth: of the filters.
    """

    raw: RawTrajectory
    motion: ObservedMotion
    low: ParallelFilter
    rows: np.ndarray
    bandwidth: Bandwidth

    @classmethod
    def of(cls, final: FinalModel, raw: RawTrajectory, tree: Tree) -> _View | None:
        """Return the view of a recording; None of settled points, and where no row is left."""
        if raw.approach is not None:
            return None
        cutoff, rate = final.equations.filter.cutoff, 1.0 / raw.step
        bandwidth = Bandwidth(min(cutoff, 0.3 * rate), min(2.5 * cutoff, 0.4 * rate))
        motion, low = observe(raw, tree, bandwidth), parallel_filter(raw, bandwidth)
        rows = low.rows[motion.time[low.rows] <= motion.time[0] + _KEPT_S]
        return cls(raw, motion, low, rows, bandwidth) if len(rows) else None

    def efforts(self, final: FinalModel, sides: Mapping[str, _Side]) -> dict[str, np.ndarray]:
        """Return the efforts that each model takes for this motion, (N, k)."""
        motion, count = self.motion, len(self.rows)
        rests = resting(self.raw, motion, self.bandwidth)
        acting = self.acting
        return {
            name: acting + self.low(final.imbalance(s.model, motion, rests, s.remainders))[:count]
            for name, s in sides.items()
        }

    @property
    def acting(self) -> np.ndarray:
        """Effort that acted, (N, k)."""
        return self.low(self.motion.effort)[: len(self.rows)]

    def modes(self, final: FinalModel, sides: Iterable[_Side]) -> list[_Mode]:
        """Return the replays of the recording: windows and, in closed loop, gains."""
        trim = ZeroPhase(1.0 / self.raw.step, self.bandwidth.state_cutoff).trim
        gains = self.raw.gains
        known = None if gains is None or gains.is_recorded else gains
        short = cut(self.motion, trim, min(_HORIZONS_S.values()))
        steps = [work(short, s.model, final.equations, s.remainders, known) for s in sides]
        longest = _LONGEST_S / max(steps) if len(short.first) else _LONGEST_S
        return replays(self.motion, trim, known, longest)


def overlays(
    final: FinalModel, parts: Mapping[str, RawTrajectory], tree: Tree,
    names: Sequence[str] = ('nominal', 'diagnosed'),
) -> dict[str, Overlay]:  # fmt: skip
    """Return the motions of both models over each recording that is a motion, by stem.

    Args:
        final: nominal and final model.
        parts: recordings of the robot, by stem.
        tree: nominal robot.
        names: of both models; of one name, that of the nominal one alone.
    """
    found = {stem: _View.of(final, part, tree) for stem, part in parts.items()}
    views = {stem: view for stem, view in found.items() if view is not None}
    both = _Side(final.nominal, ()), _Side(final.model, final.remainders)
    sides = dict(zip(names, both, strict=False))
    modes = [(stem, *m) for stem, view in views.items() for m in view.modes(final, sides.values())]
    shown: dict[str, dict[str, dict[str, Replay]]] = {stem: {} for stem in views}
    for gains in {id(g): g for *_, g in modes}.values():
        own = [(stem, mode, windows) for stem, mode, windows, g in modes if g is gains]
        for name, s in sides.items():
            rolled = roll_outs([w for *_, w in own], s.model, final.equations, s.remainders, gains)
            for (stem, mode, windows), positions in zip(own, rolled, strict=True):
                replay = _replayed(windows, views[stem].rows, *positions)
                shown[stem].setdefault(mode, {})[name] = replay
    return {
        stem: Overlay(
            view.motion.time[view.rows], view.motion.position[view.rows], view.acting,
            view.efforts(final, sides), shown[stem],
            float(view.motion.time[-1] - view.motion.time[0]),
        )
        for stem, view in views.items()
    }  # fmt: skip


_Mode = tuple[str, RolloutWindows, Gains | None]
"""Name, windows and, in closed loop, gains of a replay."""


def replays(motion: ObservedMotion, trim: int, gains: Gains | None, longest: float) -> list[_Mode]:
    """Return each replay that has a window and is not too long, the whole if others are not.

    In closed loop, which users of position control see, there is one of two seconds in any case.
    It is where most moves: recordings begin at rest.
    """
    end = motion.starts[1] if len(motion.starts) > 1 else len(motion.time)
    least = longest if gains is None else max(longest, *_HORIZONS_S.values())
    whole = min((end - 2 * trim - 2) * motion.step, least)
    found: list[_Mode] = []
    for name, horizon in _HORIZONS_S.items():
        if horizon <= longest:
            found.append((name, cut(motion, trim, horizon), None))
    if whole > 0.0 and max(_HORIZONS_S.values()) <= least:
        windows = cut(motion, trim, whole)
        one = replace(windows, first=windows.first[_liveliest(windows)])
        # under the efforts of a drive alone, every model soon leaves what that drive followed
        found.append(('open_whole' if gains is None else 'closed_whole', one, gains))
    return [(name, windows, g) for name, windows, g in found if len(windows.first)]


def _liveliest(windows: RolloutWindows) -> slice:
    """Return the window in which joints move most, each relative to its usual speed."""
    if not len(windows.first):
        return slice(0)
    squares = windows.motion.velocity**2
    squares = (squares / np.maximum(squares.mean(axis=0), 1e-300)).sum(axis=1)
    until = np.append(0.0, np.cumsum(squares))
    last = np.minimum(windows.first + windows.steps * windows.stride, len(squares))
    best = int(np.argmax(until[last] - until[windows.first]))
    return slice(best, best + 1)


def _replayed(
    windows: RolloutWindows, rows: np.ndarray, rolled: np.ndarray, ends: np.ndarray
) -> Replay:
    """Return the positions of a model at the rows (N, k) until it leaves, and their errors."""
    motion = windows.motion
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
