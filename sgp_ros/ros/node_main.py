"""Runs one node until it is told to stop.

The exit status is 0 after SIGINT or SIGTERM, and 2 with one line on stderr when the node cannot
start. Bit-for-bit equality of a run and its replay needs one thread in the linear algebra, which
is chosen by environment variables before NumPy is imported; so nodes are imported here, late.
"""

from __future__ import annotations

import os
import signal
import sys
from typing import TYPE_CHECKING

from sgp_ros.errors import SgpError

if TYPE_CHECKING:
    from collections.abc import Callable

    from rclpy.executors import Executor
    from rclpy.node import Node

THREAD_LIMITS = ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'MKL_NUM_THREADS')
"""Environment variables that hold the number of threads of a linear algebra library."""

_TURN_S = 0.5


def run(load: Callable[[], Callable[[], Node]]) -> int:
    """Run a node in this process and return the exit status.

    Args:
        load: imports what makes the node and returns it; called once the threads are limited.
    """
    os.environ.update(dict.fromkeys(THREAD_LIMITS, '1'))
    try:
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        return _start(load)
    except KeyboardInterrupt:
        return 0
    except ModuleNotFoundError as error:
        remedy = "source a ROS 2 workspace or pip install 'sgp_ros[wheels]'"
        print(f'cannot import {error.name}; {remedy}', file=sys.stderr)
        return 2


def _start(load: Callable[[], Callable[[], Node]]) -> int:
    import rclpy
    from rclpy.exceptions import ParameterException
    from rclpy.executors import ExternalShutdownException
    from rclpy.task import Future

    make, node = load(), None
    try:
        rclpy.init()
        node = make()
        executor = _executor()
        executor.add_node(node)
        never: Future[None] = Future()
        while rclpy.ok():
            # A finite time: without one the wheels' EventsExecutor never wakes up.
            executor.spin_until_future_complete(never, timeout_sec=_TURN_S)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except (SgpError, ParameterException, OSError) as error:
        print(' '.join(str(error).split()), file=sys.stderr)
        return 2
    finally:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0


def _executor() -> Executor:
    """Return the cheaper executor where this rclpy has it."""
    try:
        from rclpy.experimental import EventsExecutor
    except ImportError:
        from rclpy.executors import SingleThreadedExecutor

        return SingleThreadedExecutor()
    return EventsExecutor()
