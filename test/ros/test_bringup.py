"""How a node gets its robot and its parameters, alone and beside others."""

from __future__ import annotations

import weakref
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from sgp_ros.errors import ConfigError
from sgp_ros.recordings.reader import open_recording
from sgp_ros.robots.registry import load_robot
from sgp_ros.ros.nodes import SgpNode
from sgp_ros.ros.robot_source import RobotSource, refuse_foreign_files
from test.ros.graph import Graph, spinning
from test.ros.stream import Stream
from test.ros.test_node import QUICK

ROBOTS = Path(__file__).parents[2] / 'config' / 'robots'
URDF = (ROBOTS / 'simple_pendulum.urdf').read_text()
(JOINT,) = load_robot(str(ROBOTS / 'simple_pendulum.urdf')).joint_names
KEPT = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.mark.parametrize('section', ['/**', '/*', 'sgp_node', '/sgp_node', '/**/sgp_node'])
def test_a_file_with_a_section_for_the_node_is_accepted(tmp_path: Path, section: str) -> None:
    path = tmp_path / 'p.yaml'
    path.write_text(
        f"other:\n  ros__parameters: {{a: 1}}\n'{section}':\n  ros__parameters: {{}}\n"
    )
    refuse_foreign_files('/sgp_node', ['sgp_node', '--ros-args', '--params-file', str(path)])


@pytest.mark.parametrize('section', ['/other', '/left/sgp_node', '/*/sgp_node'])
def test_a_file_without_one_is_refused_with_its_sections(tmp_path: Path, section: str) -> None:
    path = tmp_path / 'p.yaml'
    path.write_text(f"'{section}':\n  ros__parameters: {{}}\n")
    with pytest.raises(ConfigError, match='section /sgp_node: or') as caught:
        refuse_foreign_files('/sgp_node', ['--params-file', str(path)])
    assert section in str(caught.value)


@pytest.mark.ros
def test_the_file_of_another_node_is_refused(graph: Graph, tmp_path: Path) -> None:
    path = tmp_path / 'other.yaml'
    path.write_text('/controller_manager:\n  ros__parameters: {robot: panda}\n')
    node = graph.start('sgp_node', file=path)
    assert node.wait() == 2
    assert '/controller_manager' in node.stderr


@pytest.mark.ros
@pytest.mark.parametrize('is_first', [True, False])
def test_the_robot_comes_from_the_latched_description(graph: Graph, *, is_first: bool) -> None:
    """Whichever of the two nodes is there first."""

    def publish() -> Any:
        publisher = graph.client.create_publisher(String, 'robot_description', KEPT)
        publisher.publish(String(data=URDF))
        return publisher

    publisher = publish() if is_first else None
    graph.start('sgp_node', command__type='none', diagnostics__period=0.1)
    if publisher is None:
        graph.wait_until(lambda: 'robot_state_publisher' in graph.message('robot'), 'a remedy')
        publish()
    graph.wait_until(lambda: graph.status(f'fit {JOINT}') is not None and
                     graph.message(f'fit {JOINT}'), 'its joint')  # fmt: skip


@pytest.mark.ros
def test_a_useless_description_is_reported_and_a_better_one_taken(graph: Graph) -> None:
    publisher = graph.client.create_publisher(String, 'robot_description', KEPT)
    publisher.publish(String(data='<mujoco/>'))
    node = graph.start('sgp_node', command__type='none', diagnostics__period=0.1)
    graph.wait_until(lambda: 'mujoco' in graph.message('robot'), 'the problem')
    assert node.is_running
    publisher.publish(String(data=URDF))
    graph.wait_until(lambda: graph.message(f'fit {JOINT}'), 'its joint')


@pytest.mark.ros
def test_a_report_that_comes_after_the_robot_says_nothing(graph: Graph) -> None:
    """An executor may hold the turn of a timer that the description has just destroyed."""
    source = RobotSource(graph.client)
    source.listen()
    source._report()
    source.close()
    source._report()


