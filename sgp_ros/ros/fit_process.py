"""Fits hyper-parameters in another process, so that no message waits for a fit.

One worker serves one request at a time. It starts when the node does, because its imports take
longer than most fits; it is killed when the node ends, and ends by itself when the node vanishes.
It has a low weight: where another process wants the same core, it gets about a tenth of it, so a
fit takes longer on a busy computer, and still comes. It stands still while the node has a message
in hand, because cores share caches and memory, but only for the first seconds of a fit: a node
that always has one would never get it. This module imports nothing of ROS: the worker loads it.
"""

from __future__ import annotations

import contextlib
import ctypes
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess

from sgp_ros.engine.fitting import FitRequest, FitResult, fit

_NICENESS = 10
"""On Linux a weight of 110, where a process of niceness 0 has 1024."""
_SET_PARENT_DEATH_SIGNAL = 1
MOST_HELD_S = 20.0
"""Age of a request from which its fit is no longer held [s]."""
_READY = 'ready'
_STOP = getattr(signal, 'SIGSTOP', None)


@dataclass(frozen=True, slots=True)
class WorkerLost:
    """The worker died.

    Attributes:
        exit_code: of the process; negative is the number of a signal.
        had_request: whether a fit was lost with it.
    """

    exit_code: int | None
    had_request: bool


class FitProcess:
    """A worker process that fits."""

    def __init__(self) -> None:
        self._process: SpawnProcess | None = None
        self._connection: Connection | None = None
        self._waiting: FitRequest | None = None
        self._sender: threading.Thread | None = None
        self._is_ready = False
        self._asked_s = 0.0
        self.is_free = True
        self._start()

    def submit(self, request: FitRequest) -> None:
        """Hand out a request; only while `is_free`."""
        if not self.is_free:
            msg = 'submit while a fit is running'
            raise ValueError(msg)
        if self._process is None:
            self._start()
        self.is_free = False
        self._asked_s = time.monotonic()
        self._waiting = request
        self._send_waiting()

    def poll(self) -> FitResult | WorkerLost | None:
        """Return what has come from the worker since the last call; never waits."""
        if self._connection is None:
            return None
        try:
            if not self._connection.poll():
                return None
            answer = self._connection.recv()
        except (EOFError, OSError):
            return self._lose()
        if isinstance(answer, FitResult):
            self.is_free = True
            return answer
        self._is_ready = True
        self._send_waiting()
        return None

    @contextlib.contextmanager
    def held(self) -> Iterator[None]:
        """Keep a fit from computing meanwhile (POSIX), up to an age of `MOST_HELD_S`."""
        process = self._process
        is_old = time.monotonic() - self._asked_s > MOST_HELD_S
        if self.is_free or is_old or process is None or process.pid is None or _STOP is None:
            yield
            return
        with contextlib.suppress(ProcessLookupError):
            os.kill(process.pid, _STOP)
        try:
            yield
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.kill(process.pid, signal.SIGCONT)

    def close(self) -> None:
        """Kill the worker at once."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
        if self._sender is not None:
            self._sender.join()  # it fails at once: nobody reads any more
        if self._connection is not None:
            self._connection.close()
        self._process = self._connection = self._sender = None
        self._is_ready = False

    def _start(self) -> None:
        context = multiprocessing.get_context('spawn')
        self._connection, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs,), daemon=True)
        # Ctrl-C in a terminal reaches the whole process group; the worker inherits this mask. The
        # tracker that multiprocessing starts beside it would lift the mask, so it comes first.
        resource_tracker.ensure_running()
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        self._process.start()
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        theirs.close()

    def _send_waiting(self) -> None:
        """Send the request once the worker listens.

        In a thread, because a pipe takes no more than its reader does, and this one reads only
        when it is given the processor.
        """
        if self._is_ready and self._waiting is not None and self._connection is not None:
            request, self._waiting = self._waiting, None
            self._sender = threading.Thread(
                target=_send, args=(self._connection, request), daemon=True
            )
            self._sender.start()

    def _lose(self) -> WorkerLost:
        process, had_request = self._process, not self.is_free
        self.close()
        self._waiting = None
        self.is_free = True
        return WorkerLost(None if process is None else process.exitcode, had_request)


def _send(connection: Connection, request: FitRequest) -> None:
    with contextlib.suppress(OSError):  # `poll` finds the end of the connection
        connection.send(request)


def yield_to_others() -> None:
    """Take a low weight, and never preempt a running process.

    Not `SCHED_IDLE` (Linux): on a computer that is always busy, as that of a robot, no fit would
    ever come. A process of `SCHED_BATCH` gives way to one that wakes up, as the node does for a
    message. Elsewhere, or where a container forbids it, niceness alone.
    """
    os.nice(_NICENESS)
    if hasattr(os, 'SCHED_BATCH'):
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))


def _end_with_parent() -> None:
    """Ask the kernel for the end when the parent dies (Linux), even while this process is held."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_SET_PARENT_DEATH_SIGNAL, signal.SIGKILL)


def _serve(connection: Connection) -> None:
    _end_with_parent()
    yield_to_others()
    try:
        connection.send(_READY)
        while True:
            connection.send(fit(connection.recv()))
    except (EOFError, OSError):
        return  # the node is gone
