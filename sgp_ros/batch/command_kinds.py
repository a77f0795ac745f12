"""What held commands are, as the motion shows: efforts, or targets of position."""

from __future__ import annotations

import numpy as np

from sgp_ros.batch.acceptance import Accepted
from sgp_ros.robots.robot import Robot

_COMMON_SHARE = 0.5
_LONGEST_LAG_S, _LAGS = 0.2, 41
_LEAST_EXPLAINED = 0.5
_GAINS = (0.25, 1.5)
"""Of a measured effort on an effort commanded: dead zone and saturation lower it."""

_UNIT, _NEAR, _MOST_EXPLAINED = (0.95, 1.05), 0.2, 0.995
"""Slope, distance of the means in standard deviations, and share of a position on its target."""


def are_efforts(accepted: Accepted, robot: Robot) -> bool:
    """Return whether the measured efforts follow the commands as a drive lets them follow.

    On most of the actuated joints a straight line on the command, delayed by at most 0.2 s, must
    explain half of the variance of the measured effort, with a slope of about one, and more than
    it explains of the variance of the position, which is what a commanded position would do.
    Delay, lag, dead zone and saturation of a drive leave that much.

    Args:
        accepted: with commands, and measured efforts in some states.
        robot: whose joints they are.
    """
    rows = np.flatnonzero(accepted.is_measured)
    assert accepted.commands is not None
    stamps, effort, position = (
        x[rows] for x in (accepted.stamps_ns, accepted.effort, accepted.position)
    )
    delays = np.round(np.linspace(0.0, _LONGEST_LAG_S * 1e9, _LAGS)).astype(np.int64)
    commands = np.array([accepted.commands.at(stamps - delay) for delay in delays])
    follows = []
    for j, joint in enumerate(robot.joints):
        u = commands[:, :, j]
        if joint.is_actuated and (np.ptp(u) > 0.0 or np.ptp(effort[:, j]) > 0.0):
            explained, slope = _best_line(u, effort[:, j])
            rival, _ = _best_line(u, position[:, j])
            is_unit = _GAINS[0] <= slope <= _GAINS[1]
            follows.append(is_unit and explained > max(_LEAST_EXPLAINED, rival))
    return bool(follows) and float(np.mean(follows)) > _COMMON_SHARE


def are_positions(accepted: Accepted, robot: Robot) -> bool:
    """Return whether the commands are targets of position: the positions themselves follow them.

    On most of the actuated joints the position is the delayed command, on a line of slope one
    through zero, which an effort is only by accident.

    Args:
        accepted: with commands.
        robot: whose joints they are.
    """
    assert accepted.commands is not None
    stamps, position = accepted.stamps_ns, accepted.position
    delays = np.round(np.linspace(0.0, _LONGEST_LAG_S * 1e9, _LAGS)).astype(np.int64)
    commands = np.array([accepted.commands.at(stamps - delay) for delay in delays])
    follows = []
    for j, joint in enumerate(robot.joints):
        u, q = commands[:, :, j], position[:, j]
        if joint.is_actuated and np.ptp(q) > 0.0:
            explained, slope = _best_line(u, q)
            apart = abs(float(u.mean() - q.mean())) < _NEAR * float(q.std())
            is_unit = _UNIT[0] <= slope <= _UNIT[1]
            follows.append(is_unit and apart and explained > _MOST_EXPLAINED)
    return bool(follows) and float(np.mean(follows)) > _COMMON_SHARE


def _best_line(u: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """Return the share of the variance of y (n,) that a line on a row of u (m, n) explains.

    The best row is taken, and its slope returned.
    """
    du, dy = u - u.mean(axis=1, keepdims=True), y - y.mean()
    powers, power = (du * du).sum(axis=1), float(dy @ dy)
    products = du @ dy
    valid = powers > 0.0
    if power == 0.0 or not valid.any():
        return 0.0, 0.0
    slopes = products[valid] / powers[valid]
    shares = slopes * products[valid] / power
    best = int(shares.argmax())
    return float(shares[best]), float(slopes[best])
