"""Executable `sgp_lifecycle_node`: identifies a robot online, as a managed node."""

from __future__ import annotations

import sys
from collections.abc import Callable

from rclpy.node import Node

from sgp_ros.ros.node_main import run


def main() -> None:
    """Run the node until SIGINT or SIGTERM."""
    summary = 'Identify a robot online as a managed node: configure, activate, clean up.'
    sys.exit(run('sgp_lifecycle_node', summary, _load))


def _load() -> Callable[[], Node]:
    from sgp_ros.ros.nodes import SgpLifecycleNode

    return SgpLifecycleNode


if __name__ == '__main__':
    main()
