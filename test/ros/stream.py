"""A simulated reaction wheel that the tests publish, with stamps of its own."""

from __future__ import annotations

import numpy as np
from sensor_msgs.msg import JointState

from sgp_ros.engine.samples import JointSample
from sgp_ros.recordings.messages import header, joint_state_message
from sgp_ros.ros.messages import new_message
from sgp_ros.simulation.assembly import make_simulation
from test.ros.graph import Graph

START_NS = 1_700_000_000_000_000_000


class Stream:
    """Publishes commands and states of a simulation, one sample after the other."""

    def __init__(self, graph: Graph, seed: int = 1, namespace: str = '') -> None:
        self._graph = graph
        self._node = f'{namespace}/sgp_node'.lstrip('/')
        self._simulation = make_simulation('reaction_wheel', seed=seed, start_ns=START_NS)
        self.states = graph.client.create_publisher(JointState, f'{namespace}/joint_states', 1000)
        self.commands = graph.client.create_publisher(JointState, f'{namespace}/command', 1000)
        graph.wait_until(self._is_heard, 'a listener')
        graph.wait_until(lambda: graph.status('samples', self._node), 'diagnostics')

    def state(self) -> JointState:
        """Publish the next command and return the state that belongs to it."""
        sample = self._simulation.step()
        self.commands.publish(
            JointState(
                header=header(new_message, sample.stamp_ns),
                name=['wheel'],
                effort=sample.command.tolist(),
            )
        )
        state = JointSample(sample.stamp_ns, self._simulation.joint_names, sample.position)
        return joint_state_message(new_message, state)

    def publish(self, count: int) -> list[JointState]:
        """Publish that many samples and return the states."""
        states = []
        for _ in range(count):
            states.append(self.state())
            self.states.publish(states[-1])
            self._graph.turn(0.001)
        return states

    def publish_until_read(self, count: int) -> None:
        """Publish this many samples, and more until the node has read as many.

        A publisher may find a listener before the listener finds it; what it sends meanwhile is
        lost.
        """
        before = self._graph.count('read', node=self._node)

        def are_read() -> bool:
            found = self._graph.count('read', node=self._node) >= before + count
            if not found:
                self.publish(1)
            return found

        self.publish(count)
        self._graph.wait_until(are_read, 'states read')

    def _is_heard(self) -> bool:
        publishers = (self.states, self.commands)
        return all(publisher.get_subscription_count() for publisher in publishers)


def stamp_ns(message: JointState) -> int:
    """Return the header stamp [ns]."""
    return int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)


def shuffled(message: JointState, rng: np.random.Generator) -> JointState:
    """Return the same state with its joints in another order and one more joint."""
    names = [*message.name, 'gripper']
    position = [*message.position, 0.5]
    order = rng.permutation(len(names))
    return JointState(
        header=message.header,
        name=[names[i] for i in order],
        position=[float(position[i]) for i in order],
    )
