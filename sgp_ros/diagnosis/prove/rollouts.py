"""Roll-outs of a diagnosed model from measured states under recorded commands.

A one-step error says little. Windows of 0.3 s are simulated all at once from where they start, and
compared with what was measured. The yardstick is the error of holding the first position.

The force of an effect that remembers depends on the motion before. Friction that creeps has a
state; the force of others is taken along the motion that was rolled out last, and the windows are
rolled out again until nothing changes: the causal fixed point of Picard's iteration. Windows start
from what was measured, and so do their memories, up to the error that the window before ends with.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from sgp_ros.batch.rollout import advance
from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.locate.remainder import Remainder
from sgp_ros.diagnosis.prove.dynamics import (
    ServoedDynamics,
    dynamics_of,
    remembered_force,
    remembers,
)
from sgp_ros.diagnosis.prove.elastic import ElasticDynamics, springs_of
from sgp_ros.robots.gains import Gains
from sgp_ros.robots.observed_motion import ObservedMotion

HORIZON_S = 0.3
STEP_S = 0.005
MOST_WINDOWS = 200
MOST_ROUNDS, _USUAL_ROUNDS = 12, 3
CONVERGED = 1e-3
"""Largest change of a round, in root mean square ways of each joint within the windows."""
_MOST_SUBSTEPS = 20
_STABLE = 2.0
"""Rate times step below which the classical Runge-Kutta method is stable, with a margin."""


@dataclass(frozen=True, eq=False)
class RolloutWindows:
    """Windows of a recording, m of n steps.

    Attributes:
        motion: the recording.
        first: (m,) rows at which they start.
        stride: rows a step.
        steps: n.
    """

    motion: ObservedMotion
    first: np.ndarray
    stride: int
    steps: int

    @property
    def step(self) -> float:
        """Length of a step [s]."""
        return self.stride * self.motion.step

    @property
    def nodes(self) -> np.ndarray:
        """Rows at the ends of steps, (m, n + 1)."""
        return self.first[:, None] + self.stride * np.arange(self.steps + 1)

    @property
    def rows(self) -> np.ndarray:
        """All rows, (m, n stride + 1)."""
        return self.first[:, None] + np.arange(self.steps * self.stride + 1)

    @property
    def held(self) -> np.ndarray:
        """Squared error of holding the position at the start, summed, (m, k)."""
        return self.squared(np.repeat(self.motion.position[self.nodes][:, :1], self.steps + 1, 1))

    def squared(self, q: np.ndarray) -> np.ndarray:
        """Return the squared errors of roll-outs (m, n + 1, k), summed over steps, (m, k)."""
        return np.asarray(((q - self.motion.position[self.nodes]) ** 2).sum(axis=1))

    def means(self, x: np.ndarray) -> np.ndarray:
        """Return the mean of a signal (rows, k) over each step, (m, n, k)."""
        values = x[self.rows]
        middle = 0.5 * (values[:, 1:] + values[:, :-1])
        m, _, k = middle.shape
        return np.asarray(middle.reshape(m, self.steps, self.stride, k).mean(axis=2))


def cut(motion: ObservedMotion, trim: int, horizon: float = HORIZON_S) -> RolloutWindows:
    """Cut a recording into windows one after the other, at most `MOST_WINDOWS` of them.

    Args:
        motion: n rows.
        trim: rows to leave out at both ends of each stretch without a pause.
        horizon: length of a window [s].
    """
    stride = max(1, int(STEP_S / motion.step + 1e-6))
    steps = max(1, round(horizon / (stride * motion.step)))
    ends = [*motion.starts[1:], len(motion.time)]
    first = np.concatenate(
        [
            np.arange(start + trim, end - trim - steps * stride, steps * stride)
            for start, end in zip(motion.starts, ends, strict=True)
        ]
    ).astype(int)
    if len(first) > MOST_WINDOWS:
        first = first[np.linspace(0, len(first) - 1, MOST_WINDOWS).astype(int)]
    return RolloutWindows(motion, first, stride, steps)


def roll_out(
    windows: RolloutWindows,
    model: Model,
    equations: Equations,
    remainders: tuple[Remainder, ...] = (),
    gains: Gains | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Roll out a model from the start of every window.

    Args:
        windows: of the recording.
        model: fitted on `equations`.
        equations: of the training recording.
        remainders: processes beside the model.
        gains: of drives that go on controlling the model; None for the efforts of the recording.

    Returns:
        positions (m, n + 1, k) [rad or m], and (m,) which windows ended with finite numbers and,
        where effects remember, with a fixed point.
    """
    return roll_outs((windows,), model, equations, remainders, gains)[0]


