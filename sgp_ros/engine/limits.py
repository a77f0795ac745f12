"""States that the joints of a robot cannot have, by the limits of its model file."""

from __future__ import annotations

from collections.abc import Iterable
from operator import le

import numpy as np

from sgp_ros.robots.robot import Robot

LIMIT_MARGIN = 3.0
"""Speeds and efforts beyond this many times their limit are impossible."""
PERSISTENT = 100
"""States too many beyond the limits, from which on these are taken for wrong, not the states."""
RARE = 10
"""States within the limits that make up for one beyond: a sensor may err in one of eleven."""


class Limits:
    """What the joints of a robot cannot do: far more than its model file permits.

    Limits of model files are those of controllers, and often conservative; so `LIMIT_MARGIN` times
    them is impossible, and a position as far beyond its range as the range is long. Those of many
    files stand for none: a motion passes them again and again, and then they hold no more.

    Attributes:
        impossible: `RARE` for each state beyond the limits, less one for each within.

    Args:
        robot: of k joints.
    """

    def __init__(self, robot: Robot) -> None:
        joints = robot.joints
        lower, upper = (np.array([getattr(j, n) for j in joints]) for n in ('lower', 'upper'))
        is_bounded = np.isfinite(lower) & np.isfinite(upper) & (upper > lower)
        reach = np.where(is_bounded, upper - lower, 0.0)
        self._low = np.where(is_bounded, lower - reach, -np.inf).tolist()
        self._high = np.where(is_bounded, upper + reach, np.inf).tolist()
        self._speed, self._effort = (
            [_margin(getattr(joint, name)) for joint in joints]
            for name in ('velocity_limit', 'effort_limit')
        )
        limits = [*self._high, *self._speed, *self._effort]
        self._are_any = bool(np.isfinite(limits).any())
        self.impossible = 0

    def permit(
        self, position: np.ndarray, velocity: np.ndarray | None, effort: np.ndarray | None
    ) -> bool:
        """Whether a state, (k,) each, is possible, or the limits are wrong."""
        if not self._are_any or self.impossible > RARE * PERSISTENT:
            return True
        places = position.tolist()
        is_within = (
            _are_below(self._low, places)
            and _are_below(places, self._high)
            and (velocity is None or _are_below(map(abs, velocity.tolist()), self._speed))
            and (effort is None or _are_below(map(abs, effort.tolist()), self._effort))
        )
        self.impossible = max(self.impossible - 1, 0) if is_within else self.impossible + RARE
        return is_within


def _are_below(numbers: Iterable[float], bounds: Iterable[float]) -> bool:
    return all(map(le, numbers, bounds))  # of a few numbers, faster than arrays


def _margin(limit: float) -> float:
    return LIMIT_MARGIN * limit if limit > 0.0 else np.inf  # 0 stands for none in many files
