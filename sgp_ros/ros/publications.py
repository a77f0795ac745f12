"""Builds the messages of the node from plain values."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from sgp_ros.engine.samples import JointSample
from sgp_ros.recordings.predictions import Point
from sgp_ros.recordings.writer import Status


def header(stamp_ns: int) -> Header:
    """Return a header with this stamp [ns]."""
    sec, nanosec = divmod(stamp_ns, 1_000_000_000)
    return Header(stamp=Time(sec=sec, nanosec=nanosec))


def trajectory(stamp_ns: int, names: Sequence[str], point: Point) -> JointTrajectory:
    """Return a trajectory of one point, at its stamp [ns]."""
    return JointTrajectory(
        header=header(stamp_ns),
        joint_names=list(names),
        points=[
            JointTrajectoryPoint(
                positions=point.positions.tolist(),
                velocities=point.velocities.tolist(),
                accelerations=point.accelerations.tolist(),
                effort=point.effort.tolist(),
            )
        ],
    )


def joint_state(sample: JointSample) -> JointState:
    """Return a joint state; what the sample lacks stays empty."""
    return JointState(
        header=header(sample.stamp_ns),
        name=list(sample.names),
        position=sample.position.tolist(),
        velocity=[] if sample.velocity is None else sample.velocity.tolist(),
        effort=[] if sample.effort is None else sample.effort.tolist(),
    )


def diagnostics(stamp_ns: int, statuses: Iterable[Status]) -> DiagnosticArray:
    """Return a diagnostic array at this stamp [ns]."""
    return DiagnosticArray(
        header=header(stamp_ns),
        status=[
            DiagnosticStatus(
                level=bytes([status.level]),
                name=status.name,
                message=status.message,
                hardware_id=status.hardware_id,
                values=[KeyValue(key=key, value=value) for key, value in status.values.items()],
            )
            for status in statuses
        ],
    )