def roll_outs(
    several: Sequence[RolloutWindows],
    model: Model,
    equations: Equations,
    remainders: tuple[Remainder, ...] = (),
    gains: Gains | None = None,
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Roll out a model from windows of several recordings and lengths, each as `roll_out`.

    They step together: a step costs little more for many states than for one.
    """
    sets = [_Set(windows, model, equations, remainders, gains) for windows in several]
    left = sets
    for _ in range(MOST_ROUNDS):
        for one, (q, v) in zip(left, _rolled(left), strict=True):
            one.take(q, v)
        left = [one for one in left if not one.is_done]
    return [(one.q, one.ended) for one in sets]


def work(
    windows: RolloutWindows, model: Model, equations: Equations,
    remainders: tuple[Remainder, ...] = (), gains: Gains | None = None,
) -> int:  # fmt: skip
    """Return how many substeps a step of a roll-out takes, in all rounds that it usually needs."""
    rounds = _USUAL_ROUNDS if remembers(model, windows.motion) else 1
    return rounds * _Set(windows, model, equations, remainders, gains).substeps


class _Set:
    """Windows of one recording, their loads, and their latest roll-out.

    Args:
        windows: of the recording.
        model, equations, remainders, gains: as of `roll_out`.

    Attributes:
        dynamics: of the model.
        q: (m, n + 1, k) positions.
        ended: (m,) which windows ended as they should.
        is_done: whether another round would change nothing.
    """

    def __init__(
        self, windows: RolloutWindows, model: Model, equations: Equations,
        remainders: tuple[Remainder, ...], gains: Gains | None,
    ) -> None:  # fmt: skip
        motion = windows.motion
        dynamics = dynamics_of(model, equations, motion, remainders)
        self._effort = motion.effort
        if gains is not None:
            self._effort = self._effort + gains.kp * motion.position + gains.kd * motion.velocity
        springs = springs_of(model, motion)
        if springs:
            dynamics = ElasticDynamics.of(dynamics, springs, gains)
        elif gains is not None:
            dynamics = ServoedDynamics.of(dynamics, gains)
        self.windows, self.dynamics, self._model = windows, dynamics, model
        self._force = remembered_force(model, motion, dynamics.tree)
        self._ways = np.sqrt(windows.held.mean(axis=0) / windows.steps) + 1e-300
        self.q = np.full((*windows.nodes.shape, motion.position.shape[1]), np.nan)
        self.ended = np.zeros(len(windows.first), dtype=bool)
        self.is_done = False

    @property
    def loads(self) -> np.ndarray:
        """Loads during each step, (m, n, 2 k + 2), see `DiagnosedDynamics`."""
        motion = self.windows.motion
        recording = -np.ones(len(motion.time)) if motion.recording is None else motion.recording
        signals = self._effort, self._force, motion.time[:, None], recording[:, None]
        return np.concatenate([self.windows.means(x) for x in signals], axis=2)

    @cached_property
    def substeps(self) -> int:
        """How many substeps the fastest motion along the recording needs.

        The force of what remembers is an offset, and changes no rate from round to round.
        """
        windows, loads = self.windows, self.loads[:, ::4]
        rows = windows.nodes[:, :-1:4].ravel()
        last = self.dynamics.deflected(windows.motion, rows)
        some = np.concatenate([loads.reshape(len(rows), -1), last], axis=1)
        rate = self.dynamics.fastest_rate(*self.dynamics.started(windows.motion, rows), some)
        if not math.isfinite(rate):
            return 1
        return int(np.clip(math.ceil(rate * windows.step / _STABLE), 1, _MOST_SUBSTEPS))

    def take(self, q: np.ndarray, v: np.ndarray) -> None:
        """Take positions and velocities (m, n + 1, k) of a round, and what is remembered then."""
        finite = np.isfinite(q).all(axis=(1, 2)) & np.isfinite(v).all(axis=(1, 2))
        change = np.abs(q - self.q).max(axis=1)  # NaN in the first round, which settles nothing
        settled = finite & (change < CONVERGED * self._ways).all(axis=1)
        self.q, again = q, self._force
        if remembers(self._model, self.windows.motion):
            moved = _moved(self.windows, q, v, finite)
            again = remembered_force(self._model, moved, self.dynamics.tree)
        is_same = np.array_equal(again, self._force)
        self.is_done = is_same or bool(settled[finite].all())
        self.ended, self._force = finite if self.is_done else settled, again


def _rolled(sets: Sequence[_Set]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return positions and velocities (m, n + 1, k) of each set; those of one step go together."""
    alike: dict[tuple[float, float, int], list[int]] = {}
    for i in sorted(range(len(sets)), key=lambda i: -sets[i].windows.steps):
        one = sets[i]
        alike.setdefault((one.dynamics.step, one.windows.step, one.substeps), []).append(i)
    found: dict[int, tuple[np.ndarray, np.ndarray]] = {}
    for which in alike.values():
        found |= dict(zip(which, _together([sets[i] for i in which]), strict=True))
    return [found[i] for i in range(len(sets))]


def _together(sets: list[_Set]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return positions and velocities of sets, longest first, that take the same steps."""
    dynamics, substeps, loads, paths = sets[0].dynamics, sets[0].substeps, [], []
    for one in sets:
        loads.append(one.loads)
        nodes = one.windows.nodes
        start = one.dynamics.started(one.windows.motion, nodes[:, 0])
        path = np.full((2, *nodes.shape, start[0].shape[1]), np.nan)
        path[:, :, 0] = start
        paths.append(path)
    q, v = np.concatenate([path[:, :, 0] for path in paths], axis=1)
    last = np.concatenate([one.dynamics.deflected(one.windows.motion, one.windows.nodes[:, 0])
                           for one in sets])  # fmt: skip
    ends = np.cumsum([path.shape[1] for path in paths])
    with np.errstate(all='ignore'):  # a roll-out that diverges overflows, and is counted
        for i in range(sets[0].windows.steps):
            moving = sum(one.windows.steps > i for one in sets)
            now = np.concatenate([x[:, i] for x in loads[:moving]])
            now = np.concatenate([now, last[: len(now)]], axis=1)
            state = q[: len(now)], v[: len(now)]
            for _ in range(substeps):
                state = advance(dynamics, *state, now, sets[0].windows.step / substeps)
                now = dynamics.creeping(state[0], now)
            q, v = state
            last = now[:, now.shape[1] - last.shape[1] :]
            for path, end in zip(paths[:moving], ends, strict=False):
                path[:, :, i + 1] = q[end - path.shape[1] : end], v[end - path.shape[1] : end]
    return [(dynamics.shown(path[0]), dynamics.shown(path[1])) for path in paths]


def _moved(
    windows: RolloutWindows, q: np.ndarray, v: np.ndarray, finite: np.ndarray
) -> ObservedMotion:
    """Return the recording with the roll-outs in place of the windows."""
    motion = windows.motion
    rows = windows.rows[:, :-1]
    share = np.arange(rows.shape[1]) / windows.stride
    known = np.arange(windows.steps + 1)
    position, velocity, acceleration = (
        x.copy() for x in (motion.position, motion.velocity, motion.acceleration)
    )
    for w in np.flatnonzero(finite):
        for j in range(position.shape[1]):
            for x, rolled in ((position, q), (velocity, v)):
                change = rolled[w, :, j] - x[windows.nodes[w], j]
                x[rows[w], j] += np.interp(share, known, change)
            off = velocity[rows[w], j] - motion.velocity[rows[w], j]
            acceleration[rows[w], j] += np.gradient(off, motion.step)
    return replace(motion, position=position, velocity=velocity, acceleration=acceleration)