@pytest.mark.ros
def test_a_description_as_parameter_may_name_the_joints_that_move(graph: Graph) -> None:
    path = graph.folder / 'p.yaml'
    text = (ROBOTS / 'tiago_arm.urdf').read_text().replace("'", '"')
    indented = '\n'.join(f'      {line}' for line in text.splitlines())
    path.write_text(
        '/**:\n  ros__parameters:\n    command.type: none\n    diagnostics.period: 0.1\n'
        f'    joints: [arm_2_joint]\n    robot_description: |\n{indented}\n'
    )
    graph.start('sgp_node', file=path)
    graph.wait_until(lambda: graph.message('fit arm_2_joint'), 'its joint')
    assert not graph.message('fit arm_1_joint')


def _source(graph: Graph, robot: Path | str, *joints: str) -> RobotSource:
    values = {'robot': str(robot), 'joints': list(joints)}
    overrides = [Parameter(name, value=value) for name, value in values.items()]
    node = Node('restricted', parameter_overrides=overrides)
    try:
        return RobotSource(node)
    finally:
        node.destroy_node()


@pytest.mark.ros
def test_a_file_of_the_robot_may_be_restricted_to_joints_too(graph: Graph) -> None:
    """As a description is; a name that it lacks is refused as there."""
    urdf = ROBOTS / 'tiago_arm.urdf'
    source = _source(graph, urdf, 'arm_2_joint')
    assert load_robot(source.robot).joint_names == ('arm_2_joint',)
    assert _source(graph, urdf, '').robot == str(urdf)
    with pytest.raises(ConfigError, match='arm_9_joint'):
        load_robot(_source(graph, urdf, 'arm_9_joint').robot)


@pytest.mark.ros
@pytest.mark.parametrize('robot', ['panda', ROBOTS / 'tiago_arm.yaml'])
def test_joints_beside_a_robot_that_states_its_own_are_refused(
    graph: Graph, robot: Path | str
) -> None:
    with pytest.raises(ConfigError, match='parameter joints is set for robot'):
        _source(graph, robot, 'arm_2_joint')


def _overrides(**settings: Any) -> list[Parameter]:
    return [Parameter(n.replace('__', '.'), value=v) for n, v in {**QUICK, **settings}.items()]


@pytest.fixture
def composed(context: int) -> Iterator[list[SgpNode]]:
    """Two nodes under one executor in a thread of this process."""
    nodes = [
        SgpNode(namespace=side, parameter_overrides=_overrides(buffer__budget=budget))
        for side, budget in (('left', 30), ('right', 40))
    ]
    with spinning() as executor:
        for node in nodes:
            executor.add_node(node)
        yield nodes
    for node in nodes:
        node.destroy_node()


@pytest.mark.ros
@pytest.mark.usefixtures('composed')
def test_nodes_are_composed_in_one_process(graph: Graph) -> None:
    """Each has its own parameters and topics."""
    for side in ('left', 'right'):
        stream = Stream(graph, namespace=side)
        while graph.status('model', f'{side}/sgp_node').get('ready') != '1':
            stream.publish_until_read(50)
    assert graph.status('model', 'left/sgp_node')['budget'] == '30'
    assert graph.status('model', 'right/sgp_node')['budget'] == '40'


@pytest.mark.ros
def test_a_node_that_cannot_start_raises_in_the_process_that_made_it(context: int) -> None:
    with pytest.raises(ConfigError, match='submarine'):
        SgpNode(parameter_overrides=_overrides(robot='submarine'))


@pytest.mark.ros
def test_a_node_that_ended_leaves_nothing_in_memory(context: int) -> None:
    """Nodes come and go in one process; what exists is exempt from the search for garbage."""
    node = SgpNode(parameter_overrides=_overrides(robot='reaction_wheel'))
    kept = weakref.ref(node)
    node.destroy_node()
    del node
    other = SgpNode(parameter_overrides=_overrides(robot='reaction_wheel'))
    other.destroy_node()
    assert kept() is None


