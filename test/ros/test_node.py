"""The node over real DDS."""

from __future__ import annotations

import math
import os
import resource
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory

from sgp_ros.engine.samples import JointSample
from sgp_ros.errors import RecordingError
from sgp_ros.recordings.reader import open_recording
from test.ros.graph import DEADLINE_S, Graph, NodeProcess
from test.ros.replayed import recorded_predictions, replayed_predictions
from test.ros.stream import START_NS, Stream, shuffled, stamp_ns

pytestmark = pytest.mark.ros

QUICK = {
    'robot': 'reaction_wheel',
    'command__type': 'sensor_msgs/JointState',
    'diagnostics__period': 0.1,
    'parameters__period': 0.1,
    'filter__hop': 0.0,
    'learning__initial': 20,
    'reorder_window': 0.02,
    'refit__enabled': False,
}


def _start(graph: Graph, **settings: Any) -> NodeProcess:
    return graph.start('sgp_node', **{**QUICK, **settings})


def _ready(graph: Graph, stream: Stream) -> None:
    while graph.status('model').get('ready') != '1':
        stream.publish_until_read(50)


@pytest.mark.parametrize('name', ['sgp_node', 'reaction_wheel'])
def test_help_is_printed_and_no_node_started(name: str, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, '-m', f'sgp_ros.ros.{name}', '--help'],
        capture_output=True, text=True, check=False, timeout=DEADLINE_S,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert f'usage: {name}' in done.stdout
    assert '--ros-args' in done.stdout


def test_every_topic_and_service_of_the_contract_exists(graph: Graph) -> None:
    _start(graph)
    expected = {
        '/sgp_node/prediction': 'trajectory_msgs/msg/JointTrajectory',
        '/sgp_node/prediction_variance': 'trajectory_msgs/msg/JointTrajectory',
        '/sgp_node/prediction_raw_variance': 'trajectory_msgs/msg/JointTrajectory',
        '/sgp_node/predicted_joint_states': 'sensor_msgs/msg/JointState',
        '/sgp_node/residual': 'sensor_msgs/msg/JointState',
        '/sgp_node/band/lower': 'sensor_msgs/msg/JointState',
        '/sgp_node/band/upper': 'sensor_msgs/msg/JointState',
        '/sgp_node/parameters': 'diagnostic_msgs/msg/DiagnosticArray',
        '/sgp_node/parameter_values': 'sensor_msgs/msg/JointState',
        '/sgp_node/monitor': 'diagnostic_msgs/msg/DiagnosticArray',
        '/sgp_node/alarm': 'std_msgs/msg/Bool',
        '/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray',
        '/joint_states': 'sensor_msgs/msg/JointState',
        '/command': 'sensor_msgs/msg/JointState',
    }
    services = {
        **{
            f'/sgp_node/{n}': 'Trigger'
            for n in ('refit', 'reset', 'save', 'diagnose', 'cancel_diagnosis')
        },
        '/sgp_node/learn': 'SetBool',
    }

    def found() -> bool:
        topics = dict(graph.client.get_topic_names_and_types())
        offered = dict(graph.client.get_service_names_and_types())
        return all(topics.get(name) == [kind] for name, kind in expected.items()) and all(
            offered.get(name) == [f'std_srvs/srv/{kind}'] for name, kind in services.items()
        )

    graph.wait_until(found, 'topics and services')


