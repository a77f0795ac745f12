"""Roll-outs: the identified robot simulated under recorded efforts.

Many roll-outs that start at different times run in lock-step, so that the cost of a step is that
of one call of the regressor for all of them. The integrator is the classical Runge-Kutta method of
order four between the moments at which a joint with dry friction stops; these moments are found
by a linear interpolation of the velocity, exact to the order of the step squared. In a step of a
millisecond or less such a joint stops at the end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sgp_ros.batch.forward import (
    DryFriction,
    Dynamics,
    ForcedMotion,
    Residual,
    acceleration_under,
    dry_friction,
)
from sgp_ros.errors import RecordingError
from sgp_ros.robots.robot import Robot

_HORIZONS_A_BLOCK = 2
_SHORT_S = 1e-3
"""Step up to which it makes no difference when within it a joint stops [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class Windows:
    """m stretches of recordings on a common grid of n steps, each the truth of one roll-out.

    Attributes:
        q: measured positions at the ends of steps, (m, n + 1, k) [rad or m].
        v: measured velocities, (m, n + 1, k) [rad/s or m/s].
        effort: mean over each step, (m, n, k) [N m, N or the joint's command unit].
        step: length of a step [s].
        block: (m,) labels of the stretch of two horizons in which a window starts: errors of
            one block are dependent, those of two blocks are taken as independent.
    """

    q: np.ndarray
    v: np.ndarray
    effort: np.ndarray
    step: float
    block: np.ndarray

    @property
    def horizon(self) -> float:
        """Length of a window [s]."""
        return self.effort.shape[1] * self.step


def cut_windows(
    time: np.ndarray,
    q: np.ndarray,
    v: np.ndarray,
    effort: np.ndarray,
    horizon: float | None,
    stride: float,
    step: float | None = None,
) -> Windows:
    """Cut one recording into windows that start every `stride`.

    The stamps need not be uniform: positions and velocities are interpolated, and efforts, taken
    as linear between samples, are averaged over each step exactly. O(m n).

    Args:
        time: (s,) stamps, increasing [s].
        q: (s, k) [rad or m].
        v: (s, k) [rad/s or m/s].
        effort: (s, k) [N m, N or the joint's command unit].
        horizon: length of a window [s], at least one step; None for the whole recording.
        stride: between starts [s].
        step: of the grid [s]; None for the median of the recording.

    Raises:
        RecordingError: values that are not finite, stamps that do not increase, or a recording
            shorter than the horizon.
        ValueError: shapes that do not belong together, or no positive stride or step.
    """
    _check(time, q, v, effort)
    h = float(np.median(np.diff(time))) if step is None else step
    if not h > 0.0 or not stride > 0.0:
        raise ValueError(f'step {h}, stride {stride}')
    length = float(time[-1] - time[0])
    n = int(length / h + 1e-6) if horizon is None else max(1, round(horizon / h))
    room = length - n * h
    if n < 1 or room < -1e-6 * h:
        raise RecordingError(
            f'a recording of {length:g} s', f'{max(n, 1) * h:g} s or more', 'shorten the horizon'
        )
    starts = stride * np.arange(int(max(room, 0.0) / stride + 1e-9) + 1)  # (m,)
    nodes = time[0] + starts[:, None] + h * np.arange(n + 1)  # (m, n + 1)
    return Windows(
        q=_interpolated(nodes, time, q),
        v=_interpolated(nodes, time, v),
        effort=np.diff(_integral(nodes, time, effort), axis=1) / h,
        step=h,
        block=(starts / (_HORIZONS_A_BLOCK * n * h)).astype(np.int64),
    )


def joined(windows: Sequence[Windows]) -> Windows:
    """Return the windows of several recordings as one set, with blocks of their own.

    Raises:
        ValueError: none, or sets of different steps or horizons.
    """
    if len({(w.step, w.effort.shape[1:]) for w in windows}) != 1:
        raise ValueError(f'steps and shapes {[(w.step, w.effort.shape) for w in windows]}')
    blocks: list[np.ndarray] = []
    for w in windows:
        first = blocks[-1].max() + 1 if blocks else 0
        blocks.append(w.block + first)
    return Windows(
        q=np.concatenate([w.q for w in windows]),
        v=np.concatenate([w.v for w in windows]),
        effort=np.concatenate([w.effort for w in windows]),
        step=windows[0].step,
        block=np.concatenate(blocks),
    )


def _check(time: np.ndarray, q: np.ndarray, v: np.ndarray, effort: np.ndarray) -> None:
    if not (time.ndim == 1 and q.shape == v.shape == effort.shape and len(q) == len(time)):
        raise ValueError(f'time {time.shape}, q {q.shape}, v {v.shape}, effort {effort.shape}')
    if not all(np.isfinite(x).all() for x in (time, q, v, effort)):
        raise RecordingError('values that are not finite', 'finite numbers', 'remove them')
    if len(time) < 2 or not np.all(np.diff(time) > 0.0):
        raise RecordingError('stamps that do not increase', 'two or more increasing stamps')


def _interpolated(nodes: np.ndarray, time: np.ndarray, x: np.ndarray) -> np.ndarray:
    return np.stack([np.interp(nodes, time, column) for column in x.T], axis=-1)


def _integral(nodes: np.ndarray, time: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Integral from the first stamp of what is linear between samples, at nodes; (*, k)."""
    pieces = 0.5 * (x[1:] + x[:-1]) * np.diff(time)[:, None]
    whole = np.vstack([np.zeros((1, x.shape[1])), np.cumsum(pieces, axis=0)])
    i = np.clip(np.searchsorted(time, nodes, side='right') - 1, 0, len(time) - 2)
    late = (np.minimum(nodes, time[-1]) - time[i])[..., None]
    slope = ((x[1:] - x[:-1]) / np.diff(time)[:, None])[i]
    return whole[i] + late * (x[i] + 0.5 * late * slope)


def roll_out(
    robot: Robot,
    W: np.ndarray,
    start_q: np.ndarray,
    start_v: np.ndarray,
    effort: np.ndarray,
    dt: float,
    substeps: int = 1,
    residual: Residual | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Simulate m roll-outs of n steps in parallel.

    A substep must resolve what the columns do with velocity: for friction written as
    `tanh(v / width)` with level F on an inertia J, `dt / substeps < 2.7 J width / F`. Friction
    written as `sign(v)` has no such limit: a joint at rest sticks, see `dry_friction`. O(n m)
    regressors.

    Args:
        robot: physics of k joints, linear in W.
        W: (p,) [unit of each coefficient].
        start_q: (m, k) [rad or m].
        start_v: (m, k) [rad/s or m/s].
        effort: (m, n, k), constant during each step [N m, N or the joint's command unit].
        dt: length of a step [s].
        substeps: of the integrator in each step.
        residual: mean of Z from q (m, k) and v (m, k) to (m, k) [unit of the target].

    Returns:
        Positions and velocities at the start and after each step, both (m, n + 1, k); not a
        number from where a roll-out left the range of floating-point numbers.

    Raises:
        ValueError: shapes that do not belong together, or no positive step.
    """
    m, n, k = effort.shape
    if start_q.shape != (m, k) or start_v.shape != (m, k) or k != len(robot.joints):
        raise ValueError(f'start {start_q.shape}, {start_v.shape}, effort {effort.shape}')
    if not dt > 0.0 or substeps < 1:
        raise ValueError(f'dt {dt}, substeps {substeps}')
    dynamics = Dynamics(robot, W, residual)
    q, v = np.full((2, m, n + 1, k), np.nan)
    q[:, 0], v[:, 0] = start_q, start_v
    with np.errstate(all='ignore'):  # a roll-out that diverges overflows, and is reported so
        for i in range(n):
            state = q[:, i], v[:, i]
            for _ in range(substeps):
                state = advance(dynamics, *state, effort[:, i], dt / substeps)
            q[:, i + 1], v[:, i + 1] = state
    return q, v


def advance(
    dynamics: ForcedMotion, q: np.ndarray, v: np.ndarray, effort: np.ndarray, h: float
) -> tuple[np.ndarray, np.ndarray]:
    """Take one step of m states, cut where joints with dry friction stop, 2 k times at most.

    Args:
        dynamics: of k joints.
        q: (m, k) [rad or m].
        v: (m, k) [rad/s or m/s].
        effort: (m, ...), constant during the step.
        h: length of the step [s]; joints that stop in a short one are at rest only at its end.

    Returns:
        positions and velocities after it; those of rows that are not finite stay as they are.
    """
    q, v = q.copy(), v.copy()
    left = np.full((len(q), 1), h)
    rows = np.flatnonzero(np.isfinite(q).all(axis=1) & np.isfinite(v).all(axis=1))
    cuts = 2 * q.shape[1] if h > _SHORT_S else 0
    for cuts_left in reversed(range(cuts + 1)):
        if not len(rows):
            break
        start = q[rows], v[rows], effort[rows]
        friction = dry_friction(dynamics, *start)
        q1, v1 = _runge_kutta(dynamics, friction, *start, left[rows])
        moment = _moment_of_stop(start[1], v1, friction.side)
        share = moment.min(axis=1, keepdims=True)  # (rows, 1)
        stops = moment < 1.0
        if cuts_left and stops.any():
            q1, v1 = _runge_kutta(dynamics, friction, *start, share * left[rows])
            stops &= moment == share
        q[rows], v[rows] = q1, np.where(stops, 0.0, v1)
        left[rows] *= 1.0 - share
        rows = rows[share[:, 0] < 1.0]
    return q, v


def _moment_of_stop(v: np.ndarray, v1: np.ndarray, side: np.ndarray) -> np.ndarray:
    """Share of the step after which each joint with dry friction stops; 1 where none does."""
    stops = side * v1 < 0.0
    return np.divide(v, v - v1, out=np.ones_like(v), where=stops)


def _runge_kutta(
    dynamics: ForcedMotion,
    friction: DryFriction,
    q: np.ndarray,
    v: np.ndarray,
    effort: np.ndarray,
    h: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Step of the classical method with the state of dry friction held; h is (m, 1)."""

    def a(q: np.ndarray, v: np.ndarray) -> np.ndarray:
        return acceleration_under(dynamics, friction, q, v, effort)

    a1 = a(q, v)
    v2 = v + 0.5 * h * a1
    a2 = a(q + 0.5 * h * v, v2)
    v3 = v + 0.5 * h * a2
    a3 = a(q + 0.5 * h * v2, v3)
    v4 = v + h * a3
    a4 = a(q + h * v3, v4)
    ended = q + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
    return ended, v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
