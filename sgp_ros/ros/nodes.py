"""The node that identifies a robot online: plain, and with the lifecycle of a managed node.

Both are nodes like any other of rclpy: they take `namespace`, `parameter_overrides`, `context` and
what else `Node` takes, and several of them run in one process, under one executor:

    node = SgpNode(namespace='left', parameter_overrides=[Parameter('robot', value='panda')])
    executor.add_node(node)

Bit-for-bit equality of a run and its replay needs one thread in the linear algebra, and only the
process that imports NumPy can choose that, see `node_main`.
"""

from __future__ import annotations

from typing import Any

from lifecycle_msgs.srv import ChangeState
from rclpy.exceptions import ParameterException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.node import Node

from sgp_ros.errors import SgpError
from sgp_ros.ros.identification import Identification
from sgp_ros.ros.node_main import settle_memory
from sgp_ros.ros.robot_source import RobotSource


class SgpNode(Node):  # type: ignore[misc]  # rclpy is untyped
    """Identifies a robot as soon as it knows it.

    Args:
        node_name: unless it is remapped.
        options: as `rclpy.node.Node` takes them.

    Raises:
        ConfigError: parameters with which it cannot start.
    """

    def __init__(self, node_name: str = 'sgp_node', **options: Any) -> None:
        super().__init__(node_name, **options)
        self._identification: Identification | None = None
        try:
            self._source = RobotSource(self)
            if self._source.robot:
                self._begin(self._source.robot)
            else:
                self._source.listen(self._begin)
        except BaseException:
            super().destroy_node()
            raise

    def destroy_node(self) -> None:
        """Complete the record and end the processes, then leave the graph."""
        if self._identification is not None:
            self._identification.close()
            self._identification = None
        super().destroy_node()

    def _begin(self, robot: str) -> None:
        self._identification = Identification(self, robot)
        settle_memory()
        self._identification.listen()


class SgpLifecycleNode(LifecycleNode):  # type: ignore[misc]  # rclpy is untyped
    """Identifies a robot while it is active.

    `configure` builds the model and offers services, `activate` takes messages, `deactivate` takes
    none and keeps what was learned, `cleanup` forgets it and completes the record; learned
    hyper-parameters stay, as parameters of the node. A robot from the topic robot_description must
    have been heard before `configure`, which fails without.

    Args:
        node_name: unless it is remapped.
        options: as `rclpy.lifecycle.LifecycleNode` takes them.

    Raises:
        ConfigError: parameters with which it cannot start.
    """

    def __init__(self, node_name: str = 'sgp_node', **options: Any) -> None:
        super().__init__(node_name, **options)
        self._identification: Identification | None = None
        try:
            self._source = RobotSource(self)
        except BaseException:
            super().destroy_node()
            raise
        if not self._source.robot:
            self._source.listen()
        # rclpy lets a transition that is impossible now end the executor.
        change_state = self._service_change_state.callback
        self._service_change_state.callback = lambda *call: self._refusing(change_state, *call)

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Build the model."""
        if not self._source.robot:
            self.get_logger().error(
                'no robot description yet; start robot_state_publisher, then configure again'
            )
            return TransitionCallbackReturn.FAILURE
        try:
            self._identification = Identification(self, self._source.robot)
        except (SgpError, ParameterException, OSError) as error:
            self.get_logger().error(' '.join(str(error).split()))
            return TransitionCallbackReturn.FAILURE
        settle_memory()
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Take messages."""
        assert self._identification is not None
        self._identification.listen()
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Take no more messages."""
        assert self._identification is not None
        self._identification.pause()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Complete the record and forget the model."""
        self._end()
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Complete the record."""
        self._end()
        return super().on_shutdown(state)

    def destroy_node(self) -> None:
        """Complete the record and end the processes, then leave the graph."""
        self._end()
        super().destroy_node()

    def _end(self) -> None:
        if self._identification is not None:
            self._identification.close()
            self._identification = None

    def _refusing(
        self, change_state: Any, request: ChangeState.Request, response: ChangeState.Response
    ) -> ChangeState.Response:
        try:
            return change_state(request, response)
        except rclpy_implementation.RCLError as error:
            self.get_logger().warning(f'transition refused: {" ".join(str(error).split())}')
            response.success = False
            return response
