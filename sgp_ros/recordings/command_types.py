"""Message types that commands come in: one entry says how its messages are read and written.

To teach the package another type, add its entry to `COMMAND_TYPES`: recordings with such commands
are then read and written, and the node subscribes to them, since its setting `command.type` offers
what the table holds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sgp_ros.engine.samples import EFFORT, POSITION, VELOCITY, CommandSample, frozen_array
from sgp_ros.errors import MessageError
from sgp_ros.recordings.messages import (
    JOINT_STATE,
    Make,
    Message,
    Point,
    header,
    joint_names,
    matching,
    stamp_ns,
    trajectory_message,
)

FLOAT64 = 'std_msgs/Float64'
FLOAT64_ARRAY = 'std_msgs/Float64MultiArray'
TRAJECTORY = 'trajectory_msgs/JointTrajectory'

NO_COMMAND = 'none'
"""In the place of a topic or type: no commands, the effort comes in the joint states."""


@dataclass(frozen=True, slots=True)
class CommandType:
    """A message type that commands come in.

    The definition in a recording and the class in a node follow from its name.

    Attributes:
        name: `package/Type`.
        has_names: whether its messages name joints; commands without names go by the order of
            the robot's command joints.
        decode: returns the sample of a message, from the message and its time of receipt [ns];
            raises a `MessageError` for a message without one effort per joint. It keeps the stamp
            of a header; a type without takes the time of receipt.
        encode: returns the message of a sample; what makes messages comes first, so that one
            encoder serves rosbags and rclpy. Raises a `ValueError` for what the type cannot hold.

    >>> from sgp_ros.recordings.typestore import new_message
    >>> number = CommandType(
    ...     'std_msgs/Float32',
    ...     has_names=False,
    ...     decode=lambda message, received_ns: CommandSample(
    ...         received_ns, frozen_array((message.data,))
    ...     ),
    ...     encode=lambda make, command: make('std_msgs/Float32', data=command.effort[0]),
    ... )
    >>> message = number.message(new_message, CommandSample(5, frozen_array([0.25])))
    >>> number.decode(message, 7).effort
    array([0.25])
    """

    name: str
    has_names: bool
    decode: Callable[[Message, int], CommandSample]
    encode: Callable[[Make, CommandSample], Message]

    def message(self, make: Make, command: CommandSample) -> Message:
        """Return `command` as a message of this type, made by `make`.

        Raises:
            ValueError: names where the type has none, no names where it needs them, or more
                numbers than it holds.
        """
        if (command.names is None) is self.has_names:
            how = 'without' if command.names is None else 'with'
            msg = f'command {how} joint names as {self.name}'
            raise ValueError(msg)
        return self.encode(make, command)


def _decode_array(message: Message, receipt_ns: int) -> CommandSample:
    if not len(message.data):
        raise MessageError('empty command', 'one number per commanded joint')
    return CommandSample(receipt_ns, frozen_array(message.data))


def _encode_array(make: Make, command: CommandSample) -> Message:
    layout = make('std_msgs/MultiArrayLayout', dim=[], data_offset=0)
    return make(FLOAT64_ARRAY, layout=layout, data=command.effort)


def _decode_number(message: Message, receipt_ns: int) -> CommandSample:
    return CommandSample(receipt_ns, frozen_array((message.data,)))


def _encode_number(make: Make, command: CommandSample) -> Message:
    if len(command.effort) != 1:
        msg = f'command of {len(command.effort)} numbers as {FLOAT64}'
        raise ValueError(msg)
    return make(FLOAT64, data=float(command.effort[0]))


def _decode_joint_state(message: Message, receipt_ns: int) -> CommandSample:
    names = joint_names(message.name)
    stamp = stamp_ns(message, receipt_ns)
    if len(message.effort) or not (len(message.position) or len(message.velocity)):
        return CommandSample(stamp, matching(message.effort, names, 'effort'), names)
    if not len(message.position):
        velocity = matching(message.velocity, names, 'velocity')
        return CommandSample(stamp, velocity, names, VELOCITY)
    position = matching(message.position, names, 'position')
    rates = matching(message.velocity, names, 'velocity') if len(message.velocity) else None
    return CommandSample(stamp, position, names, POSITION, rates)


def _encode_joint_state(make: Make, command: CommandSample) -> Message:
    none = np.zeros(0)
    rates = none if command.velocity is None else command.velocity
    return make(
        JOINT_STATE,
        header=header(make, command.stamp_ns),
        name=list(command.names or ()),
        position=command.effort if command.kind == POSITION else none,
        velocity=command.effort if command.kind == VELOCITY else rates,
        effort=command.effort if command.kind == EFFORT else none,
    )


def _decode_trajectory(message: Message, receipt_ns: int) -> CommandSample:
    """Return the first point, its efforts or else its positions; it counts from the stamp on."""
    names = joint_names(message.joint_names)
    if not len(message.points):
        raise MessageError('trajectory without points', 'efforts or positions in its first point')
    point, stamp = message.points[0], stamp_ns(message, receipt_ns)
    if not len(point.effort) and not len(point.positions) and len(point.velocities):
        velocity = matching(point.velocities, names, 'velocities of the first point')
        return CommandSample(stamp, velocity, names, VELOCITY)
    if len(point.effort) or not len(point.positions):
        effort = matching(point.effort, names, 'effort of the first point')
        return CommandSample(stamp, effort, names)
    position = matching(point.positions, names, 'positions of the first point')
    rates = None
    if len(point.velocities):
        rates = matching(point.velocities, names, 'velocities of the first point')
    return CommandSample(stamp, position, names, POSITION, rates)


def _encode_trajectory(make: Make, command: CommandSample) -> Message:
    if command.kind == POSITION:
        velocity = np.zeros(0) if command.velocity is None else command.velocity
        point = Point(positions=command.effort, velocities=velocity)
    elif command.kind == VELOCITY:
        point = Point(velocities=command.effort)
    else:
        point = Point(effort=command.effort)
    return trajectory_message(make, command.stamp_ns, command.names or (), point)


COMMAND_TYPES = {
    kind.name: kind
    for kind in (
        CommandType(FLOAT64_ARRAY, False, _decode_array, _encode_array),  # noqa: FBT003 - a column
        CommandType(FLOAT64, False, _decode_number, _encode_number),  # noqa: FBT003 - of a table
        CommandType(JOINT_STATE, True, _decode_joint_state, _encode_joint_state),  # noqa: FBT003
        CommandType(TRAJECTORY, True, _decode_trajectory, _encode_trajectory),  # noqa: FBT003
    )
}
"""Name to the type, in the order in which the node's setting `command.type` offers them."""