def test_predictions_carry_stamp_and_names_of_their_samples(graph: Graph) -> None:
    _start(graph)
    kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    means = graph.collect(JointTrajectory, '/sgp_node/prediction')
    variances = graph.collect(JointTrajectory, '/sgp_node/prediction_variance')
    overlays = graph.collect(JointState, '/sgp_node/predicted_joint_states')
    coefficients = graph.collect(DiagnosticArray, '/sgp_node/parameters', kept)
    stream = Stream(graph)
    states = stream.publish(150)
    while not (means and variances and overlays and coefficients):
        states += stream.publish(20)
    sent = {stamp_ns(state): state for state in states}
    mean, variance, overlay = means[-1], variances[-1], overlays[-1]
    assert stamp_ns(mean) in sent
    assert list(mean.joint_names) == ['pole', 'wheel']
    (point,) = mean.points
    assert [len(a) for a in (point.positions, point.velocities)] == [2, 2]
    assert [len(a) for a in (point.accelerations, point.effort)] == [2, 2]
    (spread,) = variance.points
    assert not spread.positions
    assert not spread.velocities
    assert min(spread.accelerations) > 0.0
    assert list(overlay.name) == ['pole', 'wheel']
    assert len(overlay.effort) == 2
    by_name = {s.name: {v.key: v.value for v in s.values} for s in coefficients[-1].status}
    assert set(by_name) == {f'w{i}' for i in range(1, 11)}
    assert all(math.isfinite(float(values['value'])) for values in by_name.values())


def test_joint_order_of_each_message_is_irrelevant(graph: Graph) -> None:
    _start(graph)
    stream, rng = Stream(graph), np.random.default_rng(3)
    for _ in range(200):
        stream.states.publish(shuffled(stream.state(), rng))
        graph.turn(0.001)
    graph.wait_until(lambda: graph.status('model').get('ready') == '1', 'a model')
    refused = {n: v for n, v in graph.status('samples').items() if n.startswith('refused.')}
    assert set(refused.values()) == {'0'}


def test_what_cannot_be_used_is_counted_by_reason(graph: Graph) -> None:
    _start(graph, command__type='std_msgs/Float64MultiArray')
    states = graph.client.create_publisher(JointState, 'joint_states', 10)
    commands = graph.client.create_publisher(Float64MultiArray, 'command', 10)

    def publish(publisher: Any, message: Any, key: str) -> None:
        def counted() -> bool:
            publisher.publish(message)
            return graph.count(key) > 0

        graph.wait_until(counted, key)

    names = ['pole', 'wheel']
    publish(commands, Float64MultiArray(data=[1.0, 2.0, 3.0]), 'commands_refused.wrong_length')
    publish(states, JointState(name=names, position=[math.nan, 0.0]), 'refused.nonfinite')
    publish(states, JointState(name=['elbow'], position=[0.0]), 'of_other_joints')
    publish(states, JointState(name=names, position=[0.0]), 'unreadable')
    publish(states, JointState(name=names, position=[0.0, 0.0]), 'refused.unpaired')


def test_a_zero_stamp_is_replaced_by_the_time_of_receipt(graph: Graph, tmp_path: Path) -> None:
    node = _start(graph, record__path=tmp_path / 'a.mcap')
    states = graph.client.create_publisher(JointState, 'joint_states', 10)
    message = JointState(name=['pole', 'wheel'], position=[0.0, 0.0])

    def counted() -> bool:
        states.publish(message)
        return graph.count('read') >= 3

    graph.wait_until(counted, 'states')
    assert graph.count('refused.late') == 0
    assert node.stop() == 0
    stamps = [e.stamp_ns for e in open_recording(tmp_path / 'a.mcap').events()]
    assert min(stamps) > START_NS


def test_an_invalid_parameter_is_refused_with_the_reason_and_changes_nothing(
    graph: Graph,
) -> None:
    _start(graph)
    client = graph.parameters()
    for name, value, reason in (
        ('filter.window', -2.0, 'filter.window'),
        ('filter.window', -0.5, 'filter.window'),
        ('filter.window', 1, 'DOUBLE'),
        ('filter.velocity', 'guessed', 'measured'),
        ('hyper.pole.lengthscales', [1.0, 2.0, 3.0], '2 positive'),
        ('model.method', 'PR', 'read-only'),
        ('seed', -1, 'seed'),
    ):
        before = graph.answer(client.get_parameters([name])).values
        answer = graph.answer(client.set_parameters([Parameter(name, value=value)]))
        (result,) = answer.results
        assert not result.successful
        assert reason in result.reason
        assert graph.answer(client.get_parameters([name])).values == before


