"""Service `~/diagnose` of a running node: verdict, refusals, a killed process."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path
from typing import Any

import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

from sgp_ros.engine.samples import CommandSample, JointSample
from sgp_ros.recordings.messages import header
from sgp_ros.recordings.reader import open_recording
from sgp_ros.ros.messages import new_message
from test.ros.graph import Graph, NodeProcess

CASE = Path(__file__).parents[2].parent / 'shared' / 'practice' / 'cases' / 'case_32'
KEPT = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
FAST = {
    'diagnostics__period': 0.1,
    'filter__hop': 0.2,
    'refit__enabled': False,
    'qos__depth': 5000,
}
DIAGNOSE = '/sgp_node/diagnose'
PATIENCE_S = 240.0
"""A diagnosis takes half a minute of one core."""

pytestmark = [
    pytest.mark.ros,
    pytest.mark.skipif(not CASE.exists(), reason='needs the practice cases'),
]


def _start(graph: Graph, **settings: Any) -> NodeProcess:
    return graph.start(
        'sgp_node',
        **{**FAST, 'robot': CASE / 'robot.urdf', 'command__type': 'sensor_msgs/JointState'},
        **settings,
    )


def _play(graph: Graph, seconds: float) -> int:
    """Publish the first seconds of the recording, with its stamps; return the number of states."""
    events = list(open_recording(CASE / 'real.mcap').events())
    commands = graph.client.create_publisher(JointState, '/command', 5000)
    states = graph.client.create_publisher(JointState, '/joint_states', 5000)
    command = next(event for event in events if isinstance(event, CommandSample))
    state = next(event for event in events if isinstance(event, JointSample))
    _publish_until_read(graph, commands, _command(command), 'commands_read')
    _publish_until_read(graph, states, _state(state), 'read')
    before, first, sent = graph.count('read'), events[0].stamp_ns, 0
    for event in events:
        if event.stamp_ns - first > seconds * 1e9:
            break
        if isinstance(event, CommandSample):
            commands.publish(_command(event))
        elif isinstance(event, JointSample):
            states.publish(_state(event))
            sent += 1
            if sent % 25 == 0:  # a burst could let states overtake their commands
                graph.wait_until(
                    lambda n=before + sent: graph.count('read') > n - 50, 'the node to read'
                )
    return sent


def _publish_until_read(graph: Graph, publisher: Any, message: JointState, key: str) -> None:
    """Publish a message again and again until the node has read one.

    A publisher may find a listener before the listener finds it; what it sends meanwhile is lost.
    """

    def is_read() -> bool:
        if graph.count(key):
            return True
        publisher.publish(message)
        return False

    graph.wait_until(is_read, f'{key} on {publisher.topic_name}')


def _command(event: CommandSample) -> JointState:
    names = event.names or ('shoulder', 'elbow')
    stamp = header(new_message, event.stamp_ns)
    return JointState(header=stamp, name=list(names), effort=event.effort.tolist())


def _state(event: JointSample) -> JointState:
    velocity = [] if event.velocity is None else event.velocity.tolist()
    return JointState(
        header=header(new_message, event.stamp_ns), name=list(event.names),
        position=event.position.tolist(), velocity=velocity,
    )  # fmt: skip


def test_a_diagnosis_of_the_recent_past_is_published(graph: Graph) -> None:
    """A weak motor in a recording that is played into the node; late listeners hear it too."""
    _start(graph)
    sent = _play(graph, 12.0)
    answer = graph.call(Trigger, DIAGNOSE)
    assert answer.success, answer.message
    assert answer.message.startswith('started on ')
    assert int(answer.message.split()[2]) > 0.9 * sent
    graph.wait_until(
        lambda: float(graph.status('diagnosis').get('share', '0')) > 0.0, 'progress', PATIENCE_S
    )
    assert float(graph.status('diagnosis')['left_s']) > 0.0
    again = graph.call(Trigger, DIAGNOSE)
    assert not again.success
    assert 'already running' in again.message
    graph.wait_until(
        lambda: graph.status('diagnosis').get('state') == 'done', 'a verdict', PATIENCE_S
    )
    status = graph.wait_until(lambda: graph.status('diagnosis torque_gain elbow'), 'a finding')
    assert (status['joint'], status['effect']) == ('elbow', 'torque_gain')
    assert abs(float(status['gain']) - 0.74824) < 0.01
    assert float(status['gain.std']) > 0.0
    assert 0.5 < float(status['probability']) <= 1.0
    for name in ('diagnosis', 'diagnosis torque_gain elbow'):
        assert 'on elbow' in graph.message(name)
        assert 'gain 0.74' in graph.message(name)
        assert 'correct the robot file' in graph.message(name)
    late = graph.collect(String, '/sgp_node/diagnosis', KEPT)
    graph.wait_until(lambda: late, 'the verdict')
    content = json.loads(late[0].data)
    assert content['verdict'] == 'missing_physics'
    assert content['findings'][0]['effect'] == 'torque_gain'
    assert {'schema', 'alternatives', 'parameter_errors', 'fit'} <= set(content)


def test_a_killed_diagnosis_is_reported_and_the_node_lives(graph: Graph) -> None:
    node = _start(graph)
    _play(graph, 3.0)
    before = set(node.children('multiprocessing.spawn'))
    assert graph.call(Trigger, DIAGNOSE).success
    (worker,) = graph.wait_until(
        lambda: set(node.children('multiprocessing.spawn')) - before, 'the process'
    )
    os.kill(worker, signal.SIGKILL)
    graph.wait_until(lambda: graph.status('diagnosis').get('state') == 'failed', 'the report')
    assert 'ended with code -9' in graph.message('diagnosis')
    assert graph.call(Trigger, DIAGNOSE).success
    assert node.is_running


def test_a_diagnosis_is_cancelled(graph: Graph) -> None:
    """And another one may start."""
    _start(graph)
    _play(graph, 3.0)
    cancel = '/sgp_node/cancel_diagnosis'
    assert not graph.call(Trigger, cancel).success
    assert graph.call(Trigger, DIAGNOSE).success
    assert graph.call(Trigger, cancel).success
    graph.wait_until(lambda: graph.status('diagnosis').get('state') == 'cancelled', 'the end')
    assert graph.call(Trigger, DIAGNOSE).success


def test_what_cannot_be_diagnosed_is_said_at_once(graph: Graph) -> None:
    """Too few states; the kind of the reason, and the number that is needed."""
    _start(graph)
    answer = graph.call(Trigger, DIAGNOSE)
    assert not answer.success
    assert answer.message == 'too few states: 0, at least 64 are needed'


def test_a_diagnosis_that_fails_says_why(graph: Graph) -> None:
    """States without any effort: there is no equation to look at."""
    _start(graph)
    states = graph.client.create_publisher(JointState, '/joint_states', 1000)
    graph.wait_until(states.get_subscription_count, 'the node')
    for i in range(200):
        stamp = header(new_message, 10**18 + i * 10**7)
        names, position = ['shoulder', 'elbow'], [0.01 * i, 0.0]
        states.publish(JointState(header=stamp, name=names, position=position))
        graph.turn(0.001)
    graph.wait_until(lambda: graph.count('read') > 100, 'states')
    assert graph.call(Trigger, DIAGNOSE).success
    graph.wait_until(
        lambda: graph.status('diagnosis').get('state') == 'failed', 'the report', PATIENCE_S
    )
    assert 'has an effort' in graph.message('diagnosis')
