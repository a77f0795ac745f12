"""The diagnoses of a node: what it remembers for them, the one that runs, the last verdict."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Any

import numpy as np

from sgp_ros.diagnosis.compare.open_bodies import open_bodies
from sgp_ros.diagnosis.compare.sufficiency import require_motion
from sgp_ros.diagnosis.compare.trajectory import SHORTEST_ROWS
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.samples import CommandSample, Event, JointSample
from sgp_ros.errors import SgpError
from sgp_ros.recordings.messages import Status
from sgp_ros.robots.nominal import nominal_model
from sgp_ros.robots.robot import Robot
from sgp_ros.ros.verdict import ERROR, OK, WARN

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


Names = tuple[str, ...]
State = tuple[int, Names, np.ndarray, np.ndarray | None, np.ndarray | None]
Command = tuple[int, np.ndarray, Names | None]

MOST_EVENTS = 200_000
"""Remembered at most, whatever the window: a minute of states and commands at 1.6 kHz each."""
_STATE_FIELDS = 5


class Diagnosing:
    """Remembers the recent past of a robot and has it diagnosed elsewhere.

    What is remembered are the fields of the samples, in plain tuples. The garbage collector lets
    go of those; so many objects it would search for fifty milliseconds while messages wait.

    Args:
        robot: what the node identifies.
        path: the robot YAML or URDF it was read from.
        window_s: how much of the past is kept [s].
    """

    def __init__(self, robot: Robot, path: str, window_s: float) -> None:
        self._robot = robot
        self._path = path
        self._window_ns = round(window_s * 1e9)
        self._past: deque[State | Command] = deque(maxlen=MOST_EVENTS)
        self._process: DiagnosisProcess | None = None
        self._outcome: DiagnosisDone | DiagnosisFailed | None = None

    def take(self, event: Event) -> None:
        """Remember a state or command, forget what is older than the window."""
        stamp_ns = event.stamp_ns
        if isinstance(event, JointSample):
            state = (stamp_ns, event.names, event.position, event.velocity, event.effort)
            self._past.append(state)
        elif isinstance(event, CommandSample):
            self._past.append((stamp_ns, event.effort, event.names))
        else:
            return
        while stamp_ns - self._past[0][0] > self._window_ns:
            self._past.popleft()

    @property
    def events(self) -> tuple[JointSample | CommandSample, ...]:
        """States and commands of the window, in the order in which they came."""
        return tuple(
            JointSample(*past) if len(past) == _STATE_FIELDS else CommandSample(*past)
            for past in self._past
        )

    def start(self, config: EngineConfig) -> tuple[bool, str]:
        """Start a diagnosis of the recent past.

        Args:
            config: settings of the intake.

        Returns:
            Whether it was started, and one sentence.
        """
        states = sum(len(past) == _STATE_FIELDS for past in self._past)
        if self._process is not None:
            return False, 'a diagnosis is already running; /diagnostics tells its outcome'
        try:
            nominal = nominal_model(self._robot)
            open_bodies(self._robot.name, nominal.tree)  # refuses one that cannot move
            if states < SHORTEST_ROWS:
                return False, f'too few states: {states}, at least {SHORTEST_ROWS} are needed'
            events = self.events
            require_motion(events, self._robot.name, nominal.tree.moving_names)
        except SgpError as error:
            return False, ' '.join(str(error).split())
        self._process = DiagnosisProcess(DiagnosisRequest(self._path, events, config))
        return True, f'started on {states} states'

    def poll(self) -> DiagnosisDone | DiagnosisFailed | None:
        """Return the outcome of a diagnosis that has just ended."""
        outcome = None if self._process is None else self._process.poll()
        if outcome is not None:
            self.close()
            self._outcome = outcome
        return outcome

    def statuses(self, node: str) -> list[Status]:
        """Return the last verdict with a status for each finding; empty before the first call."""
        name, robot = f'{node}: diagnosis', self._robot.name
        if self._process is not None:
            return [Status(name, OK, 'a diagnosis is running', robot, {'state': 'running'})]
        if isinstance(self._outcome, DiagnosisFailed):
            return [Status(name, ERROR, self._outcome.reason, robot, {'state': 'failed'})]
        if self._outcome is None:
            return []
        content = self._outcome.content
        verdict, findings = str(content['verdict']), content['findings']
        values = {
            'state': 'done', 'verdict': verdict, 'certainty': str(content['certainty']),
            'findings': str(len(findings)),
        }  # fmt: skip
        level = WARN if findings else OK
        return [
            Status(name, level, verdict, robot, values),
            *(_status(f'{name} {i + 1}', robot, finding) for i, finding in enumerate(findings)),
        ]

    def close(self) -> None:
        """Kill a diagnosis that runs."""
        if self._process is not None:
            self._process.close()
        self._process = None


def _status(name: str, robot: str, finding: Mapping[str, Any]) -> Status:
    values = {key: str(finding[key]) for key in ('joint', 'effect', 'probability')}
    for parameter, entry in finding['parameters'].items():
        values[parameter] = str(entry['value'])
        values |= {f'{parameter}.{k}': str(entry[k]) for k in ('std', 'unit') if k in entry}
    return Status(name, WARN, f'{finding["effect"]} of {finding["joint"]}', robot, values)
