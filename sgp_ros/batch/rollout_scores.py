"""How far roll-outs end up from what was measured, beside holding the state they start from.

The error of a one-step prediction says little about a model: the state hardly moves in one step.
A roll-out adds up what the model gets wrong. Its yardstick is the error of holding the position
at the start of the roll-out: 1 is as good as knowing nothing of the robot.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sgp_ros.batch.forward import Residual
from sgp_ros.batch.rollout import Windows, cut_windows, roll_out
from sgp_ros.robots.robot import Robot


@dataclass(frozen=True, slots=True, eq=False)
class RolloutScore:
    """Errors of the positions of m roll-outs, per joint.

    Attributes:
        horizon: length of a roll-out [s].
        n: roll-outs, m.
        diverged: how many of them left the range of numbers; they are in no mean.
        nmse_end: mean squared error at the end over that of holding the start, (k,).
        nmse_path: likewise, over all steps.
        rms_end: root of the mean squared error at the end, (k,) [rad or m].
        rms_path: likewise, over all steps.
    """

    horizon: float
    n: int
    diverged: int
    nmse_end: np.ndarray
    nmse_path: np.ndarray
    rms_end: np.ndarray
    rms_path: np.ndarray


def score_windows(
    windows: Windows,
    robot: Robot,
    W: np.ndarray,
    substeps: int = 1,
    residual: Residual | None = None,
) -> RolloutScore:
    """Roll out from the start of every window and compare with the rest of it.

    Args:
        windows: m of n steps.
        robot: physics of k joints, linear in W.
        W: (p,) [unit of each coefficient].
        substeps: of the integrator in each step.
        residual: mean of Z from q and v [unit of the target].

    Returns:
        Scores that are not numbers where every roll-out diverged or nothing moved.
    """
    q, v = roll_out(
        robot, W, windows.q[:, 0], windows.v[:, 0], windows.effort, windows.step, substeps,
        residual,
    )  # fmt: skip
    stays = np.isfinite(q).all(axis=(1, 2)) & np.isfinite(v).all(axis=(1, 2))
    truth = windows.q[stays]
    error = (q[stays] - truth)[:, 1:] ** 2
    held = (truth[:, :1] - truth)[:, 1:] ** 2
    return RolloutScore(
        horizon=windows.horizon,
        n=len(q),
        diverged=int(len(q) - stays.sum()),
        nmse_end=_ratio(error[:, -1].sum(axis=0), held[:, -1].sum(axis=0)),
        nmse_path=_ratio(error.sum(axis=(0, 1)), held.sum(axis=(0, 1))),
        rms_end=np.sqrt(_ratio(error[:, -1].sum(axis=0), stays.sum())),
        rms_path=np.sqrt(_ratio(error.sum(axis=(0, 1)), stays.sum() * error.shape[1])),
    )


def rollout_scores(
    time: np.ndarray,
    q: np.ndarray,
    v: np.ndarray,
    effort: np.ndarray,
    robot: Robot,
    W: np.ndarray,
    horizons: Sequence[float | None] = (0.0, 0.3, None),
    stride: float = 0.1,
    step: float | None = None,
    residual: Residual | None = None,
) -> tuple[RolloutScore, ...]:
    """Return the scores of one recording, one for each horizon.

    Args:
        time: (s,) stamps, increasing [s].
        q: (s, k) measured, smoothed if noise matters: roll-outs start there and are compared
            with it [rad or m].
        v: (s, k) likewise [rad/s or m/s].
        effort: (s, k) [N m, N or the joint's command unit].
        robot: physics of k joints, linear in W.
        W: (p,) [unit of each coefficient].
        horizons: lengths of roll-outs [s]; 0 for one step, None for the whole recording.
        stride: between starts [s].
        step: of the integrator [s]; None for the median of the recording.
        residual: mean of Z from q and v [unit of the target].

    Raises:
        RecordingError: see `cut_windows`.
    """
    return tuple(
        score_windows(
            cut_windows(time, q, v, effort, horizon, stride, step), robot, W, residual=residual
        )
        for horizon in horizons
    )


def _ratio(a: np.ndarray, b: np.ndarray | int) -> np.ndarray:
    return np.divide(a, b, out=np.full_like(a, np.nan), where=np.asarray(b) > 0)
