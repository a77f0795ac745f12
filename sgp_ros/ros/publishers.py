"""Publishers of a node's estimates, where somebody listens."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, String
from trajectory_msgs.msg import JointTrajectory

from sgp_ros.engine.results import ParameterEstimate
from sgp_ros.engine.samples import JointSample
from sgp_ros.recordings.messages import (
    Status,
    diagnostics_message,
    joint_state_message,
    trajectory_message,
)
from sgp_ros.recordings.predictions import Outputs, PredictionTopics
from sgp_ros.ros.messages import new_message

_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Publishers:
    """Publishers of one node.

    Args:
        node: that they are made on.
    """

    def __init__(self, node: Node) -> None:
        self._node = node

        def publisher(kind: type, topic: str, quality: QoSProfile | int = 10) -> Any:
            return node.create_publisher(kind, topic, quality)

        self._prediction = publisher(JointTrajectory, '~/prediction')
        self._variance = publisher(JointTrajectory, '~/prediction_variance')
        self._raw_variance = publisher(JointTrajectory, '~/prediction_raw_variance')
        self._overlay = publisher(JointState, '~/predicted_joint_states')
        self._residual = publisher(JointState, '~/residual')
        self._measured = publisher(JointState, '~/measured_effort')
        self._band = [publisher(JointState, f'~/band/{end}') for end in ('lower', 'upper')]
        self._parameters = publisher(DiagnosticArray, '~/parameters', _LATCHED)
        self._values = publisher(JointState, '~/parameter_values', _LATCHED)
        self._monitor = publisher(DiagnosticArray, '~/monitor', _LATCHED)
        self._alarm = publisher(Bool, '~/alarm', _LATCHED)
        self._diagnosis = publisher(String, '~/diagnosis', _LATCHED)
        self._progress = publisher(DiagnosticArray, '~/diagnosis_status', _LATCHED)
        self._diagnostics = publisher(DiagnosticArray, '/diagnostics')
        self._all = [
            self._prediction, self._variance, self._raw_variance, self._overlay, self._residual,
            self._measured, *self._band, self._parameters, self._values, self._monitor,
            self._alarm, self._diagnosis, self._progress, self._diagnostics,
        ]  # fmt: skip

    @property
    def prediction_topics(self) -> PredictionTopics:
        """Full names of the topics that a record repeats."""
        outputs = (self._prediction, self._variance, self._overlay, self._raw_variance)
        return PredictionTopics(*(output.topic_name for output in outputs))

    def close(self) -> None:
        """Take them off the node."""
        for publisher in self._all:
            self._node.destroy_publisher(publisher)

    def estimate(self, found: Outputs) -> None:
        """Publish one estimate."""
        stamp_ns, names = found.stamp_ns, found.names
        for publisher, point in (
            (self._prediction, found.prediction), (self._variance, found.variance),
            (self._raw_variance, found.raw_variance),
        ):  # fmt: skip
            if publisher.get_subscription_count():
                publisher.publish(trajectory_message(new_message, stamp_ns, names, point))
        states: list[tuple[Any, JointSample]] = [(self._overlay, found.joint_state)]
        errors = (found.residual, found.measured, *(found.band or ()))
        publishers = (self._residual, self._measured, *self._band)
        states += [(p, e) for p, e in zip(publishers, errors, strict=False) if e is not None]
        for publisher, state in states:
            if publisher.get_subscription_count():
                publisher.publish(joint_state_message(new_message, state))

    def parameters(self, stamp_ns: int, found: Sequence[ParameterEstimate], robot: str) -> None:
        """Publish the coefficients: as statuses, and as numbers by name.

        The numbers are a JointState, which every plotting tool reads by name: its position is the
        value, its velocity and effort are the lower and upper end of the 95 % interval.
        """
        statuses = [parameter_status(parameter, robot) for parameter in found]
        self._parameters.publish(diagnostics_message(new_message, stamp_ns, statuses))
        value = np.array([parameter.value for parameter in found])
        std = np.array([np.nan if p.std is None else p.std for p in found])
        names = tuple(parameter.name for parameter in found)
        sample = JointSample(stamp_ns, names, value, value - 1.96 * std, value + 1.96 * std)
        self._values.publish(joint_state_message(new_message, sample))

    def monitor(self, stamp_ns: int, statuses: Sequence[Status]) -> None:
        """Publish which joints alarm, and whether any does."""
        self._monitor.publish(diagnostics_message(new_message, stamp_ns, statuses))
        self._alarm.publish(Bool(data=any(status.level for status in statuses)))

    def diagnostics(self, stamp_ns: int, statuses: Sequence[Status]) -> None:
        """Publish /diagnostics."""
        self._diagnostics.publish(diagnostics_message(new_message, stamp_ns, statuses))

    def diagnosis_status(self, stamp_ns: int, statuses: Sequence[Status]) -> None:
        """Publish how far a diagnosis is, and what it found."""
        self._progress.publish(diagnostics_message(new_message, stamp_ns, statuses))

    def diagnosis(self, text: str) -> None:
        """Publish the content of diagnosis.json."""
        self._diagnosis.publish(String(data=text))


def parameter_status(parameter: ParameterEstimate, robot: str) -> Status:
    """Return the status of one coefficient of `robot`; no `std` where it is not identifiable."""
    values = {'value': repr(parameter.value)}
    if parameter.std is None:
        message = 'not determined by the motion so far'
    else:
        values['std'] = repr(parameter.std)
        message = f'{parameter.value:.6g} +- {1.96 * parameter.std:.2g} {parameter.unit} (95 %)'
    values['unit'] = parameter.unit
    values['identifiable'] = str(int(parameter.is_identifiable))
    if parameter.joint is not None:
        values['joint'] = parameter.joint
    return Status(parameter.name, 0, message, robot, values)
