"""Running of one node until it is told to stop.

The exit status is 0 after SIGINT or SIGTERM, and 2 with one line on stderr when the node cannot
start. Bit-for-bit equality of a run and its replay needs one thread in the linear algebra, which
is chosen by environment variables before NumPy is imported; so nodes are imported here, late.
"""

from __future__ import annotations

import argparse
import gc
import os
import signal
import sys
from collections.abc import Callable

from rclpy.executors import Executor
from rclpy.node import Node

from sgp_ros.errors import SgpError
from sgp_ros.robots.shipped import shipped_folder
from sgp_ros.strangers import read_text

BRINGUP = 'bringup/ros2_control.yaml'
THREAD_LIMITS = ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'MKL_NUM_THREADS')
"""Environment variables that hold the number of threads of a linear algebra library."""

_TURN_S = 0.2
_SIGNALS = (signal.SIGINT, signal.SIGTERM)


def run(name: str, summary: str, load: Callable[[], Callable[[], Node]]) -> int:
    """Run a node in this process and return the exit status.

    Args:
        name: of the executable.
        summary: one sentence, for `--help`.
        load: imports what makes the node and returns it; called once the threads are limited.
    """
    _answer(name, summary)
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


def settle_memory() -> None:
    """Exempt what exists from the search for garbage, which would hold up messages for 50 ms.

    What was exempted before and is garbage by now, such as a node that ended, is collected.
    """
    gc.unfreeze()
    gc.collect()
    gc.freeze()


def _answer(name: str, summary: str) -> None:
    """End with what is asked for without a node; what follows --ros-args is for ROS."""
    own = sys.argv[1:]
    if '--ros-args' in own:
        own = own[: own.index('--ros-args')]
    parser = argparse.ArgumentParser(
        prog=name,
        usage='%(prog)s [-h] [--ros-args [-p NAME:=VALUE] [--params-file YAML] [-r FROM:=TO] ...]',
        description=summary,
        epilog=f'`ros2 param describe` explains the parameters of a running {name}.',
        allow_abbrev=False,
    )
    if name.startswith('sgp_'):
        parser.usage = str(parser.usage).replace('[-h]', '[-h] [--parameters]')
        parser.add_argument('--parameters', action='store_true',
                            help='print the parameter file for a robot of ros2_control, and exit'
                            )  # fmt: skip
    if getattr(parser.parse_known_args(own)[0], 'parameters', False):
        sys.stdout.write(read_text(shipped_folder() / BRINGUP))
        sys.exit(0)


def _start(load: Callable[[], Callable[[], Node]]) -> int:
    import rclpy
    from rclpy.exceptions import ParameterException
    from rclpy.signals import SignalHandlerOptions

    make = load()
    from sgp_ros.ros.robot_source import refuse_foreign_files

    try:
        # The handlers of rclpy would end the context under a callback that is publishing.
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        node = make()
        refuse_foreign_files(node.get_fully_qualified_name(), sys.argv)
    except (SgpError, ParameterException, OSError, RuntimeError) as error:
        print(' '.join(str(error).split()), file=sys.stderr)
        rclpy.try_shutdown()
        return 2
    _spin(node)
    return 0


def _spin(node: Node) -> None:
    """Serve callbacks until a signal comes, then let the node finish."""
    import rclpy
    from rclpy.task import Future

    is_told_to_stop = False

    def stop(_number: int, _frame: object) -> None:
        nonlocal is_told_to_stop
        is_told_to_stop = True

    for number in _SIGNALS:
        signal.signal(number, stop)
    executor = _executor()
    executor.add_node(node)
    settle_memory()
    never: Future[None] = Future()
    try:
        while rclpy.ok() and not is_told_to_stop:
            # A finite time: without one the wheels' EventsExecutor never wakes up.
            executor.spin_until_future_complete(never, timeout_sec=_TURN_S)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def _executor() -> Executor:
    """Return the cheaper executor where this rclpy has it."""
    try:
        from rclpy.experimental import EventsExecutor
    except ImportError:
        from rclpy.executors import SingleThreadedExecutor

        return SingleThreadedExecutor()
    return EventsExecutor()
