"""The node that identifies a robot online: topics, services and parameters around a session."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSProfile,
    ReliabilityPolicy,
)
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger
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
from sgp_ros.ros.session import Record, Session, Topics
from sgp_ros.ros.start import build_engine
from sgp_ros.ros.verdict import ERROR, WARN

_POLL_S = 0.05
_FLUSH_S = 1.0
_QUIET_S = 5.0


class SgpNode(Node):  # type: ignore[misc]  # rclpy is untyped
    """Identifies a robot from its joint states and commands.

    Raises:
        ConfigError: parameters with which it cannot start.
    """

    def __init__(self) -> None:
        super().__init__('sgp_node')
        engine, self._settings = build_engine(self)
        self._engine_settings = set(engine.config.to_mapping())
        self._is_writing_back = False
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._reported = self._steady.now()
        self._advertise()
        self._session = Session(engine, self._open_record())
        self._diagnosing = Diagnosing(
            engine.robot,
            str(self._settings['robot']),
            float(self.get_parameter('diagnosis.window').value),
        )
        self._offer_services()
        self._start_timers()
        self.add_on_set_parameters_callback(self._on_set_parameters)
        self._subscribe()
        self.get_logger().info(f'waits for {self._joint_states} of robot {engine.robot.name}')

    def destroy_node(self) -> None:
        """Complete the record and end the worker, then leave the graph."""
        session: Session | None = getattr(self, '_session', None)
        if session is not None:
            session.close()
        diagnosing: Diagnosing | None = getattr(self, '_diagnosing', None)
        if diagnosing is not None:
            diagnosing.close()
        super().destroy_node()

    def _advertise(self) -> None:
        self._prediction = self.create_publisher(JointTrajectory, '~/prediction', 10)
        self._variance = self.create_publisher(JointTrajectory, '~/prediction_variance', 10)
        self._raw_variance = self.create_publisher(
            JointTrajectory, '~/prediction_raw_variance', 10
        )
        self._overlay = self.create_publisher(JointState, '~/predicted_joint_states', 10)
        kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._parameters_out = self.create_publisher(DiagnosticArray, '~/parameters', kept)
        self._diagnosis = self.create_publisher(String, '~/diagnosis', kept)
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self._joint_states = self.resolve_topic_name('joint_states')
        self._command = self.resolve_topic_name('command')

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
            depth=int(self.get_parameter('qos.depth').value),
            reliability=ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.VOLATILE,
        )
        overrides = QoSOverridingOptions.with_default_policies()

        def listen(kind: type, topic: str, convert: Callable[[Any, int], Event]) -> None:
            self.create_subscription(
                kind,
                topic,
                lambda message: self._hear(convert, message),
                quality,
                qos_overriding_options=overrides,
            )

        kind = str(self._settings['command.type'])
        if kind != NO_COMMAND:
            listen(message_class(kind), 'command', COMMAND_TYPES[kind].decode)
        listen(JointState, 'joint_states', joint_sample)

    def _offer_services(self) -> None:
        for name, answer in (
            ('refit', self._refit), ('reset', self._reset), ('save', self._save),
            ('diagnose', self._diagnose),
        ):  # fmt: skip
            self.create_service(Trigger, f'~/{name}', answer)
        self.create_service(SetBool, '~/learn', self._learn)

    def _start_timers(self) -> None:
        for period_s, action in (
            (_POLL_S, self._poll),
            (_FLUSH_S, self._session.flush_record),
            (self.get_parameter('diagnostics.period').value, self._report),
            (self.get_parameter('parameters.period').value, self._publish_parameters),
        ):
            self.create_timer(period_s, action, clock=self._steady)

    def _hear(self, convert: Callable[[Any, int], Event], message: Any) -> None:
        # The middleware's own time of receipt is out of reach: the wheels' EventsExecutor fails
        # on callbacks that ask for it.
        try:
            event = convert(message, self.get_clock().now().nanoseconds)
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
            self.get_logger().warning(warning)
        if self._session.engine.config is not before:
            self._write_back()
        self._tell_verdict()

    def _tell_verdict(self) -> None:
        outcome = self._diagnosing.poll()
        if isinstance(outcome, DiagnosisFailed):
            self.get_logger().error(f'no diagnosis: {outcome.reason}')
        elif outcome is not None:
            self._diagnosis.publish(String(data=json.dumps(outcome.content, allow_nan=False)))
            self.get_logger().info(f'diagnosis: {outcome.content["verdict"]}')

    def _publish_parameters(self) -> None:
        statuses = parameter_statuses(self._session.engine)
        if statuses:
            now_ns = self.get_clock().now().nanoseconds
            self._parameters_out.publish(diagnostics_message(new_message, now_ns, statuses))

    def _report(self) -> None:
        now = self._steady.now()
        elapsed_s = (now - self._reported).nanoseconds * 1e-9
        self._reported = now
        sources = {
            'joint_states': (self._joint_states, self.count_publishers(self._joint_states)),
            'command': (self._command, self.count_publishers(self._command)),
        }
        statuses = self._session.health.statuses(
            self._session.engine, self.get_name(), elapsed_s, sources
        )
        for status in statuses:
            if status.level == WARN:
                self.get_logger().warning(status.message, throttle_duration_sec=_QUIET_S)
            elif status.level >= ERROR:
                self.get_logger().error(status.message, throttle_duration_sec=_QUIET_S)
        now_ns = self.get_clock().now().nanoseconds
        statuses += self._diagnosing.statuses(self.get_name())
        self._diagnostics.publish(diagnostics_message(new_message, now_ns, statuses))

    def _on_set_parameters(self, parameters: list[Parameter[Any]]) -> SetParametersResult:
        settings = {p.name: from_ros(p) for p in parameters if p.name in self._engine_settings}
        if settings and not self._is_writing_back:
            try:
                self._session.change(settings)
            except (ConfigError, NumericalError) as error:
                return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _write_back(self) -> None:
        """Show the hyper-parameters and the filter in force as parameters."""
        engine = self._session.engine
        values = engine.config.to_mapping()
        chosen = {n: values[n] for n in ('filter.window', 'filter.velocity')}
        learned = {n: to_ros(v) for n, v in (engine.hyper_settings() | chosen).items()}
        shown = {n: self.get_parameter(n).value for n in learned}
        self._is_writing_back = True
        try:
            self.set_parameters(
                [Parameter(n, value=v) for n, v in learned.items() if v != shown[n]]
            )
        finally:
            self._is_writing_back = False

    def _refit(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self._session.refit()
        response.message = 'a fit was started; /diagnostics tells its outcome'
        if not response.success:
            initial = self._session.engine.config.learning_initial
            response.message = f'too few samples to fit, learning.initial = {initial} are needed'
        return response

    def _reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._session.reset()
        response.success, response.message = True, 'everything that was learned is forgotten'
        return response

    def _save(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        given = str(self.get_parameter('save.path').value) or f'{self.get_name()}.npz'
        path = Path(given).absolute().with_suffix('.npz')
        engine = self._session.engine
        settings = {
            'robot': self._settings['robot'],
            'command.type': self._settings['command.type'],
            **engine.config.to_mapping(),
        }
        try:
            self._session.save(path, settings)
        except OSError as error:
            response.success, response.message = False, f'not saved: {error}'
        else:
            response.success, response.message = True, str(path)
        return response

    def _diagnose(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success, response.message = self._diagnosing.start(self._session.engine.config)
        return response

    def _learn(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        result = self.set_parameters([Parameter('learning.enabled', value=bool(request.data))])[0]
        response.success = result.successful
        response.message = result.reason or f'learning.enabled = {bool(request.data)}'
        return response
