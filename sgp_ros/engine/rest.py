"""Rest of joints in a window, where dry friction takes up what is needed.

While a joint rests, dry friction takes any value between those of sliding one way and the other.
The equation of a window is then an inequality: it holds for some force within that band, and only
what lies outside the band is an error.

A joint rests while its positions tell no direction of motion: their range is less than that of
motion at the width, the velocity over which the model lets dry friction change its sign, or than
their noise. It is taken over the time in which a motion of certain direction leaves the noise, and
over two intervals at least. The range of a quick reversal is larger.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
from numba import njit

from sgp_ros.gp.regression import OnlinePrediction, Regression
from sgp_ros.physics.term import Motion
from sgp_ros.robots.robot import Robot

_compiled: Callable[[Any], Any] = njit(cache=True, error_model='numpy')
_DEVIATIONS = 4.0
CERTAIN = 2.0
"""Velocity, over the width, at which dry friction has 96 % (tanh 2) of its level."""
_POINTS = 5
_PATIENCE = 10


class Averaging(Protocol):
    """How a window averages the equation of motion, as `weak_form.WeakForm`."""

    @property
    def times(self) -> np.ndarray:
        """Times of the samples, (m,) [s]."""

    @property
    def averaging(self) -> np.ndarray:
        """Shares of the samples, (m,)."""


def white_variance(times: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the squares of what a cubic leaves of five neighbours each, (m - 4, k).

    Their mean is the variance of white noise, for stamps (m,) of any spacing and x (m, k).
    """
    index = np.arange(len(times) - _POINTS + 1)[:, None] + np.arange(_POINTS)
    centred = times[index] - times[index].mean(axis=1, keepdims=True)
    scaled = centred / np.abs(centred).max(axis=1, keepdims=True)
    Q, _ = np.linalg.qr(scaled[:, :, None] ** np.arange(_POINTS - 1), mode='complete')
    left = np.einsum('nm,nmk->nk', Q[:, :, _POINTS - 1], x[index])
    return np.asarray(left * left)


def resting(times: np.ndarray, position: np.ndarray, width: float) -> np.ndarray:
    """Return where joints rest, (m, k).

    Args:
        times: (m,) [s].
        position: measured, (m, k) [rad or m].
        width: velocity below which dry friction has no certain direction [rad/s or m/s].
    """
    noise = np.zeros(position.shape[1])
    if len(times) >= _POINTS:
        noise = _DEVIATIONS * np.sqrt(2.0 * white_variance(times, position).mean(axis=0))
    rests = np.zeros(position.shape, dtype=bool)
    _mark(times, position, width, noise, clear_spans(noise, width), rests)
    return rests


def clear_spans(noise: np.ndarray, width: float) -> np.ndarray:
    """Return how long motion of certain direction takes to leave ranges of noise, (k,) [s]."""
    return noise / max(CERTAIN * width, np.finfo(float).tiny)


@_compiled
def _mark(
    times: np.ndarray, position: np.ndarray, width: float, noise: np.ndarray, spans: np.ndarray,
    rests: np.ndarray,
) -> None:  # fmt: skip
    """Mark stretches (m, k) about each sample, of `spans` (k,), in which a joint does not move."""
    m, k = position.shape
    for j in range(k):
        for i in range(1, m - 1):
            first, last = i - 1, i + 1
            while first > 0 and times[i] - times[first - 1] <= 0.5 * spans[j]:
                first -= 1
            while last < m - 1 and times[last + 1] - times[i] <= 0.5 * spans[j]:
                last += 1
            low = high = position[first, j]
            for x in position[first : last + 1, j]:
                low, high = min(low, x), max(high, x)
            if high - low < max(width * (times[last] - times[first]), noise[j]):
                rests[first : last + 1, j] = True


def friction_slack(
    robot: Robot, motion: Motion, measured: np.ndarray, form: Averaging
) -> np.ndarray | None:
    """Return what dry friction may add to the target of a window, from least to largest, (2, k).

    Args:
        robot: states which effects hold its joints.
        motion: smoothed positions and velocities of the window, (m, k), with its filtered
            acceleration and effort, (1, k).
        measured: positions, (m, k).
        form: of the window.

    Returns:
        None where no dry friction is stated, or all its joints move.
    """
    friction = robot.rest_friction
    if friction is None:
        return None
    rests = resting(form.times, measured, friction.coulomb_width)
    if not rests[:, sorted(friction.joints)].any():
        return None
    m = len(measured)
    whole = Motion(
        motion.position, motion.velocity,
        np.repeat(motion.acceleration, m, axis=0), np.repeat(motion.effort, m, axis=0),
    )  # fmt: skip
    return np.asarray(np.tensordot(friction(whole) * rests, form.averaging, axes=([1], [0])))


def is_enough(held: Sequence[np.ndarray], initial: int) -> bool:
    """Return whether equations suffice for a first model: so many of each joint that is not held.

    Args:
        held: of each equation, (k,) joints that dry friction may hold.
        initial: setting `learning.initial`. A joint that never moves is not waited for for ever.
    """
    free = len(held) - np.sum(held, axis=0)
    return bool(free.min() >= initial or len(held) >= _PATIENCE * initial > 0)


def free_targets(y: np.ndarray, held: np.ndarray) -> np.ndarray:
    """Return targets (n, k) where those of held joints (n, k) repeat the others of that joint.

    Their spread is that of a moving joint, and zero for one that never moved.
    """
    targets = y.copy()
    for j, rests in enumerate(held.T):
        moving = y[~rests, j]
        targets[rests, j] = np.resize(moving, rests.sum()) if len(moving) else 0.0
    return targets


def learnable(
    regression: Regression, prediction: OnlinePrediction, y: np.ndarray, held: np.ndarray
) -> tuple[OnlinePrediction, np.ndarray] | None:
    """Return the sample to learn from an equation, in which rows of held joints are zero.

    Such a row holds no information on W where the joint has no Z. A row that Z enters cannot be
    left out alone, because outputs share their samples.

    Args:
        regression: that made the prediction.
        prediction: of the whole equation.
        y: (k,) target.
        held: (k,) joints that dry friction may hold.

    Returns:
        What `regression.learn` takes; None where nothing can be learned.
    """
    if not held.any():
        return prediction, y
    if held.all() or any(regression.model.kernels[j] is not None for j in np.flatnonzero(held)):
        return None
    f = np.where(held[:, None], 0.0, prediction.f)
    return regression.with_regressor(prediction, f), np.where(held, 0.0, y)


def without_rest(
    slack: np.ndarray | None, mean: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the target beside what dry friction takes at rest, and the joints that it holds.

    Args:
        slack: (2, k) what it may add to the target, from least to largest; None where joints move.
        mean: (k,) predicted target.
        y: (k,) target.

    Returns:
        (k,) target that only differs from `mean` by what lies outside the band, and (k,) whether
        nothing does.
    """
    if slack is None:
        return y, np.zeros(len(y), dtype=bool)
    low, high = slack
    needed = mean - y
    return y + np.clip(needed, low, high), (low < needed) & (needed < high)