def test_a_valid_parameter_takes_effect(graph: Graph) -> None:
    _start(graph, buffer__budget=40)
    stream = Stream(graph)
    _ready(graph, stream)
    client = graph.parameters()
    change = [Parameter('buffer.budget', value=10)]
    (result,) = graph.answer(client.set_parameters(change)).results
    assert result.successful, result.reason
    graph.wait_until(lambda: graph.count('buffer', 'model') == 10, 'a smaller buffer')


@pytest.mark.parametrize(
    'kernel',
    ['squared_exponential',
     pytest.param('additive_squared_exponential', marks=pytest.mark.long)],
)  # fmt: skip
def test_a_dump_of_the_parameters_loads_again(graph: Graph, tmp_path: Path, kernel: str) -> None:
    node = _start(graph, model__kernel=kernel)
    _ready(graph, Stream(graph))
    dumped = _dump(graph)
    assert min(dumped['hyper.pole.lengthscales']) > 0.0  # what is in force, not 'automatic'
    assert ('hyper.pole.signal_variances' in dumped) == kernel.startswith('additive')
    assert node.stop() == 0
    path = tmp_path / 'dump.yaml'
    path.write_text(yaml.safe_dump({'/sgp_node': {'ros__parameters': dumped}}))
    graph.start('sgp_node', file=path)
    assert _dump(graph) == dumped
    for name, value in dumped.items():  # as `ros2 param load` does, one by one
        (result,) = graph.answer(
            graph.parameters().set_parameters([Parameter(name, value=value)])
        ).results
        assert result.successful or 'read-only' in result.reason, (name, result.reason)


def _dump(graph: Graph) -> dict[str, Any]:
    client = graph.parameters()
    names = sorted(graph.answer(client.list_parameters([], 0)).result.names)
    values = graph.answer(client.get_parameters(names)).values
    python = [parameter_value_to_python(value) for value in values]
    listed = [v if isinstance(v, (str, int, float, bool)) else list(v) for v in python]
    return dict(zip(names, listed, strict=True))


def test_services_answer(graph: Graph) -> None:
    _start(graph)
    refit = graph.call(Trigger, '/sgp_node/refit')
    assert not refit.success
    assert 'learning.initial' in refit.message
    diagnose = graph.call(Trigger, '/sgp_node/diagnose')
    assert not diagnose.success
    assert 'too few states: 0' in diagnose.message
    assert graph.call(SetBool, '/sgp_node/learn', SetBool.Request(data=False)).success
    client = graph.parameters()
    (value,) = graph.answer(client.get_parameters(['learning.enabled'])).values
    assert value.bool_value is False
    assert graph.call(SetBool, '/sgp_node/learn', SetBool.Request(data=True)).success
    _ready(graph, Stream(graph))
    assert graph.call(Trigger, '/sgp_node/reset').success
    graph.wait_until(lambda: graph.status('model')['ready'] == '0', 'an empty model')


def test_a_saved_model_goes_on_in_another_node(graph: Graph, tmp_path: Path) -> None:
    path = tmp_path / 'deep' / 'model.npz'
    node = _start(graph, save__path=path, buffer__budget=33)
    _ready(graph, Stream(graph))
    answer = graph.call(Trigger, '/sgp_node/save')
    assert answer.success
    assert answer.message == str(path)
    assert node.stop() == 0
    assert list(path.parent.iterdir()) == [path]
    _start(graph, model__path=path)
    values = graph.answer(graph.parameters().get_parameters(['buffer.budget'])).values
    assert values[0].integer_value == 33
    graph.wait_until(lambda: graph.status('model').get('ready') == '1', 'the saved model')


