"""Roll-outs of a diagnosed model from measured states under recorded commands.

A one-step error says little: the state hardly moves in a step. Windows of 0.3 s are simulated all
at once from where they start, and compared with what was measured. The yardstick is the error of
holding the position at the start of the window: 1 knows nothing of the robot.

The force of an effect that remembers depends on the motion before. It is taken along the motion
that was rolled out last, and the windows are rolled out again until nothing changes: the causal
fixed point of Picard's iteration. Windows start from what was measured, and so do their memories,
up to the error with which the window before ends.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.batch.rollout import advance
from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.locate.remainder import Remainder
from sgp_ros.diagnosis.prove.dynamics import (
    DiagnosedDynamics,
    ServoedDynamics,
    dynamics_of,
    remembered_force,
)
from sgp_ros.diagnosis.prove.elastic import ElasticDynamics, springs_of
from sgp_ros.robots.gains import Gains
from sgp_ros.robots.observed_motion import ObservedMotion

HORIZON_S = 0.3
STEP_S = 0.005
MOST_WINDOWS = 200
MOST_ROUNDS = 12
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
    motion = windows.motion
    dynamics = dynamics_of(model, equations, motion, remainders)
    effort = motion.effort
    if gains is not None:
        effort = effort + gains.kp * motion.position + gains.kd * motion.velocity
    springs = springs_of(model, motion)
    if springs:
        dynamics = ElasticDynamics.of(dynamics, springs, gains)
    elif gains is not None:
        dynamics = ServoedDynamics.of(dynamics, gains)
    force = remembered_force(model, motion, dynamics.tree)
    ways = np.sqrt(windows.held.mean(axis=0) / windows.steps) + 1e-300
    before, settled = None, np.zeros(len(windows.first), dtype=bool)
    for _ in range(MOST_ROUNDS):
        q, v = _rolled(windows, dynamics, force, effort)
        finite = np.isfinite(q).all(axis=(1, 2)) & np.isfinite(v).all(axis=(1, 2))
        if before is not None:
            settled = finite & (np.abs(q - before).max(axis=1) < CONVERGED * ways).all(axis=1)
        again = remembered_force(model, _moved(windows, q, v, finite), dynamics.tree)
        if np.array_equal(again, force) or settled[finite].all():
            return q, finite
        before, force = q, again
    return q, settled


def _rolled(
    windows: RolloutWindows, dynamics: DiagnosedDynamics, force: np.ndarray, effort: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    motion, nodes = windows.motion, windows.nodes
    recording = -np.ones(len(motion.time)) if motion.recording is None else motion.recording
    loads = np.concatenate(
        [
            windows.means(effort), windows.means(force),
            windows.means(motion.time[:, None]), windows.means(recording[:, None]),
        ],
        axis=2,
    )  # (m, n, 2 k + 2)  # fmt: skip
    h = windows.stride * motion.step
    substeps = _substeps(dynamics, windows, loads, h)
    start = dynamics.started(motion, nodes[:, 0])
    q, v = (np.full((*nodes.shape, start[0].shape[1]), np.nan) for _ in range(2))
    q[:, 0], v[:, 0] = start
    with np.errstate(all='ignore'):  # a roll-out that diverges overflows, and is counted
        for i in range(windows.steps):
            state = q[:, i], v[:, i]
            for _ in range(substeps):
                state = advance(dynamics, *state, loads[:, i], h / substeps)
            q[:, i + 1], v[:, i + 1] = state
    return dynamics.shown(q), dynamics.shown(v)


def _substeps(
    dynamics: DiagnosedDynamics, windows: RolloutWindows, loads: np.ndarray, h: float
) -> int:
    """Return how many substeps the fastest motion along the recording needs."""
    rows = windows.nodes[:, :-1:4].ravel()
    motion = windows.motion
    some = loads[:, ::4].reshape(-1, loads.shape[2])
    rate = dynamics.fastest_rate(*dynamics.started(motion, rows), some)
    if not math.isfinite(rate):
        return 1
    return int(np.clip(math.ceil(rate * h / _STABLE), 1, _MOST_SUBSTEPS))


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
