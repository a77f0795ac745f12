"""What identifies a robot on a node: topics, services, timers and parameters around a session.

A node has one `Identification` or none, so that a plain node and one with a lifecycle are the same
beneath. Everything it makes on its node is gone after `close`.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSProfile,
    ReliabilityPolicy,
)
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from sgp_ros.engine.samples import Event
from sgp_ros.errors import ConfigError, MessageError, NumericalError
from sgp_ros.recordings.command_types import COMMAND_TYPES, NO_COMMAND
from sgp_ros.recordings.messages import (
    diagnostics_message,
    joint_sample,
    joint_state_message,
    trajectory_message,
)
from sgp_ros.recordings.predictions import Outputs, PredictionTopics
from sgp_ros.ros.diagnosing import Diagnosing, DiagnosisFailed
from sgp_ros.ros.health import parameter_statuses
from sgp_ros.ros.messages import message_class, new_message
from sgp_ros.ros.parameters import from_ros, to_ros
from sgp_ros.ros.services import Services
from sgp_ros.ros.session import Record, Session, Topics
from sgp_ros.ros.start import build_engine
from sgp_ros.ros.verdict import ERROR, WARN

_POLL_S = 0.05
_FLUSH_S = 1.0
_QUIET_S = 5.0


class Identification:
    """Identifies a robot from its joint states and commands, from `listen` on.

    Args:
        node: on which everything is made.
        robot: name, file or description, as `load_robot` takes it.

    Raises:
        ConfigError: parameters with which it cannot start.
    """

    def __init__(self, node: Node, robot: str) -> None:
        self._node = node
        self._name = node.get_fully_qualified_name().lstrip('/')
        engine, self._settings = build_engine(node, robot)
        self._engine_settings = set(engine.config.to_mapping())
        self._is_writing_back = False
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._reported = self._steady.now()
        self._has_told_failure = False
        self._made: list[tuple[Callable[[Any], object], Any]] = []
        self._inputs: list[Any] = []
        self._advertise()
        self._session = Session(engine, self._open_record())
        window_s = float(node.get_parameter('diagnosis.window').value)
        self._diagnosing = Diagnosing(engine.robot, robot, window_s)
        self._services = Services(node, self._session, self._diagnosing, self._settings)
        self._start_timers()
        node.add_on_set_parameters_callback(self._on_set_parameters)

    def listen(self) -> None:
        """Take joint states and commands from now on."""
        self._subscribe()
        robot = self._session.engine.robot.name
        self._node.get_logger().info(f'waits for {self._joint_states} of robot {robot}')

    def pause(self) -> None:
        """Take no more joint states and commands; `listen` goes on, after a gap."""
        for subscription in self._inputs:
            self._node.destroy_subscription(subscription)
        self._inputs = []

    def close(self) -> None:
        """Complete the record, end the processes, and leave the node as it was before."""
        self.pause()
        self._node.remove_on_set_parameters_callback(self._on_set_parameters)
        self._services.close()
        self._session.close()
        self._diagnosing.close()
        for destroy, entity in reversed(self._made):
            destroy(entity)
        self._made = []

    def _publisher(self, kind: type, topic: str, quality: QoSProfile | int = 10) -> Publisher:
        publisher = self._node.create_publisher(kind, topic, quality)
        self._made.append((self._node.destroy_publisher, publisher))
        return publisher

    def _advertise(self) -> None:
        self._prediction = self._publisher(JointTrajectory, '~/prediction')
        self._variance = self._publisher(JointTrajectory, '~/prediction_variance')
        self._raw_variance = self._publisher(JointTrajectory, '~/prediction_raw_variance')
        self._overlay = self._publisher(JointState, '~/predicted_joint_states')
        kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._parameters_out = self._publisher(DiagnosticArray, '~/parameters', kept)
        self._diagnosis = self._publisher(String, '~/diagnosis', kept)
        self._diagnostics = self._publisher(DiagnosticArray, '/diagnostics')
        self._joint_states = self._node.resolve_topic_name('joint_states')
        self._command = self._node.resolve_topic_name('command')

    def _open_record(self) -> Record | None:
        path = str(self._settings['record.path'])
        if not path:
            return None
        outputs = (self._prediction, self._variance, self._overlay, self._raw_variance)
        predictions = PredictionTopics(*(o.topic_name for o in outputs))
        topics = Topics(self._joint_states, self._command, predictions)
        return Record(Path(path), topics, str(self._settings['command.type']))

    def _subscribe(self) -> None:
        quality = QoSProfile(
            history=HistoryPolicy.KEEP_LAST,
            depth=int(self._node.get_parameter('qos.depth').value),
            reliability=ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.VOLATILE,
        )
        overrides = QoSOverridingOptions.with_default_policies()

        def listen(kind: type, topic: str, convert: Callable[[Any, int], Event]) -> None:
            self._inputs.append(
                self._node.create_subscription(
                    kind,
                    topic,
                    lambda message: self._guarded(self._hear, convert, message),
                    quality,
                    qos_overriding_options=overrides,
                )
            )

        kind = str(self._settings['command.type'])
        if kind != NO_COMMAND:
            listen(message_class(kind), 'command', COMMAND_TYPES[kind].decode)
        listen(JointState, 'joint_states', joint_sample)

    def _start_timers(self) -> None:
        for period_s, action in (
            (_POLL_S, self._poll),
            (_FLUSH_S, self._session.flush_record),
            (self._node.get_parameter('diagnostics.period').value, self._report),
            (self._node.get_parameter('parameters.period').value, self._publish_parameters),
        ):
            timer = self._node.create_timer(
                period_s, partial(self._guarded, action), clock=self._steady
            )
            self._made.append((self._node.destroy_timer, timer))

    def _guarded(self, action: Callable[..., None], *given: Any) -> None:
        """Do what a message or a timer asks for; what only a bug can cause ends nothing."""
        try:
            action(*given)
        except Exception as error:  # noqa: BLE001 - the edge of the node: it must go on
            self._session.health.note_error(error, action.__name__)
        if self._session.health.failures and not self._has_told_failure:
            self._has_told_failure = True
            self._node.get_logger().error(self._session.health.first_failure)

    def _hear(self, convert: Callable[[Any, int], Event], message: Any) -> None:
        # The middleware's own time of receipt is out of reach: the wheels' EventsExecutor fails
        # on callbacks that ask for it.
        try:
            event = convert(message, self._node.get_clock().now().nanoseconds)
        except MessageError as error:
            self._session.health.note_unreadable(error)
            return
        self._diagnosing.take(event)
        engine = self._session.engine
        before = engine.is_ready, engine.config
        for output in self._session.take(event):
            self._publish(output)
        if engine.is_ready != before[0] or engine.config is not before[1]:
            self._write_back()

    def _publish(self, outputs: Outputs) -> None:
        stamp_ns, names = outputs.stamp_ns, outputs.names
        prediction = trajectory_message(new_message, stamp_ns, names, outputs.prediction)
        variance = trajectory_message(new_message, stamp_ns, names, outputs.variance)
        raw_variance = trajectory_message(new_message, stamp_ns, names, outputs.raw_variance)
        self._prediction.publish(prediction)
        self._variance.publish(variance)
        self._raw_variance.publish(raw_variance)
        self._overlay.publish(joint_state_message(new_message, outputs.joint_state))

    def _poll(self) -> None:
        before = self._session.engine.config
        warning = self._session.poll_fit()
        if warning:
            self._node.get_logger().warning(warning)
        if self._session.engine.config is not before:
            self._write_back()
        self._tell_verdict()

    def _tell_verdict(self) -> None:
        outcome = self._diagnosing.poll()
        if isinstance(outcome, DiagnosisFailed):
            self._node.get_logger().error(f'no diagnosis: {outcome.reason}')
        elif outcome is not None:
            self._diagnosis.publish(String(data=json.dumps(outcome.content, allow_nan=False)))
            self._node.get_logger().info(f'diagnosis: {outcome.content["verdict"]}')

    def _publish_parameters(self) -> None:
        statuses = parameter_statuses(self._session.engine)
        if statuses:
            now_ns = self._node.get_clock().now().nanoseconds
            self._parameters_out.publish(diagnostics_message(new_message, now_ns, statuses))

    def _report(self) -> None:
        now = self._steady.now()
        elapsed_s = (now - self._reported).nanoseconds * 1e-9
        self._reported = now
        sources = {
            'joint_states': (self._joint_states, self._node.count_publishers(self._joint_states)),
            'command': (self._command, self._node.count_publishers(self._command)),
        }
        statuses = self._session.health.statuses(
            self._session.engine, self._name, elapsed_s, sources
        )
        for status in statuses:
            if status.name.endswith(': errors'):
                continue  # told once, with the event
            if status.level == WARN:
                self._node.get_logger().warning(status.message, throttle_duration_sec=_QUIET_S)
            elif status.level >= ERROR:
                self._node.get_logger().error(status.message, throttle_duration_sec=_QUIET_S)
        now_ns = self._node.get_clock().now().nanoseconds
        statuses += self._diagnosing.statuses(self._name)
        self._diagnostics.publish(diagnostics_message(new_message, now_ns, statuses))

    def _on_set_parameters(self, parameters: list[Parameter[Any]]) -> SetParametersResult:
        settings = {p.name: from_ros(p) for p in parameters if p.name in self._engine_settings}
        if settings and not self._is_writing_back:
            try:
                self._session.change(settings)
            except (ConfigError, NumericalError) as error:
                return SetParametersResult(successful=False, reason=str(error))
            except Exception as error:  # noqa: BLE001 - the edge of the node: it must go on
                self._session.health.note_error(error, f'change of {sorted(settings)}')
                return SetParametersResult(successful=False, reason=f'internal error: {error}')
        return SetParametersResult(successful=True)

    def _write_back(self) -> None:
        """Show the hyper-parameters and the filter in force as parameters."""
        engine = self._session.engine
        values = engine.config.to_mapping()
        chosen = {n: values[n] for n in ('filter.window', 'filter.velocity')}
        learned = {n: to_ros(v) for n, v in (engine.hyper_settings() | chosen).items()}
        shown = {n: self._node.get_parameter(n).value for n in learned}
        self._is_writing_back = True
        try:
            self._node.set_parameters(
                [Parameter(n, value=v) for n, v in learned.items() if v != shown[n]]
            )
        finally:
            self._is_writing_back = False