@pytest.mark.ros
def test_a_managed_node_goes_through_its_transitions(graph: Graph) -> None:
    """It listens only while it is active, keeps its model while it is not, and forgets it in
    `cleanup`; an impossible transition is refused and ends nothing."""
    node = graph.start('sgp_lifecycle_node', **QUICK)

    def change(transition: int) -> bool:
        request = ChangeState.Request(transition=Transition(id=transition))
        return bool(graph.call(ChangeState, '/sgp_node/change_state', request).success)

    def state() -> str:
        return str(graph.call(GetState, '/sgp_node/get_state').current_state.label)

    assert not change(Transition.TRANSITION_ACTIVATE)
    assert state() == 'unconfigured'
    assert change(Transition.TRANSITION_CONFIGURE)
    graph.wait_until(lambda: graph.status('model'), 'a model')
    assert change(Transition.TRANSITION_ACTIVATE)
    stream = Stream(graph)
    while graph.status('model').get('ready') != '1':
        stream.publish_until_read(50)
    assert change(Transition.TRANSITION_DEACTIVATE)
    graph.wait_until(lambda: not stream.states.get_subscription_count(), 'no listener')
    assert graph.status('model')['ready'] == '1'
    assert change(Transition.TRANSITION_ACTIVATE)
    graph.wait_until(stream.states.get_subscription_count, 'a listener')
    stream.publish_until_read(20)
    assert change(Transition.TRANSITION_DEACTIVATE)
    assert change(Transition.TRANSITION_CLEANUP)
    assert change(Transition.TRANSITION_CONFIGURE)
    graph.wait_until(lambda: graph.status('model').get('buffer') == '0', 'an empty model')
    assert node.stop() == 0
    assert 'Traceback' not in node.stderr


@pytest.mark.ros
def test_a_managed_node_that_is_shut_down_completes_its_record(
    graph: Graph, tmp_path: Path
) -> None:
    """While it is active, with messages on the way."""
    path = tmp_path / 'run.mcap'
    node = graph.start('sgp_lifecycle_node', record__path=path, **QUICK)

    def change(transition: int) -> bool:
        request = ChangeState.Request(transition=Transition(id=transition))
        return bool(graph.call(ChangeState, '/sgp_node/change_state', request).success)

    assert change(Transition.TRANSITION_CONFIGURE)
    assert change(Transition.TRANSITION_ACTIVATE)
    stream = Stream(graph)
    stream.publish_until_read(50)
    assert change(Transition.TRANSITION_ACTIVE_SHUTDOWN)
    state = graph.call(GetState, '/sgp_node/get_state').current_state.label
    assert state == 'finalized'
    assert not change(Transition.TRANSITION_CONFIGURE)
    recording = open_recording(path)
    assert not recording.remarks
    assert len(list(recording.events())) > 50
    assert node.stop() == 0


@pytest.mark.ros
def test_a_managed_node_that_cannot_be_configured_says_why_and_waits(graph: Graph) -> None:
    node = graph.start('sgp_lifecycle_node', **{**QUICK, 'robot': 'submarine'})
    request = ChangeState.Request(transition=Transition(id=Transition.TRANSITION_CONFIGURE))
    for _ in range(2):
        assert not graph.call(ChangeState, '/sgp_node/change_state', request).success
    assert 'submarine' in node.stderr
    assert node.is_running


@pytest.mark.ros
def test_a_managed_node_without_a_robot_is_not_configured(graph: Graph) -> None:
    graph.start('sgp_lifecycle_node', command__type='none', diagnostics__period=0.1)
    request = ChangeState.Request(transition=Transition(id=Transition.TRANSITION_CONFIGURE))
    assert not graph.call(ChangeState, '/sgp_node/change_state', request).success
    publisher = graph.client.create_publisher(String, 'robot_description', KEPT)
    publisher.publish(String(data=URDF))

    def configured() -> bool:
        return bool(graph.call(ChangeState, '/sgp_node/change_state', request).success)

    graph.wait_until(configured, 'the description')
