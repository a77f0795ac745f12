"""Identification on a node: topics, services, timers and parameters around a session.

A node has one `Identification` or none, so that a plain node and one with a lifecycle are the same
beneath. Everything it makes on its node is gone after `close`.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import JointState

from sgp_ros.engine.samples import Event
from sgp_ros.errors import ConfigError, MessageError, NumericalError
from sgp_ros.recordings.command_types import COMMAND_TYPES, NO_COMMAND
from sgp_ros.recordings.messages import Status, joint_sample
from sgp_ros.ros.diagnosing import Diagnosing
from sgp_ros.ros.diagnosis_outcome import DiagnosisFailed
from sgp_ros.ros.messages import message_class
from sgp_ros.ros.parameters import from_ros, to_ros
from sgp_ros.ros.publishers import Publishers
from sgp_ros.ros.record import Record, Topics, filled_name
from sgp_ros.ros.services import Services
from sgp_ros.ros.session import Session
from sgp_ros.ros.start import build_engine
from sgp_ros.ros.verdict import OK, WARN

_POLL_S = 0.05
_FLUSH_S = 0.5
_QUIET_NS = 30 * 10**9


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
        self._has_reported_failure = False
        self._logged: dict[str, tuple[int, int]] = {}
        self._timers: list[Any] = []
        self._inputs: list[Any] = []
        self._joint_states = node.resolve_topic_name('joint_states')
        self._command = node.resolve_topic_name('command')
        self._out = Publishers(node)
        kind = str(self._settings['command.type'])
        names = ('monitor.duration', 'monitor.false_alarms')
        least_s, per_hour = (float(node.get_parameter(name).value) for name in names)
        self._session = Session(engine, self._open_record(), kind, (least_s, per_hour))
        window_s = float(node.get_parameter('diagnosis.window').value)
        self._diagnosing = Diagnosing(engine.robot, robot, window_s)
        self._services = Services(node, self._session, self._diagnosing, self._settings)
        self._start_timers()
        node.add_on_set_parameters_callback(self._on_set_parameters)

    def listen(self) -> None:
        """Take joint states and commands from now on."""
        self._subscribe()
        robot = self._session.engine.robot.name
        self._node.get_logger().info(f'waiting for {self._joint_states} of robot {robot}')

    def pause(self) -> None:
        """Take no more joint states and commands; `listen` goes on, after a gap."""
        for subscription in self._inputs:
            self._node.destroy_subscription(subscription)
        self._inputs = []

    def close(self) -> None:
        """Complete the record, end the processes, and leave the node as it was before."""
        self.pause()
        self._node.remove_on_set_parameters_callback(self._on_set_parameters)
        if self._settings['save.period']:
            self._services.autosave()
        self._services.close()
        self._session.close()
        self._diagnosing.close()
        for timer in self._timers:
            self._node.destroy_timer(timer)
        self._timers = []
        self._out.close()

    def _open_record(self) -> Record | None:
        path = str(self._settings['record.path'])
        if not path:
            return None
        topics = Topics(self._joint_states, self._command, self._out.prediction_topics)
        limits = (f'record.split.{name}' for name in ('size', 'age'))
        record = Record(
            Path(filled_name(path, self._name)), topics, str(self._settings['command.type']),
            *(float(str(self._settings[name])) for name in limits),
        )  # fmt: skip
        self._node.get_logger().info(f'recording to {record.path}')
        return record

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
                    lambda message: self._serve(convert, message),
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
            self._every(period_s, action)
        save_s = float(str(self._settings['save.period']))
        if save_s:
            self._every(save_s, self._services.autosave)

    def _every(self, period_s: float, action: Callable[[], None]) -> None:
        guarded = partial(self._guarded, action)
        self._timers.append(self._node.create_timer(period_s, guarded, clock=self._steady))

    def _guarded(self, action: Callable[..., None], *given: Any) -> None:
        """Do what a message or a timer asks for; an error by a bug does not end the node."""
        try:
            action(*given)
        except Exception as error:  # noqa: BLE001 - the edge of the node: it must go on
            self._session.health.note_error(error, action.__name__)
        if self._session.health.failures and not self._has_reported_failure:
            self._has_reported_failure = True
            self._node.get_logger().error(self._session.health.first_failure)

    def _serve(self, convert: Callable[[Any, int], Event], message: Any) -> None:
        """Take a message, and note how long all of that took."""
        started, used = time.perf_counter(), time.thread_time()
        self._guarded(self._hear, convert, message)
        times_s = time.perf_counter() - started, time.thread_time() - used
        self._session.health.note_callback(*times_s)

    def _hear(self, convert: Callable[[Any, int], Event], message: Any) -> None:
        # The middleware's own time of receipt is out of reach: the wheels' EventsExecutor fails
        # on callbacks that ask for it.
        try:
            event = convert(message, self._now_ns)
        except MessageError as error:
            self._session.health.note_unreadable(error)
            return
        engine = self._session.engine
        before = engine.is_ready, engine.config
        for whole in self._session.merged(event):
            self._diagnosing.take(whole)
            for output in self._session.take(whole):
                self._out.estimate(output)
                self._session.health.note_delay((self._now_ns - output.stamp_ns) * 1e-9)
        if engine.is_ready != before[0] or engine.config is not before[1]:
            self._write_back()
        if self._session.has_alarm_changed:
            self._session.has_alarm_changed = False
            self._publish_monitor()

    @property
    def _now_ns(self) -> int:
        return int(self._node.get_clock().now().nanoseconds)

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
            self._out.diagnosis(json.dumps(outcome.content, allow_nan=False))
            self._node.get_logger().info(f'diagnosis: {outcome.sentence}')

    def _publish_parameters(self) -> None:
        engine = self._session.engine
        found = engine.parameters()
        if found:
            self._out.parameters(self._now_ns, found, engine.robot.name)

    def _publish_monitor(self) -> list[Status]:
        session = self._session
        statuses = session.fit_health.monitor_statuses(session.engine, self._name)
        self._out.monitor(self._now_ns, statuses)
        self._log(statuses)
        return statuses

    def _report(self) -> None:
        now = self._steady.now()
        elapsed_s = (now - self._reported).nanoseconds * 1e-9
        self._reported = now
        session = self._session
        sources = {
            name: (topic, self._publisher_names(topic))
            for name, topic in (('joint_states', self._joint_states), ('command', self._command))
        }
        statuses = session.health.statuses(session.engine, self._name, elapsed_s, sources)
        statuses += session.fit_health.statuses(session.engine, self._name)
        self._log(statuses)
        statuses += self._publish_monitor()
        diagnosis = self._diagnosing.statuses(self._name)
        if diagnosis:
            self._out.diagnosis_status(self._now_ns, diagnosis)
        statuses += diagnosis
        self._out.diagnostics(self._now_ns, statuses)

    def _publisher_names(self, topic: str) -> tuple[str, ...]:
        found = self._node.get_publishers_info_by_topic(topic)
        return tuple(f'{info.node_namespace.rstrip("/")}/{info.node_name}' for info in found)

    def _log(self, statuses: Iterable[Status]) -> None:
        """Log what becomes a warning or error, again from time to time, and that it is over."""
        logger, now_ns = self._node.get_logger(), self._steady.now().nanoseconds
        for status in statuses:
            if status.name.endswith(': errors'):
                continue  # reported once, with the event
            level, said_ns = self._logged.get(status.name, (OK, 0))
            if status.level == level and (level == OK or now_ns - said_ns < _QUIET_NS):
                continue
            if status.level == OK:  # rclpy wants a line of its own for each severity
                calm = f'back to normal: {status.name}: {status.message}'
                logger.info(calm)
            elif status.level == WARN:
                logger.warning(status.message)
            else:
                logger.error(status.message)
            self._logged[status.name] = (status.level, now_ns)

    def _on_set_parameters(self, parameters: list[Parameter[Any]]) -> SetParametersResult:
        if problem := self._services.problem_of(parameters):
            return SetParametersResult(successful=False, reason=problem)
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
