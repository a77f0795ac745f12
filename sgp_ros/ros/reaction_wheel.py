"""Executable `reaction_wheel`: a simulated reaction wheel on the ROS graph."""

from __future__ import annotations

import sys
from collections.abc import Callable

from rclpy.node import Node

from sgp_ros.ros.node_main import run


def main() -> None:
    """Run the node until SIGINT or SIGTERM."""
    summary = 'Simulate a reaction wheel that publishes joint_states and command.'
    sys.exit(run('reaction_wheel', summary, _load))


def _load() -> Callable[[], Node]:
    from sgp_ros.ros.simulated_robot import SimulatedRobotNode

    return SimulatedRobotNode


if __name__ == '__main__':
    main()
