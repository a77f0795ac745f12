"""The diagnoses of a node: what it remembers for them, the one that runs, the last verdict."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np

from sgp_ros.diagnosis.compare.sufficiency import require_inertia, require_motion
from sgp_ros.diagnosis.compare.trajectory import SHORTEST_ROWS
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.samples import CommandSample, Event, JointSample
from sgp_ros.errors import SgpError
from sgp_ros.recordings.messages import Status
from sgp_ros.robots.nominal import nominal_model
from sgp_ros.robots.robot import Robot
from sgp_ros.ros.diagnosis_process import (
    DiagnosisDone,
    DiagnosisFailed,
    DiagnosisProcess,
    DiagnosisRequest,
)
from sgp_ros.ros.verdict import ERROR, OK, WARN

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
            require_inertia(self._robot.name, nominal.tree)
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
