"""Nodes as child processes on a graph of their own."""

from __future__ import annotations

import contextlib
import ctypes
import fcntl
import importlib.util
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from sgp_ros.errors import RecordingError
from sgp_ros.robots.shipped import find_shipped

_DOMAINS = range(30, 102)
_STOP_LIMIT_S = 5.0
_LAST_LINES = 5
_SET_PARENT_DEATH_SIGNAL = 1


@contextlib.contextmanager
def graph_environment(logs: Path) -> Iterator[dict[str, str]]:
    """Yield an environment with a domain of its own, quick discovery and private logs.

    Raises:
        RecordingError: rclpy is not installed, or every domain is in use.
    """
    if importlib.util.find_spec('rclpy') is None:
        raise RecordingError(
            'rclpy is not installed', 'ROS 2 Jazzy',
            "source a ROS 2 workspace or pip install 'sgp_ros[wheels]'",
        )  # fmt: skip
    with _free_domain() as domain:
        environment = dict(
            os.environ,
            ROS_DOMAIN_ID=str(domain),
            ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST',
            ROS_LOG_DIR=str(logs),
            PYTHONUNBUFFERED='1',
        )
        profile = find_shipped('quick_discovery.xml')
        if profile is not None:
            environment['FASTRTPS_DEFAULT_PROFILES_FILE'] = str(profile)
            environment['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'SUBNET'  # the profile narrows it
        yield environment


@contextlib.contextmanager
def _free_domain() -> Iterator[int]:
    """Yield a domain id that no other run of this package on this machine holds."""
    for domain in _DOMAINS:
        path = Path(tempfile.gettempdir()) / f'sgp_ros_domain_{domain}.lock'
        with path.open('w', encoding='utf-8') as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            try:
                yield domain
            finally:
                path.unlink(missing_ok=True)
            return
    raise RecordingError('every ROS domain of this package is in use', 'a free one', 'wait')


def _die_with_parent() -> None:
    """Ask the kernel to end this child when its parent dies, even by SIGKILL (Linux)."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_SET_PARENT_DEATH_SIGNAL, signal.SIGTERM)


@contextlib.contextmanager
def _interrupted_later() -> Iterator[None]:
    """Hold back interruptions, whose handlers raise, until the end.

    Python runs hooks around a fork, and what a handler raises in these is lost.
    """
    came: list[int] = []
    before = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)}
    is_main = threading.current_thread() is threading.main_thread()  # the one that is interrupted
    held = {n: f for n, f in before.items() if is_main and callable(f)}
    for number in held:
        signal.signal(number, lambda n, _frame: came.append(n))
    try:
        yield
    finally:
        for number, handler in held.items():
            signal.signal(number, handler)
        for first in came[:1]:
            signal.raise_signal(first)


class LiveProcesses:
    """Child processes that never outlive the run.

    Args:
        environment: of every child.
    """

    def __init__(self, environment: Mapping[str, str]) -> None:
        self._environment = dict(environment)
        self._children: dict[str, subprocess.Popen[bytes]] = {}
        self._errors: dict[str, Path] = {}

    def start(self, module: str, parameters: Mapping[str, object]) -> str:
        """Start a node module with ROS parameters; return its name."""
        arguments = [sys.executable, '-m', module, '--ros-args']
        for name, value in parameters.items():
            arguments += ['-p', f'{name}:={value}']
        errors = Path(self._environment['ROS_LOG_DIR']) / f'{module}.stderr'
        self._errors[module] = errors
        with errors.open('wb') as file, _interrupted_later():
            self._children[module] = subprocess.Popen(  # noqa: S603 - our own modules
                arguments, env=self._environment, stdin=subprocess.DEVNULL, stdout=file,
                stderr=subprocess.STDOUT, start_new_session=True,
                preexec_fn=_die_with_parent,  # noqa: PLW1509 - one call, no lock to wait for
            )  # fmt: skip
        return module

    def wait_for(
        self, module: str, is_reached: Callable[[], bool], limit_s: float, what: str
    ) -> None:
        """Wait until a condition holds.

        Raises:
            RecordingError: a child ended, or the limit [s] passed.
        """
        end = time.monotonic() + limit_s
        while not is_reached():
            self.check()
            if time.monotonic() > end:
                raise RecordingError(
                    f'{module} took longer than {limit_s:g} s {what}', '', self._said(module)
                )
            time.sleep(0.05)

    def check(self) -> None:
        """Raise `RecordingError` if a child has ended, with the last that it said."""
        for module, child in self._children.items():
            if child.poll() is not None:
                raise RecordingError(
                    f'{module} ended with status {child.returncode}', 'it to keep running',
                    self._said(module),
                )  # fmt: skip

    def stop(self) -> None:
        """End all children: SIGINT, and SIGKILL for their whole group if that does not help."""
        for child in reversed(self._children.values()):
            if child.poll() is None:
                child.send_signal(signal.SIGINT)
                with contextlib.suppress(subprocess.TimeoutExpired):
                    child.wait(_STOP_LIMIT_S)
            with contextlib.suppress(ProcessLookupError):
                os.killpg(child.pid, signal.SIGKILL)
            child.wait()

    def check_exit(self) -> None:
        """Raise `RecordingError` if a child did not end cleanly after `stop`."""
        for module, child in self._children.items():
            if child.returncode != 0:
                raise RecordingError(
                    f'{module} ended with status {child.returncode}', 'status 0 after SIGINT'
                )

    def _said(self, module: str) -> str:
        text = self._errors[module].read_text(encoding='utf-8', errors='replace')
        lines = [line for line in text.splitlines() if line.strip()]
        return 'it printed: ' + ' / '.join(lines[-_LAST_LINES:]) if lines else 'it printed nothing'
