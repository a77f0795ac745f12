"""The simulated robot over real DDS."""

from __future__ import annotations

import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from test.ros.graph import Graph
from test.ros.stream import stamp_ns

pytestmark = pytest.mark.ros


def test_every_state_has_a_command_of_its_stamp(graph: Graph) -> None:
    graph.start('reaction_wheel', rate=200.0, command__type='sensor_msgs/JointState')
    commands = graph.collect(JointState, 'command')
    states = graph.collect(JointState, 'joint_states')
    graph.wait_until(lambda: len(states) > 50 and len(commands) > 50, 'states and commands')
    common = {stamp_ns(m) for m in commands}
    later = [stamp_ns(m) for m in states[10:50]]
    assert all(stamp in common for stamp in later)
    assert later == sorted(set(later))
    assert list(states[0].name) == ['pole', 'wheel']
    assert not states[0].velocity
    assert list(commands[0].name) == ['wheel']


def test_velocity_and_array_commands_are_choices(graph: Graph) -> None:
    graph.start(
        'reaction_wheel', publish_velocity=True, command__type='std_msgs/Float64MultiArray'
    )
    commands = graph.collect(Float64MultiArray, 'command')
    states = graph.collect(JointState, 'joint_states')
    graph.wait_until(lambda: states and commands, 'states and commands')
    assert len(states[0].velocity) == 2
    assert len(commands[0].data) == 1


def test_an_external_command_moves_the_wheel(graph: Graph) -> None:
    robot = graph.start(
        'reaction_wheel', controller='external', command__type='std_msgs/Float64MultiArray'
    )
    states = graph.collect(JointState, 'joint_states')
    commands = graph.client.create_publisher(Float64MultiArray, 'command', 10)

    def moved() -> bool:
        commands.publish(Float64MultiArray(data=[6.0]))
        return bool(states) and states[-1].position[1] > 1.0

    graph.wait_until(moved, 'motion of the wheel')
    commands.publish(Float64MultiArray(data=[6.0, 1.0]))
    graph.wait_until(lambda: 'expected one number' in robot.stderr, 'a refused command')


def test_an_unknown_effect_ends_the_start_in_one_line(graph: Graph) -> None:
    robot = graph.start('reaction_wheel', effects="['gravity_waves:joint=pole']")
    assert robot.wait() == 2
    assert 'gravity_waves' in robot.stderr
    assert len(robot.stderr.splitlines()) == 1