def test_a_model_is_saved_by_name_in_the_folder_of_save_path(graph: Graph, tmp_path: Path) -> None:
    """No name leads out of it, and none takes the file of somebody else."""
    folder = tmp_path / 'models'
    folder.mkdir()
    (folder / 'mine.npz').write_text('mine')
    _start(graph, save__path=folder / 'model.npz')
    client = graph.parameters()

    def rename(name: str) -> Any:
        wanted = [Parameter('save.name', value=name), Parameter('buffer.budget', value=33)]
        return graph.answer(client.set_parameters_atomically(wanted)).result

    for name in ('../x', '/x', '.x', '-x', 'a b', 'a\nb', 'x' * 101):
        answer = rename(name)
        assert not answer.successful
        assert 'save.name' in answer.reason
        assert '\n' not in answer.reason
    (value,) = graph.answer(client.get_parameters(['buffer.budget'])).values
    assert value.integer_value != 33
    assert rename('arm-2.b').successful
    for _ in range(2):
        assert graph.call(Trigger, '/sgp_node/save').message == str(folder / 'arm-2.b.npz')
    assert rename('mine').successful
    assert 'is not a saved model' in graph.call(Trigger, '/sgp_node/save').message
    assert (folder / 'mine.npz').read_text() == 'mine'
    assert rename('').successful
    assert graph.call(Trigger, '/sgp_node/save').message == str(folder / 'model.npz')
    assert {p.name for p in tmp_path.rglob('*.npz')} == {'mine.npz', 'arm-2.b.npz', 'model.npz'}


def test_a_killed_fit_is_reported_and_the_node_goes_on(graph: Graph) -> None:
    node = _start(graph)
    stream = Stream(graph)
    _ready(graph, stream)
    (worker,) = graph.wait_until(lambda: node.children('multiprocessing.spawn'), 'a worker')
    os.kill(worker, signal.SIGKILL)
    graph.wait_until(lambda: 'lost' in graph.status('model')['last_refit'], 'the report')
    assert graph.call(Trigger, '/sgp_node/refit').success
    fitted = ('refused', 'rose')
    graph.wait_until(
        lambda: any(w in graph.status('model')['last_refit'] for w in fitted), 'another fit'
    )
    stream.publish_until_read(20)


@pytest.mark.parametrize(
    'number', [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.long)]
)
def test_a_signal_ends_the_nodes_without_trace(graph: Graph, number: int) -> None:
    node, robot = _start(graph), graph.start('reaction_wheel')
    graph.wait_until(lambda: graph.count('read') > 10, 'states')
    children = node.children()
    assert children
    for process in (robot, node):
        assert process.stop(number, whole_group=True) == 0
        assert 'Traceback' not in process.stderr
    graph.wait_until(lambda: not any(map(_is_alive, children)), 'the end of the children')


def _is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_no_killed_node_leaves_shared_memory_that_another_opens(graph: Graph) -> None:
    node = _start(graph)
    Stream(graph).publish_until_read(5)
    for pid in (os.getpid(), node.process.pid):
        assert '/dev/shm/fastrtps' not in Path(f'/proc/{pid}/maps').read_text()


