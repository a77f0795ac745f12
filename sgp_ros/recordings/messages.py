"""Turn ROS messages into the stamped samples of the engine.

A message is read by its fields only, so the same functions serve messages of rclpy (in the node)
and of rosbags (in a replay): what is live and what is replayed cannot differ here. NaN stays in a
sample, the engine refuses and counts it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from sgp_ros.engine.samples import CommandSample, JointSample, frozen_array
from sgp_ros.errors import MessageError

Message = Any
"""A ROS message of any library; its fields are those of its definition."""

JOINT_STATE = 'sensor_msgs/JointState'
FLOAT64 = 'std_msgs/Float64'
FLOAT64_ARRAY = 'std_msgs/Float64MultiArray'
TRAJECTORY = 'trajectory_msgs/JointTrajectory'

_SECOND_NS = 1_000_000_000


def joint_sample(message: Message, receipt_ns: int) -> JointSample:
    """Return the state that a `sensor_msgs/JointState` holds.

    Args:
        message: the JointState; empty `velocity` or `effort` means that the source has none.
        receipt_ns: log time or time of receipt [ns], taken where the header stamp is zero.

    Raises:
        MessageError: no joint, a repeated joint, or arrays whose lengths differ.
    """
    names = _joint_names(message.name)
    return JointSample(
        stamp_ns(message, receipt_ns),
        names,
        _matching(message.position, names, 'position'),
        _matching(message.velocity, names, 'velocity') if len(message.velocity) else None,
        _matching(message.effort, names, 'effort') if len(message.effort) else None,
    )


def stamp_ns(message: Message, receipt_ns: int) -> int:
    """Return the header stamp of `message`, or `receipt_ns` where it is zero [ns]."""
    stamp = message.header.stamp
    return int(stamp.sec) * _SECOND_NS + int(stamp.nanosec) or receipt_ns


def _array_command(message: Message, receipt_ns: int) -> CommandSample:
    if not len(message.data):
        raise MessageError('command without a number', 'one number per commanded joint')
    return CommandSample(receipt_ns, frozen_array(message.data))


def _number_command(message: Message, receipt_ns: int) -> CommandSample:
    return CommandSample(receipt_ns, frozen_array((message.data,)))


def _joint_state_command(message: Message, receipt_ns: int) -> CommandSample:
    names = _joint_names(message.name)
    effort = _matching(message.effort, names, 'effort')
    return CommandSample(stamp_ns(message, receipt_ns), effort, names)


def _trajectory_command(message: Message, receipt_ns: int) -> CommandSample:
    names = _joint_names(message.joint_names)
    if not len(message.points):
        raise MessageError('trajectory without a point', 'effort in its first point')
    effort = _matching(message.points[0].effort, names, 'effort of the first point')
    return CommandSample(stamp_ns(message, receipt_ns), effort, names)


CONVERTERS: dict[str, Callable[[Message, int], CommandSample]] = {
    FLOAT64_ARRAY: _array_command,
    FLOAT64: _number_command,
    JOINT_STATE: _joint_state_command,
    TRAJECTORY: _trajectory_command,
}
"""Command type to the function from (message, time of receipt [ns]) to its sample.

Types with a header keep its stamp, zero meaning the time of receipt; the others take that time.
Of a trajectory the first point counts, from the stamp on.
"""


def _joint_names(names: Sequence[str]) -> tuple[str, ...]:
    result = tuple(names)
    if not result:
        raise MessageError('message without joint names', 'one name per joint')
    if len(set(result)) != len(result):
        raise MessageError(f'repeated joint names in {list(result)}', 'each joint once')
    return result


def _matching(values: Sequence[float], names: tuple[str, ...], what: str) -> np.ndarray:
    if len(values) != len(names):
        raise MessageError(f'{what} of length {len(values)}', f'length {len(names)} as the names')
    return frozen_array(values)
