"""Windows of recordings that roll-outs are started from, on a common grid of time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sgp_ros.errors import RecordingError

_HORIZONS_A_BLOCK = 2


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
        raise RecordingError('values that are not finite', 'numbers', 'cut them out')
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
