"""Whether a recording holds motion and efforts that a robot can be identified from."""

from __future__ import annotations

import numpy as np

from sgp_ros.batch.signals import Signals
from sgp_ros.errors import RecordingError
from sgp_ros.robots.robot import Robot

_NOISE = 0.5
"""Correlation from state to state below which a position is noise around one place: motion that
is sampled often enough to be differentiated has nearly 1, white noise 0."""


def require_motion(signals: Signals, robot: Robot) -> None:
    """Refuse a recording of a robot that stands still or has no effort. O(n k).

    A joint that stands still beside others that move is no reason; an effort that is one number
    throughout is, where it is what f(u) W predicts: its joint is not measured.

    Args:
        signals: of the recording.
        robot: whose joints they are.

    Raises:
        RecordingError: no joint moves, or the effort of an actuated joint never changes.
    """
    names = list(robot.joint_names)
    if not any(_moves(q) for q in signals.position.T):
        raise RecordingError(
            f'none of the joints {names} moves beyond noise',
            'a robot in motion',
            'record the robot while it moves',
        )
    if robot.target != 'effort':
        return
    actuated = [j for j, joint in enumerate(robot.joints) if joint.is_actuated]
    constant = [names[j] for j in actuated if not np.ptp(signals.effort[:, j])]
    if constant or not actuated:
        raise RecordingError(
            f'the effort of {constant or names} never changes',
            'measured or commanded efforts of the joints that are identified',
            'record them, or leave such joints out of the robot file',
        )


def _moves(q: np.ndarray) -> bool:
    centred = q - q.mean()
    power = float(centred @ centred)
    return bool(np.ptp(q) > 0.0) and float(centred[1:] @ centred[:-1]) > _NOISE * power
