"""States that the joints of a robot cannot have, by the limits of its model file."""

from __future__ import annotations

import numpy as np

from sgp_ros.engine.gate_loops import NOTHING, is_within
from sgp_ros.robots.robot import Robot

LIMIT_MARGIN = 3.0
"""Speeds and efforts beyond this many times their limit are impossible."""
PERSISTENT = 100
"""States too many beyond the limits, from which on these are taken for wrong, not the states."""
RARE = 10
"""States within the limits that make up for one beyond: a sensor may err in one of eleven."""


class Limits:
    """Impossible motions of a robot's joints: far more than its model file permits.

    Limits of model files are those of controllers, and often conservative; so `LIMIT_MARGIN` times
    them is impossible, and a position as far beyond its range as the range is long. Many files
    state limits that are not real: once a motion has passed them again and again, they no longer
    hold.

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
        self._bounds = np.array([
            np.where(is_bounded, lower - reach, -np.inf),
            np.where(is_bounded, upper + reach, np.inf),
            *([_margin(getattr(joint, name)) for joint in joints]
              for name in ('velocity_limit', 'effort_limit')),
        ])  # fmt: skip
        self._are_any = bool(np.isfinite(self._bounds).any())
        self.impossible = 0

    def permit(
        self, position: np.ndarray, velocity: np.ndarray | None, effort: np.ndarray | None
    ) -> bool:
        """Whether a state, (k,) each, is possible, or the limits are wrong."""
        if not self._are_any or self.impossible > RARE * PERSISTENT:
            return True
        is_possible: bool = is_within(
            position,
            NOTHING if velocity is None else velocity,
            NOTHING if effort is None else effort,
            self._bounds,
        )
        self.impossible = max(self.impossible - 1, 0) if is_possible else self.impossible + RARE
        return is_possible


def _margin(limit: float) -> float:
    return LIMIT_MARGIN * limit if limit > 0.0 else np.inf  # 0 means no limit in many files
