"""Commands of every type, and the time of a simulator, over DDS into nodes of this process."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from sgp_ros.engine.engine import Engine
from sgp_ros.engine.samples import CommandSample, frozen_array
from sgp_ros.recordings.command_types import COMMAND_TYPES
from sgp_ros.recordings.messages import header
from sgp_ros.ros.messages import message_class, new_message
from sgp_ros.ros.nodes import SgpNode
from test.ros.graph import Graph, spinning
from test.ros.stream import START_NS
from test.ros.test_node import QUICK

pytestmark = pytest.mark.ros
STEP_NS = 10**7
Start = Callable[..., Engine]


@pytest.fixture
def start(context: int) -> Iterator[Start]:
    """Make nodes under one executor in a thread, and return the engine behind each."""
    nodes: list[SgpNode] = []

    def made(namespace: str, **settings: Any) -> Engine:
        given = {**QUICK, **settings}
        overrides = [Parameter(n.replace('__', '.'), value=v) for n, v in given.items()]
        nodes.append(SgpNode(namespace=namespace, parameter_overrides=overrides))
        executor.add_node(nodes[-1])
        found = nodes[-1]._identification
        assert found is not None
        return found._session.engine

    with spinning() as executor:
        yield made
    for node in nodes:
        node.destroy_node()


def _state(stamp_ns: int, turn: int) -> JointState:
    return JointState(
        header=header(new_message, stamp_ns), name=['pole', 'wheel'],
        position=[0.3 * (turn % 7), 0.2 * (turn % 5)],
    )  # fmt: skip


def test_commands_of_every_type_reach_the_engine(graph: Graph, start: Start) -> None:
    """Types without a header are stamped on receipt, and so are the states here."""
    pauses = {'max_gap': 10.0, 'command__timeout': 10.0}  # of a loaded computer
    engines, publishers = {}, {}
    for i, (name, kind) in enumerate(COMMAND_TYPES.items()):
        engines[name] = start(f'n{i}', command__type=name, **pauses)
        publishers[name] = (
            graph.client.create_publisher(message_class(name), f'n{i}/command', 100),
            graph.client.create_publisher(JointState, f'n{i}/joint_states', 100),
            kind,
        )
    turn = 0

    def are_used() -> bool:
        nonlocal turn
        turn += 1
        for command, states, kind in publishers.values():
            names = ('wheel',) if kind.has_names else None
            sample = CommandSample(0, frozen_array([0.01 * turn]), names)
            command.publish(kind.message(new_message, sample))
            states.publish(_state(0, turn))
        counts = [engine.counts for engine in engines.values()]
        return all(c.commands_used > 5 and c.used > 5 for c in counts)

    graph.wait_until(are_used, 'commands and states')
    for engine in engines.values():
        assert max(abs(x).max() for x in engine.intake.commands.efforts) > 0.0


def test_a_node_follows_the_time_of_a_simulator(graph: Graph, start: Start) -> None:
    """Commands without a stamp get that of /clock; a reset begins a new segment, no new model.

    A step follows when the last one was read: of what waits on several topics no order is kept.
    """
    engine = start(
        'sim', use_sim_time=True, command__type='std_msgs/Float64MultiArray', command__timeout=0.5
    )
    clock = graph.client.create_publisher(Clock, '/clock', 10)
    command = graph.client.create_publisher(Float64MultiArray, 'sim/command', 100)
    states = graph.client.create_publisher(JointState, 'sim/joint_states', 100)
    turn, heard = 0, 0

    def steps_until(is_done: Callable[[], bool], begin_ns: int) -> None:
        nonlocal heard
        first, heard = turn, -1

        def one() -> bool:
            nonlocal turn, heard
            if engine.counts.read > heard or not engine.counts.read:
                heard = engine.counts.read
                turn += 1
                now_ns = begin_ns + (turn - first) * STEP_NS
                clock.publish(Clock(clock=header(new_message, now_ns).stamp))
                command.publish(Float64MultiArray(data=[0.1 * (turn % 3)]))
                states.publish(_state(now_ns, turn))
            return is_done()

        graph.wait_until(one, 'states of the simulated time')

    steps_until(lambda: engine.counts.used > 30 and engine.counts.estimated > 5, START_NS)
    before = engine.counts.used
    steps_until(lambda: engine.counts.used > before + 30, 10**9)
    assert engine.counts.clock_jumps == 1
    assert engine.counts.refused['clock'] == engine.counts.refused['late'] == 0
    assert engine.intake.commands.stamps_ns[-1] < 10**12