def test_a_record_survives_a_killed_node(graph: Graph, tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    node = _start(graph, record__path=path)
    stream = Stream(graph)
    _ready(graph, stream)
    size = path.stat().st_size
    stream.publish_until_read(50)
    graph.wait_until(lambda: path.stat().st_size > size, 'a flush')
    assert node.stop(signal.SIGKILL) == -signal.SIGKILL
    recording = open_recording(path)
    assert len(list(recording.events())) > 50
    assert 'recovered' in ' '.join(recording.remarks)


@pytest.mark.parametrize(
    'number', [signal.SIGINT, pytest.param(signal.SIGKILL, marks=pytest.mark.long)]
)
def test_a_record_split_by_age_replays_to_the_same_numbers(
    graph: Graph, tmp_path: Path, number: int
) -> None:
    """The folder is what one file would be, whether the node ended or was killed."""
    folder = tmp_path / 'run'
    node = _start(graph, record__path=f'{folder}.mcap', record__split__age=0.1)
    stream = Stream(graph)
    _ready(graph, stream)

    def has_parts() -> bool:
        stream.publish(20)
        return len(list(folder.iterdir())) > 3

    graph.wait_until(has_parts, 'parts of the record')
    node.stop(number)
    parts = sorted(folder.iterdir(), key=lambda path: int(path.stem.removeprefix('run_')))
    complete = parts[:-1] if number == signal.SIGKILL else parts
    given = {name.replace('__', '.'): value for name, value in QUICK.items()}
    live, again = recorded_predictions(*complete), replayed_predictions(folder, given)
    assert len(live) > 50
    assert live.items() <= again.items() if number == signal.SIGKILL else live == again


def test_a_full_disk_ends_the_record_and_not_the_node(graph: Graph, tmp_path: Path) -> None:
    """As a bound on the size of files does here; /diagnostics says it, and counts what is lost."""
    path = tmp_path / 'run.mcap'
    node = _start(graph, record__path=path)
    stream = Stream(graph)
    stream.publish_until_read(60)
    graph.wait_until(lambda: path.exists() and _recorded(path) > 20, 'a record')
    limit = (path.stat().st_size + 100,) * 2
    resource.prlimit(node.process.pid, resource.RLIMIT_FSIZE, limit)
    stream.publish_until_read(30)
    graph.wait_until(lambda: 'too large' in graph.message('record'), 'the end of the record')
    stream.publish_until_read(10)
    graph.wait_until(lambda: graph.count('unrecorded', 'record') >= 10, 'what is not recorded')
    assert node.stop() == 0
    assert 'Traceback' not in node.stderr
    assert _recorded(path) > 20


def _recorded(path: Path) -> int:
    """Return the number of states that a record holds so far."""
    try:
        return sum(isinstance(e, JointSample) for e in open_recording(path).events())
    except RecordingError:
        return 0


@pytest.mark.parametrize(
    ('settings', 'expected'),
    [
        ({'robot': 'submarine'}, 'submarine'),
        ({'robot': 'panda', 'filter__window': 1}, 'filter.window'),
        ({'robot': 'panda', 'filter__window': -2.0, 'buffer__budget': 1}, '2 wrong parameter'),
        ({'robot': 'panda', 'command__type': 'std_msgs/Bool'}, 'command.type'),
        ({'robot': 'panda', 'model__path': '/no/model.npz'}, 'no model file /no/model.npz'),
        (
            {'robbot': 'panda', 'hello': 3},
            'unknown parameters: hello, robbot (did you mean robot?)',
        ),
        ({'robot': 'panda', 'hyper__elbow__noise_variance': 1.0}, 'hyper.elbow.noise_variance'),
    ],
)
def test_a_node_that_cannot_start_says_why_in_one_line(
    graph: Graph, settings: dict[str, Any], expected: str
) -> None:
    node = graph.start('sgp_node', **settings)
    assert node.wait() == 2
    assert expected in node.stderr
    assert len(node.stderr.splitlines()) == 1


def test_live_callbacks_equal_the_replay_of_their_record(graph: Graph, tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    node = _start(graph, record__path=path, refit__enabled=True, refit__period=40)
    stream = Stream(graph)
    _ready(graph, stream)
    client = graph.parameters()
    change = [Parameter('buffer.budget', value=30)]
    assert graph.answer(client.set_parameters(change)).results[0].successful
    stream.publish_until_read(60)
    assert graph.call(Trigger, '/sgp_node/refit').success
    graph.wait_until(lambda: graph.count('refits', 'model') > 0, 'a fit')
    stream.publish_until_read(60)
    assert node.stop() == 0
    given = {name.replace('__', '.'): value for name, value in QUICK.items()}
    live, again = recorded_predictions(path), replayed_predictions(path, given)
    assert len(live) > 100
    assert live == again
