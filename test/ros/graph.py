"""Real nodes in processes of their own, and a client that watches them over DDS."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

DEADLINE_S = 300.0
"""Only ends a test that hangs: on a computer that is busy, a node may take a minute to start."""
_TURN_S = 0.02


@contextlib.contextmanager
def spinning(context: rclpy.Context | None = None) -> Iterator[SingleThreadedExecutor]:
    """Yield an executor that serves nodes in a thread of this process.

    The thread ends before the executor does: rclpy fails on callbacks that end after it.
    """
    executor, done = SingleThreadedExecutor(context=context), threading.Event()

    def spin() -> None:
        while not done.is_set():
            executor.spin_once(timeout_sec=_TURN_S)

    thread = threading.Thread(target=spin, daemon=True)
    thread.start()
    try:
        yield executor
    finally:
        done.set()
        thread.join()
        executor.shutdown()


class NodeProcess:
    """A node that runs in a process group of its own."""

    def __init__(self, module: str, arguments: list[str], errors: Path) -> None:
        self.errors = errors
        with errors.open('wb') as file:
            self.process = subprocess.Popen(
                [sys.executable, '-m', f'sgp_ros.ros.{module}', *arguments],
                stdout=subprocess.DEVNULL,
                stderr=file,
                start_new_session=True,
            )

    @property
    def is_running(self) -> bool:
        return self.process.poll() is None

    @property
    def stderr(self) -> str:
        return self.errors.read_text()

    def children(self, containing: str = '') -> list[int]:
        """Return the child processes whose command line contains a text."""
        path = Path(f'/proc/{self.process.pid}/task/{self.process.pid}/children')
        found = [int(pid) for pid in path.read_text().split()] if path.exists() else []
        return [pid for pid in found if containing in command_line(pid)]

    def stop(self, number: int = signal.SIGINT, *, whole_group: bool = False) -> int:
        """Send a signal and return the exit status."""
        send = os.killpg if whole_group else os.kill
        started = time.monotonic()
        send(self.process.pid, number)
        status = self.process.wait(timeout=DEADLINE_S)
        print(f'ended {time.monotonic() - started:.2f} s after {signal.Signals(number).name}')
        return status

    def wait(self) -> int:
        """Return the exit status of a node that ends by itself."""
        return self.process.wait(timeout=DEADLINE_S)


class Graph:
    """A client of the nodes under test, and the processes it started."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.client = rclpy.create_node('client')
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.client)
        self._processes: list[NodeProcess] = []
        self._statuses: dict[str, dict[str, str]] = {}
        self._messages: dict[str, str] = {}
        self._reports = self._hear_reports()

    def start(
        self,
        module: str,
        *,
        file: Path | None = None,
        namespace: str = '',
        remaps: Mapping[str, str] | None = None,
        **settings: Any,
    ) -> NodeProcess:
        """Start a node; `__` in the name of a setting stands for a dot."""
        arguments = ['--ros-args', '-r', f'__ns:=/{namespace}']
        for name, topic in (remaps or {}).items():
            arguments += ['-r', f'{name}:={topic}']
        if file is not None:
            arguments += ['--params-file', str(file)]
        for name, value in settings.items():
            text = str(value).lower() if isinstance(value, bool) else str(value)
            arguments += ['-p', f'{name.replace("__", ".")}:={text}']
        errors = self.folder / f'stderr{len(self._processes)}.txt'
        self._processes.append(NodeProcess(module, arguments, errors))
        return self._processes[-1]

    def wait_until(
        self, condition: Callable[[], Any], what: str, deadline_s: float = DEADLINE_S
    ) -> Any:
        """Let messages pass until `condition` holds, and return what it returned."""
        end = time.monotonic() + deadline_s
        while time.monotonic() < end:
            found = condition()
            if found:
                return found
            self.turn()
        errors = ' | '.join(process.stderr[-2000:] for process in self._processes)
        message = f'waited {deadline_s} s for {what}; statuses {self._statuses}; stderr: {errors}'
        raise AssertionError(message)

    def turn(self, timeout_s: float = _TURN_S) -> None:
        """Let a message pass."""
        self._executor.spin_once(timeout_sec=timeout_s)

    def collect(self, kind: type, topic: str, quality: QoSProfile | int = 1000) -> list[Any]:
        """Return a list that grows with the messages of a topic."""
        found: list[Any] = []
        self.client.create_subscription(kind, topic, found.append, quality)
        return found

    def call(self, kind: type, name: str, request: Any = None) -> Any:
        """Call a service."""
        client = self.client.create_client(kind, name)
        self.wait_until(client.service_is_ready, f'service {name}')
        future = client.call_async(kind.Request() if request is None else request)
        self.wait_until(future.done, f'an answer of {name}')
        self.client.destroy_client(client)
        return future.result()

    def parameters(self, node: str = 'sgp_node') -> AsyncParameterClient:
        """Return a client of the parameters of a node."""
        client = AsyncParameterClient(self.client, node)
        self.wait_until(client.services_are_ready, f'parameters of {node}')
        return client

    def answer(self, future: Any) -> Any:
        """Return the result of a call."""
        self.wait_until(future.done, 'an answer')
        return future.result()

    def status(self, name: str, node: str = 'sgp_node') -> dict[str, str]:
        """Return the values of the last status with this name, empty before the first."""
        return self._statuses.get(f'{node}: {name}', {})

    def message(self, name: str, node: str = 'sgp_node') -> str:
        """Return the sentence of the last status with this name."""
        return self._messages.get(f'{node}: {name}', '')

    def count(self, key: str, status: str = 'samples', node: str = 'sgp_node') -> int:
        """Return a number of a status, 0 before the first."""
        return int(self.status(status, node).get(key, '0'))

    def forget(self) -> None:
        """Forget all statuses of a node that is gone, those still on their way too."""
        self.client.destroy_subscription(self._reports)
        self._reports = self._hear_reports()
        self._statuses.clear()
        self._messages.clear()

    def close(self) -> None:
        """Kill what still runs and leave the graph."""
        for process in self._processes:
            if process.is_running:
                os.killpg(process.process.pid, signal.SIGKILL)
                process.process.wait()
        self._executor.shutdown()
        self.client.destroy_node()

    def _hear_reports(self) -> Subscription:
        return self.client.create_subscription(DiagnosticArray, '/diagnostics', self._note, 10)

    def _note(self, array: DiagnosticArray) -> None:
        for status in array.status:
            self._statuses[status.name] = {entry.key: entry.value for entry in status.values}
            self._messages[status.name] = status.message


def command_line(pid: int) -> str:
    """Return the command line of a process, empty once it is gone."""
    try:
        return Path(f'/proc/{pid}/cmdline').read_bytes().replace(b'\0', b' ').decode()
    except OSError:
        return ''
