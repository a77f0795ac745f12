"""Build the ROS messages that a recording is written with."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from sgp_ros.engine.samples import CommandSample, JointSample
from sgp_ros.recordings.messages import FLOAT64, FLOAT64_ARRAY, JOINT_STATE, TRAJECTORY, Message
from sgp_ros.recordings.typestore import new_message

DIAGNOSTICS = 'diagnostic_msgs/DiagnosticArray'
TEXT = 'std_msgs/String'
_EMPTY = np.zeros(0)


class Status(NamedTuple):
    """One entry of a DiagnosticArray.

    Attributes:
        name: of what is described.
        level: 0 ok, 1 warning, 2 error, 3 stale.
        message: one sentence.
        hardware_id: of the device.
        values: key to value, in order.
    """

    name: str
    level: int
    message: str
    hardware_id: str
    values: Mapping[str, str]


class TrajectoryPoint(NamedTuple):
    """The one point of a JointTrajectory; each is (m,) or empty.

    Attributes:
        positions: [rad] or [m].
        velocities: [rad/s] or [m/s].
        accelerations: [rad/s^2] or [m/s^2].
        effort: [N m] or [N].
    """

    positions: Iterable[float] = ()
    velocities: Iterable[float] = ()
    accelerations: Iterable[float] = ()
    effort: Iterable[float] = ()


def joint_state_message(sample: JointSample) -> Message:
    """Return a `sensor_msgs/JointState`; what the sample lacks is empty."""
    return new_message(
        JOINT_STATE,
        header=_header(sample.stamp_ns),
        name=list(sample.names),
        position=sample.position,
        velocity=_EMPTY if sample.velocity is None else sample.velocity,
        effort=_EMPTY if sample.effort is None else sample.effort,
    )


def command_message(kind: str, command: CommandSample) -> Message:
    """Return `command` as a message of type `kind`, a key of `CONVERTERS`.

    Raises:
        ValueError: names where the type has none, no names where it needs them, or several
            numbers for a type of one.
    """
    names, effort = command.names, command.effort
    if (names is None) is (kind in {JOINT_STATE, TRAJECTORY}):
        msg = f'command {"without" if names is None else "with"} joint names as {kind}'
        raise ValueError(msg)
    if kind == TRAJECTORY:
        return trajectory_message(command.stamp_ns, names or (), TrajectoryPoint(effort=effort))
    if kind == JOINT_STATE:
        return new_message(
            JOINT_STATE,
            header=_header(command.stamp_ns),
            name=list(names or ()),
            position=_EMPTY,
            velocity=_EMPTY,
            effort=effort,
        )
    if kind == FLOAT64:
        (number,) = effort
        return new_message(FLOAT64, data=number)
    layout = new_message('std_msgs/MultiArrayLayout', dim=[], data_offset=0)
    return new_message(FLOAT64_ARRAY, layout=layout, data=effort)


def trajectory_message(stamp_ns: int, names: Sequence[str], point: TrajectoryPoint) -> Message:
    """Return a `trajectory_msgs/JointTrajectory` of one point at its stamp [ns]."""
    fields = {name: np.asarray(values, np.float64) for name, values in point._asdict().items()}
    now = new_message('builtin_interfaces/Duration', sec=0, nanosec=0)
    return new_message(
        TRAJECTORY,
        header=_header(stamp_ns),
        joint_names=list(names),
        points=[
            new_message('trajectory_msgs/JointTrajectoryPoint', **fields, time_from_start=now)
        ],
    )


def diagnostics_message(stamp_ns: int, entries: Iterable[Status]) -> Message:
    """Return a `diagnostic_msgs/DiagnosticArray` of `stamp_ns` [ns]."""
    status = [
        new_message(
            'diagnostic_msgs/DiagnosticStatus',
            level=entry.level,
            name=entry.name,
            message=entry.message,
            hardware_id=entry.hardware_id,
            values=[
                new_message('diagnostic_msgs/KeyValue', key=key, value=value)
                for key, value in entry.values.items()
            ],
        )
        for entry in map(Status._make, entries)
    ]
    return new_message(DIAGNOSTICS, header=_header(stamp_ns), status=status)


def text_message(text: str) -> Message:
    """Return a `std_msgs/String`."""
    return new_message(TEXT, data=text)


def _header(stamp_ns: int) -> Message:
    seconds, nanoseconds = divmod(stamp_ns, 1_000_000_000)
    stamp = new_message('builtin_interfaces/Time', sec=seconds, nanosec=nanoseconds)
    return new_message('std_msgs/Header', stamp=stamp, frame_id='')
