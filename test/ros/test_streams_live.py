"""Streams as robots have them, over DDS: parts, several publishers, set-back clocks, restarts."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from sgp_ros.recordings.messages import header
from sgp_ros.recordings.reader import open_recording
from sgp_ros.ros.messages import new_message
from test.ros.graph import Graph
from test.ros.stream import START_NS, Stream
from test.ros.test_node import QUICK

pytestmark = pytest.mark.ros
KEPT = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
MEASURED = {**QUICK, 'command__type': 'none'}
STEP_NS = 10**7
KNOWN_AFTER = 100
"""Messages after which the node knows the period, and has counted what was lost before."""


def _state(t_ns: int, names: str = 'pole wheel', shift: float = 0.0, **fields: Any) -> JointState:
    """Return a state of a slow motion with an effort; `fields` take the place of its arrays."""
    joints = names.split()
    t = t_ns * 1e-9
    given = {
        'position': [shift + np.sin(t + j) for j in range(len(joints))],
        'effort': [np.cos(3.0 * t + j) for j in range(len(joints))],
    } | fields
    return JointState(header=header(new_message, START_NS + t_ns), name=joints, **given)


def _publish_until(graph: Graph, send: Callable[[int], Any], is_done: Callable[[], Any]) -> int:
    """Send one sample after the other until the node says what is waited for; return how many."""
    sent = 0

    def one_more() -> bool:
        nonlocal sent
        for _ in range(5):
            send(sent)
            sent += 1
        return bool(is_done())

    graph.wait_until(one_more, 'what the stream leads to')
    return sent


def test_two_drivers_with_a_part_of_the_joints_each_are_one_robot(graph: Graph) -> None:
    """And a gripper with a driver of its own is no warning."""
    graph.start('sgp_node', **MEASURED)
    pole, wheel, gripper = (
        graph.client.create_publisher(JointState, 'joint_states', 100) for _ in range(3)
    )

    def send(i: int) -> None:
        pole.publish(_state(i * STEP_NS, 'pole'))
        wheel.publish(_state(i * STEP_NS + 10**6, 'wheel'))
        gripper.publish(_state(i * STEP_NS, 'finger'))

    _publish_until(graph, send, lambda: graph.status('model').get('ready') == '1')
    graph.wait_until(lambda: graph.count('of_other_joints'), 'the gripper')
    assert graph.count('refused.unknown_joint') == 0


def test_two_publishers_of_one_joint_are_named(graph: Graph) -> None:
    graph.start('sgp_node', **MEASURED)
    one, other = (graph.client.create_publisher(JointState, 'joint_states', 100) for _ in range(2))

    def send(i: int) -> None:
        one.publish(_state(i * STEP_NS))
        other.publish(_state(i * STEP_NS + 10**6, shift=1.0))

    _publish_until(graph, send, lambda: 'published by several nodes' in graph.message('samples'))
    assert "['pole', 'wheel']" in graph.message('samples')
    assert '/client' in graph.message('samples')


@pytest.mark.parametrize('effort', [[], [float('nan')] * 2])
def test_states_without_effort_name_the_joints_and_the_remedy(
    graph: Graph, effort: list[float]
) -> None:
    graph.start('sgp_node', **MEASURED)
    states = graph.client.create_publisher(JointState, 'joint_states', 100)
    _publish_until(
        graph,
        lambda i: states.publish(_state(i * STEP_NS, effort=effort)),
        lambda: 'no effort for joints' in graph.message('samples'),
    )
    assert 'state_interface' in graph.message('samples')


def test_a_bag_that_is_played_in_a_loop_costs_nothing_that_was_learned(graph: Graph) -> None:
    """The clock goes back, a new segment begins, the model goes on."""
    graph.start('sgp_node', **MEASURED)
    states = graph.client.create_publisher(JointState, 'joint_states', 100)
    length = 400

    def send(i: int) -> None:
        states.publish(_state((i % length) * STEP_NS))

    _publish_until(graph, send, lambda: graph.count('clock_jumps') >= 2)
    learned = graph.count('learned')
    assert learned > 100
    _publish_until(graph, send, lambda: graph.count('learned') > learned)


def test_lost_messages_are_counted(graph: Graph) -> None:
    """With the joints and the number, and the log says when the warning is over."""
    node = graph.start('sgp_node', **MEASURED)
    states = graph.client.create_publisher(JointState, 'joint_states', 100)

    def send(i: int) -> None:
        if i < 100 or i % 4:
            states.publish(_state(i * STEP_NS))

    sent = _publish_until(
        graph, send, lambda: 'missing, judging by their period' in graph.message('samples')
    )
    assert graph.count('lost') > 0
    assert "of joints ['pole', 'wheel']" in graph.message('samples')
    sent *= STEP_NS
    _publish_until(
        graph,
        lambda i: states.publish(_state(sent + i * STEP_NS)),
        lambda: 'back to normal: sgp_node: samples: all joint states' in node.stderr,
    )


@pytest.mark.parametrize(
    'reliability', ['BEST_EFFORT', pytest.param('RELIABLE', marks=pytest.mark.long)]
)
def test_a_publisher_that_is_restarted_is_heard_again(graph: Graph, reliability: str) -> None:
    graph.start('sgp_node', **MEASURED)
    quality = QoSProfile(depth=100, reliability=ReliabilityPolicy[reliability])
    for turn in range(2):
        states = graph.client.create_publisher(JointState, 'joint_states', quality)
        before = graph.count('used')
        _publish_until(
            graph,
            lambda i, turn=turn, states=states: states.publish(
                _state((turn * 10**4 + i) * STEP_NS)
            ),
            lambda before=before: graph.count('used') > before + 20,
        )
        graph.client.destroy_publisher(states)


def test_a_node_that_comes_late_or_again_hears_a_publisher_that_was_there(graph: Graph) -> None:
    """The other order of discovery than in most tests, and a restart beside a running robot."""
    states = graph.client.create_publisher(JointState, 'joint_states', 100)
    sent = 0

    def is_heard() -> bool:
        nonlocal sent
        sent += 1
        states.publish(_state(sent * STEP_NS))
        return graph.count('used') > 20

    for _ in range(2):
        node = graph.start('sgp_node', **MEASURED)
        graph.wait_until(is_heard, 'states of a publisher that was there before')
        node.stop(signal.SIGKILL)
        graph.forget()


def _socket_limit() -> int:
    path = Path('/proc/sys/net/core/rmem_max')
    return int(path.read_text()) if path.exists() else 0


@pytest.mark.parametrize(
    ('depth', 'count', 'step_ns', 'is_whole'),
    [
        (5, 4000, 10**6, False),
        pytest.param(
            1000, 500, STEP_NS, True,
            marks=pytest.mark.skipif(_socket_limit() < 4 << 20, reason='net.core.rmem_max'),
        ),
    ],
)  # fmt: skip
def test_every_message_of_a_burst_is_read_or_counted(
    graph: Graph, depth: int, count: int, step_ns: int, *, is_whole: bool
) -> None:
    """Messages that come while the node stands still, more than its queue holds or fewer."""
    node = graph.start('sgp_node', **MEASURED, qos__depth=depth)
    states = graph.client.create_publisher(JointState, 'joint_states', 1000)
    told = graph.collect(DiagnosticArray, '/diagnostics')
    sent, turns = 0, 0

    def send(number: int) -> None:
        nonlocal sent
        for _ in range(number):
            states.publish(_state(sent * step_ns))
            sent += 1

    def accounted() -> int:
        return graph.count('messages') + graph.count('lost')

    def is_period_known() -> bool:
        send(1)
        return graph.count('messages') > KNOWN_AFTER

    def wait_for_what_is_on_its_way() -> None:
        seen = len(told)
        graph.wait_until(lambda: len(told) > seen + 3, 'what was on its way')

    def is_last_read() -> bool:
        """Send one when nothing is on its way: with it, all lost before it are counted."""
        read = graph.count('messages')
        send(1)
        wait_for_what_is_on_its_way()
        return graph.count('messages') > read

    graph.wait_until(is_period_known, 'the first messages')
    wait_for_what_is_on_its_way()
    graph.wait_until(is_last_read, 'a message that is read')
    before, lost = accounted() - sent, graph.count('lost')
    os.kill(node.process.pid, signal.SIGSTOP)
    send(count)
    os.kill(node.process.pid, signal.SIGCONT)

    def are_all_counted() -> bool:
        nonlocal turns
        turns += 1
        if turns % 50 == 0:
            send(1)  # what is missing shows with the message after it
        return accounted() - sent == before

    graph.wait_until(are_all_counted, 'all messages')
    assert (graph.count('lost') == lost) == is_whole


def test_nodes_in_namespaces_of_their_own_share_nothing(graph: Graph, tmp_path: Path) -> None:
    """Three processes with one robot each, and one folder for all of their records."""
    sides = ('left', 'right', 'spare')
    record = tmp_path / '{node}.mcap'
    nodes = [graph.start('sgp_node', namespace=s, record__path=record, **QUICK) for s in sides]
    for side in sides[:2]:
        stream = Stream(graph, namespace=side)
        while graph.status('model', f'{side}/sgp_node').get('ready') != '1':
            stream.publish_until_read(50)
    graph.wait_until(lambda: graph.status('model', 'spare/sgp_node'), 'diagnostics')
    assert graph.count('read', node='spare/sgp_node') == 0
    assert [node.stop() for node in nodes] == [0, 0, 0]
    assert {p.name for p in tmp_path.glob('*.mcap')} == {f'{s}.sgp_node.mcap' for s in sides}
    for side in sides[:2]:
        assert len(list(open_recording(tmp_path / f'{side}.sgp_node.mcap').events())) > 50


def test_residual_lies_in_its_band_and_an_alarm_is_said(graph: Graph) -> None:
    """By name and with the stamp of the prediction; calm while nothing happens."""
    graph.start('sgp_node', **QUICK)
    residuals = graph.collect(JointState, '/sgp_node/residual')
    overlays = graph.collect(JointState, '/sgp_node/predicted_joint_states')
    bands = [graph.collect(JointState, f'/sgp_node/band/{end}') for end in ('lower', 'upper')]
    efforts = graph.collect(JointState, '/sgp_node/measured_effort')
    values = graph.collect(JointState, '/sgp_node/parameter_values', KEPT)
    alarms = graph.collect(Bool, '/sgp_node/alarm', KEPT)
    stream = Stream(graph)

    def is_all_heard() -> bool:
        stream.publish(20)
        return all((len(residuals) > 50, *bands, overlays, efforts, values, alarms))

    graph.wait_until(is_all_heard, 'every topic')
    lower, upper = ({str(m.header.stamp): m for m in band} for band in bands)
    predicted = {str(m.header.stamp): m for m in overlays}
    measured = {str(m.header.stamp): m for m in efforts}
    inside = []
    for residual in residuals:
        key = str(residual.header.stamp)
        if not {key} <= set(lower) & set(upper) & set(predicted) & set(measured):
            continue
        assert list(residual.name) == ['pole', 'wheel']
        low, high, mean = (np.array(m[key].effort) for m in (lower, upper, predicted))
        error, driven = np.array(residual.effort), ~np.isnan(mean)
        known = np.array(measured[key].effort)[driven]
        np.testing.assert_allclose(known, (mean + error)[driven], rtol=1e-9)
        assert driven.tolist() == [False, True]  # a passive joint has no effort
        assert (low <= mean)[driven].all()
        inside += ((low <= mean + error) & (mean + error <= high))[driven].tolist()
    assert np.mean(inside) > 0.8
    assert set(values[-1].name) == {f'w{i}' for i in range(1, 11)}
    low, high = np.array(values[-1].velocity), np.array(values[-1].effort)
    known = ~np.isnan(low)
    assert (low[known] <= np.array(values[-1].position)[known]).all()
    assert (high[known] >= np.array(values[-1].position)[known]).all()


def test_a_node_that_is_killed_goes_on_from_its_last_save(graph: Graph, tmp_path: Path) -> None:
    """And records into a file of its own."""
    settings = {
        **QUICK, 'save__path': tmp_path / '{node}', 'save__period': 0.2, 'save__restore': True,
        'record__path': tmp_path / 'run.mcap',
    }  # fmt: skip
    node = graph.start('sgp_node', **settings)
    stream = Stream(graph)
    while graph.status('model').get('ready') != '1':
        stream.publish_until_read(50)
    saved = tmp_path / 'sgp_node.npz'
    graph.wait_until(saved.is_file, 'a save')
    first = saved.stat().st_mtime_ns
    graph.wait_until(lambda: saved.stat().st_mtime_ns > first, 'another save')
    run = tmp_path / 'run.mcap'
    size = run.stat().st_size
    stream.publish_until_read(50)
    graph.wait_until(lambda: run.stat().st_size > size, 'a flush')
    assert node.stop(signal.SIGKILL) == -signal.SIGKILL
    graph.forget()
    graph.start('sgp_node', **settings)
    graph.wait_until(lambda: graph.count('buffer', 'model') > 0, 'the saved model')
    assert {'run.mcap', 'run_2.mcap'} <= {path.name for path in tmp_path.iterdir()}
    assert len(list(open_recording(run).events())) > 50
