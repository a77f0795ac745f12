"""Runs one diagnosis in another process, so that no message waits for it.

The process starts when a diagnosis is asked for and ends with it. It is killed when the node ends.
This module imports nothing of ROS: the process loads it.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Mapping
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Any

from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.samples import Event
from sgp_ros.errors import SgpError

_NICENESS = 10


@dataclass(frozen=True, slots=True)
class DiagnosisRequest:
    """What a diagnosis works on.

    Attributes:
        robot: robot YAML or URDF.
        events: states and commands.
        config: settings of the intake.
    """

    robot: str
    events: tuple[Event, ...]
    config: EngineConfig


@dataclass(frozen=True, slots=True)
class DiagnosisDone:
    """A finished diagnosis.

    Attributes:
        content: of diagnosis.json.
    """

    content: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class DiagnosisFailed:
    """A diagnosis without a result.

    Attributes:
        reason: one sentence.
    """

    reason: str


class DiagnosisProcess:
    """A process that diagnoses one recording; it starts at once.

    Args:
        request: robot and recording.
    """

    def __init__(self, request: DiagnosisRequest) -> None:
        context = multiprocessing.get_context('spawn')
        self._connection, theirs = context.Pipe()
        self._process: SpawnProcess = context.Process(
            target=_diagnose, args=(theirs,), daemon=True
        )
        self._request: DiagnosisRequest | None = request
        # As in `fit_process`: Ctrl-C in a terminal reaches the whole process group.
        resource_tracker.ensure_running()
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        self._process.start()
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        theirs.close()

    def poll(self) -> DiagnosisDone | DiagnosisFailed | None:
        """Return the outcome once there is one; never waits for it."""
        try:
            if not self._connection.poll():
                return None
            answer = self._connection.recv()
            if self._request is not None:  # the process listens now
                request, self._request = self._request, None
                self._connection.send(request)
                return None
        except (EOFError, OSError):
            self._process.join()
            code = self._process.exitcode
            return DiagnosisFailed(f'the process of the diagnosis ended with code {code}')
        assert isinstance(answer, (DiagnosisDone, DiagnosisFailed))
        return answer

    def close(self) -> None:
        """Kill the process."""
        self._process.kill()
        self._process.join()
        self._connection.close()


def _diagnose(connection: Connection) -> None:
    os.nice(_NICENESS)
    try:
        connection.send(None)
        connection.send(_outcome(connection.recv()))
    except (EOFError, OSError):
        return  # the node is gone


def _outcome(request: DiagnosisRequest) -> DiagnosisDone | DiagnosisFailed:
    from sgp_ros.diagnosis.mapping import diagnosis_mapping
    from sgp_ros.diagnosis.pipeline import diagnose
    from sgp_ros.robots.nominal import nominal_model
    from sgp_ros.robots.registry import load_robot

    try:
        nominal = nominal_model(load_robot(request.robot))
        found = diagnose(
            request.events, nominal.robot, nominal.tree, {}, stated=nominal.stated,
            config=request.config,
        )  # fmt: skip
        return DiagnosisDone(diagnosis_mapping(found))
    except SgpError as error:
        return DiagnosisFailed(' '.join(str(error).split()))
