"""Executable `sgp_node`: identifies a robot online."""

from __future__ import annotations

import sys
from collections.abc import Callable

from rclpy.node import Node

from sgp_ros.ros.node_main import run


def main() -> None:
    """Run the node until SIGINT or SIGTERM."""
    summary = 'Identify a robot online from joint states and commands; see docs/settings.md.'
    sys.exit(run('sgp_node', summary, _load))


def _load() -> Callable[[], Node]:
    from sgp_ros.ros.nodes import SgpNode

    return SgpNode


if __name__ == '__main__':
    main()
