"""Nodes in a context of their own, beside the one of the process."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
import rclpy
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.parameter import Parameter

from sgp_ros.ros.nodes import SgpLifecycleNode, SgpNode
from test.ros.graph import Graph, spinning
from test.ros.stream import Stream
from test.ros.test_node import QUICK

pytestmark = pytest.mark.ros
OF_CONTEXT = ['--ros-args', '-r', '__ns:=/own', '-p', 'buffer.budget:=33']
"""Arguments that a node has from its context, and from no other."""


@pytest.fixture(params=[SgpNode, SgpLifecycleNode])
def node(context: int, request: Any) -> Iterator[SgpNode | SgpLifecycleNode]:
    """Return a node that an executor of its own context serves in a thread."""
    own = rclpy.Context()
    rclpy.init(args=OF_CONTEXT, context=own)
    overrides = [Parameter(n.replace('__', '.'), value=v) for n, v in QUICK.items()]
    made = request.param(context=own, parameter_overrides=overrides)
    with spinning(own) as executor:
        executor.add_node(made)
        yield made
    made.destroy_node()
    own.shutdown()
    assert rclpy.ok()


def test_a_node_works_in_a_context_of_its_own(
    graph: Graph, node: SgpNode | SgpLifecycleNode
) -> None:
    """Whose arguments it takes, and whose end is not that of the other context."""
    assert node.get_fully_qualified_name() == '/own/sgp_node'
    if isinstance(node, SgpLifecycleNode):
        for number in (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE):
            request = ChangeState.Request(transition=Transition(id=number))
            assert graph.call(ChangeState, '/own/sgp_node/change_state', request).success
    stream = Stream(graph, namespace='own')
    while graph.status('model', 'own/sgp_node').get('ready') != '1':
        stream.publish_until_read(50)
    assert graph.status('model', 'own/sgp_node')['budget'] == '33'
