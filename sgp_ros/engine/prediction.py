"""Predictions of both sides of the equation of motion: of the target, and from it of the other.

The model predicts its target for given complement signals c, affinely in the physics:
`target = m(c) + e`, `e ~ N(0, S)`. Given the measured target, c is the generalised least-squares
estimate with slope `B = dm/dc`: covariance `(B^T S^-1 B)^-1`. Once earlier signals give a prior
of c, it is the posterior instead. Where Z sees c, the estimate is iterated from the physics alone
or from the prior, never from the measured c.

Only the exact mode drops samples from a factor, the one step that loses digits. The features of a
basis stay as they are, and equations enter its triangles by rotations alone: nothing to check.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from sgp_ros.engine.results import Channel, Counts, Estimate
from sgp_ros.engine.windows import Equation
from sgp_ros.errors import NumericalError
from sgp_ros.gp.linear_algebra import covariance_factor, svd
from sgp_ros.gp.online import OnlineRegression
from sgp_ros.gp.regression import OnlinePrediction, Regression
from sgp_ros.robots.robot import Robot

TargetPrediction = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""From complement signals (c,) to mean (k,) and covariance (k, k) of the target, with noise."""


def predict_soundly(
    regression: Regression, u: np.ndarray, f: np.ndarray, counts: Counts
) -> OnlinePrediction:
    """Predict; where rotations have lost a factor, compute it anew from the buffer first.

    A prediction that is unsound with a fresh factor too comes from the input: it repeats others.
    """
    prediction = regression.predict(u, f)
    if (
        not isinstance(regression, OnlineRegression)
        or regression.is_sound(prediction)
        or not regression.rotated
    ):
        return prediction
    try:
        regression.refresh()
    except NumericalError:
        return prediction
    again = regression.predict(u, f)
    counts.factor_rebuilt += regression.is_sound(again)
    return again


def check_factor(regression: Regression, counts: Counts) -> None:
    """Compare the factors with fresh ones, which then take their place."""
    if not isinstance(regression, OnlineRegression):
        return
    try:
        drift = regression.refresh()
    except NumericalError:
        return
    counts.factor_checks += 1
    counts.factor_drift = max(counts.factor_drift, drift)


def weighted(
    weight: np.ndarray,
    model: tuple[Regression, OnlinePrediction],
    physics: tuple[Regression, OnlinePrediction] | None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return mean (k,) and covariance (k, k) of the target, noise included.

    The mean is weighted; the covariance is that of the model, which later errors calibrate.

    Args:
        weight: of Z for each joint, (k,).
        model: with Z.
        physics: without; None where there is none.
    """
    regression, prediction = model
    mean = prediction.mean
    if physics is not None and np.any(weight < 1.0):
        mean = mean + (1.0 - weight) * (physics[1].mean - mean)
    return mean, prediction.covariance + np.diag(regression.model.noise)


_LEAST_RECIPROCAL_CONDITION = 1e-12


def solve_complement(
    target: np.ndarray,
    slope: np.ndarray,
    noise: np.ndarray,
    start: np.ndarray,
    predict: TargetPrediction,
    iterations: int,
) -> tuple[np.ndarray, np.ndarray] | None:
    """Estimate the complement signals that explain the measured target.

    Args:
        target: (k,) measured.
        slope: (k, c) change of the mean per unit of each signal.
        noise: (k,) variances of the observation.
        start: (k,) mean of the target at c = 0 under the physics alone.
        predict: from c (c,) to mean and covariance of the target, noise included.
        iterations: of the prediction; one is exact where Z does not see c.

    Returns:
        Mean (c,) and covariance (c, c); None where the slope or the prediction leaves c
        undetermined.
    """
    whitening = np.diag(1.0 / np.sqrt(noise))
    solved = _least_squares(slope, target - start, whitening)
    if solved is None:
        return None
    signal, covariance = solved
    for _ in range(iterations):
        mean, total = predict(signal)
        if not np.all(np.isfinite(np.diag(total))):
            return None
        try:
            whitening = np.linalg.inv(covariance_factor(total))
        except NumericalError:
            return None
        solved = _least_squares(slope, target - mean, whitening)
        if solved is None:
            return None
        correction, covariance = solved
        signal = signal + correction
    return signal, covariance


def update_complement(
    prior: tuple[np.ndarray, np.ndarray],
    target: np.ndarray,
    slope: np.ndarray,
    predict: TargetPrediction,
    iterations: int,
) -> tuple[np.ndarray, np.ndarray] | None:
    """Update a prior of the complement signals by the measured target.

    A torque residual divided by a small inertia is not an acceleration: where the target holds
    little information on a signal, the prior keeps it. With gain `K = P B^T (B P B^T + S)^-1` the
    mean is `c_0 + K (target - m(c_0))`, the covariance `(I - K B) P (I - K B)^T + K S K^T`.

    Args:
        prior: mean c_0 (c,) and covariance P (c, c).
        target: (k,) measured.
        slope: B (k, c), change of the mean per unit of each signal.
        predict: from c (c,) to mean m and covariance S of the target, noise included.
        iterations: of the linearisation; one is exact where Z does not see c.

    Returns:
        Mean (c,) and covariance (c, c); None where the prediction is undetermined.
    """
    start, P = prior
    signal = start
    for _ in range(iterations):
        mean, S = predict(signal)
        if not (np.isfinite(S).all() and np.isfinite(slope).all()):
            return None
        innovation = target - mean - slope @ (start - signal)
        try:
            gain = np.linalg.solve(slope @ P @ slope.T + S, slope @ P).T
        except np.linalg.LinAlgError:
            return None
        signal = start + gain @ innovation
    rest = np.eye(len(start)) - gain @ slope
    return signal, rest @ P @ rest.T + gain @ S @ gain.T


def _least_squares(
    slope: np.ndarray, residual: np.ndarray, whitening: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    white = whitening @ slope  # (k, c)
    U, S, Vt = svd(white)
    if len(S) < slope.shape[1] or not S[-1] > _LEAST_RECIPROCAL_CONDITION * S[0]:
        return None
    spread = Vt.T / S
    return spread @ (U.T @ (whitening @ residual)), spread @ spread.T


def estimated(
    robot: Robot,
    equation: Equation,
    channels: Mapping[str, Channel] | None = None,
    *,
    is_scored: bool = False,
    is_learned: bool = False,
) -> Estimate:
    """Return the estimate of an equation; without channels nothing was predicted."""
    motion = equation.motion
    if channels is None:
        channels = {
            name: Channel.unknown(getattr(motion, name)[0]) for name in ('acceleration', 'effort')
        }
    return Estimate(
        equation.stamp_ns,
        robot.joint_names,
        motion.position[0],
        motion.velocity[0],
        channels['acceleration'],
        channels['effort'],
        is_scored,
        is_learned,
    )
