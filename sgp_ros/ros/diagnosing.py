"""The diagnoses of a node: what it remembers for them, the one that runs, the last verdict."""

from __future__ import annotations

import contextlib
import math
import multiprocessing
import signal
import threading
import time
from collections import deque
from collections.abc import Sequence
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess

from sgp_ros.diagnosis.compare.open_bodies import open_bodies
from sgp_ros.diagnosis.compare.sufficiency import require_motion
from sgp_ros.diagnosis.compare.trajectory import SHORTEST_ROWS
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.samples import CommandSample, Event, JointSample
from sgp_ros.errors import SgpError
from sgp_ros.recordings.messages import Status
from sgp_ros.robots.nominal import nominal_model
from sgp_ros.robots.robot import Robot
from sgp_ros.ros.diagnosis_outcome import (
    CANCELLED,
    DiagnosisDone,
    DiagnosisFailed,
    outcome_statuses,
    with_sentences,
)
from sgp_ros.ros.fit_process import yield_to_others
from sgp_ros.ros.past import Command, State, is_state, packed, samples, unpacked
from sgp_ros.ros.verdict import OK

_PART = 250
_REST_S = 0.001
_CHECKED_AT_ONCE = 2000
"""Up to so many states, the service itself looks whether the robot moved; else the process."""
MOST_EVENTS = 200_000
"""Remembered at most, whatever the window: a minute of states and commands at 1.6 kHz each."""
_LONGEST_NS = 10 * 10**9  # beyond there is a pause, or a stamp is wrong


class DiagnosisProcess:
    """A process that diagnoses one recording; it starts at once.

    Args:
        robot: robot file, name or description.
        config: settings of the intake.
        past: states and commands.

    Attributes:
        share: of the work that is done, 0 to 1.
        began_s: when it started, on a steady clock [s].
    """

    def __init__(self, robot: str, config: EngineConfig, past: Sequence[State | Command]) -> None:
        context = multiprocessing.get_context('spawn')
        self._connection, theirs = context.Pipe()
        self._process: SpawnProcess = context.Process(
            target=_diagnose, args=(theirs,), daemon=True
        )
        self.share, self.began_s = 0.0, time.monotonic()
        # As in `fit_process`: Ctrl-C in a terminal reaches the whole process group.
        resource_tracker.ensure_running()
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        self._process.start()
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        theirs.close()
        given = (self._connection, robot, config, past)
        self._sender = threading.Thread(target=_send, args=given, daemon=True)
        self._sender.start()

    def poll(self) -> DiagnosisDone | DiagnosisFailed | None:
        """Return the outcome once there is one; never waits for it."""
        try:
            while self._connection.poll():
                answer = self._connection.recv()
                if not isinstance(answer, float):
                    assert isinstance(answer, (DiagnosisDone, DiagnosisFailed))
                    return answer
                self.share = answer
        except (EOFError, OSError):
            self._process.join()
            code = self._process.exitcode
            return DiagnosisFailed(f'the process of the diagnosis ended with code {code}')
        return None

    def close(self) -> None:
        """Kill the process."""
        self._process.kill()
        self._process.join()
        self._sender.join()  # it fails at once: nobody reads any more
        self._connection.close()


def _send(
    connection: Connection, robot: str, config: EngineConfig, past: Sequence[State | Command]
) -> None:
    """Send a recording in parts: a whole minute at once would keep messages waiting."""
    with contextlib.suppress(OSError):  # `poll` finds the end of the connection
        connection.send((robot, config, len(past)))
        for start in range(0, len(past), _PART):
            connection.send(packed(past[start : start + _PART]))
            time.sleep(_REST_S)


def _diagnose(connection: Connection) -> None:
    yield_to_others()
    try:
        robot, config, count = connection.recv()
        past: list[State | Command] = []
        while len(past) < count:
            past += unpacked(connection.recv())
        connection.send(_outcome(robot, config, samples(past), connection))
    except (EOFError, OSError):
        return  # the node is gone


def _outcome(
    robot: str, config: EngineConfig, events: Sequence[Event], connection: Connection
) -> DiagnosisDone | DiagnosisFailed:
    from sgp_ros.diagnosis.pipeline import diagnose
    from sgp_ros.robots.registry import load_robot

    try:
        nominal = nominal_model(load_robot(robot))
        require_motion(events, nominal.robot.name, nominal.tree.moving_names)
        found = diagnose(
            events, nominal.robot, nominal.tree, {}, stated=nominal.stated, config=config,
            progress=lambda share: connection.send(float(share)),
        )  # fmt: skip
        return with_sentences(found)
    except SgpError as error:
        return DiagnosisFailed(' '.join(str(error).split()))


class Diagnosing:
    """Remembers the recent past of a robot and has it diagnosed elsewhere.

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
        self._ended_s = 0.0

    def take(self, event: Event) -> None:
        """Remember a state or command, forget what is older than the window."""
        t, passed_ns = event.stamp_ns, 0
        if self._past:  # a clock that is set back, or a wrong stamp, costs nothing of the past
            last = self._past[-1]
            passed_ns = last[-1] + min(max(t - last[0], 0), _LONGEST_NS)
        if isinstance(x := event, JointSample):
            self._past.append((t, x.names, x.position, x.velocity, x.effort, passed_ns))
        elif isinstance(x, CommandSample):
            self._past.append((t, x.effort, x.names, x.kind, x.velocity, passed_ns))
        else:
            return
        while passed_ns - self._past[0][-1] > self._window_ns:
            self._past.popleft()

    @property
    def events(self) -> tuple[JointSample | CommandSample, ...]:
        """States and commands of the window, in the order in which they came."""
        return samples(self._past)

    def start(self, config: EngineConfig) -> tuple[bool, str]:
        """Start a diagnosis of the recent past.

        Args:
            config: settings of the intake.

        Returns:
            Whether it was started, and one sentence.
        """
        states = sum(map(is_state, self._past))
        if self._process is not None:
            return False, 'a diagnosis is already running; its outcome will be on /diagnostics'
        try:
            nominal = nominal_model(self._robot)
            open_bodies(self._robot.name, nominal.tree)  # refuses one that cannot move
            if states < SHORTEST_ROWS:
                return False, f'too few states: {states}, at least {SHORTEST_ROWS} are needed'
            if states <= _CHECKED_AT_ONCE:
                require_motion(self.events, self._robot.name, nominal.tree.moving_names)
        except SgpError as error:
            return False, ' '.join(str(error).split())
        self._process = DiagnosisProcess(self._path, config, tuple(self._past))
        return True, f'started on {states} states'

    def cancel(self) -> tuple[bool, str]:
        """End a diagnosis that runs; return whether one did, and one sentence."""
        if self._process is None:
            return False, 'no diagnosis is running'
        self.close()
        self._outcome = DiagnosisFailed(CANCELLED)
        return True, 'the diagnosis was cancelled'

    def poll(self) -> DiagnosisDone | DiagnosisFailed | None:
        """Return the outcome of a diagnosis that has just ended."""
        outcome = None if self._process is None else self._process.poll()
        if outcome is not None:
            self.close()
            self._outcome, self._ended_s = outcome, time.monotonic()
        return outcome

    def statuses(self, node: str) -> list[Status]:
        """Return the last verdict with a status for each finding; empty before the first call."""
        name, robot = f'{node}: diagnosis', self._robot.name
        if self._process is not None:
            share, passed_s = self._process.share, time.monotonic() - self._process.began_s
            left_s = passed_s * (1.0 - share) / share if share > 0.0 else math.nan
            left = f', {left_s:.0f} s left' if share > 0.0 else ''
            values = {
                'state': 'running', 'share': f'{share:.3f}', 'passed_s': f'{passed_s:.1f}',
                'left_s': f'{left_s:.1f}',
            }  # fmt: skip
            return [Status(name, OK, f'{100 * share:.0f} % diagnosed{left}', robot, values)]
        if self._outcome is None:
            return []
        is_fresh = 1e9 * (time.monotonic() - self._ended_s) <= self._window_ns
        return outcome_statuses(self._outcome, name, robot, is_fresh=is_fresh)

    def close(self) -> None:
        """Kill a diagnosis that runs."""
        if self._process is not None:
            self._process.close()
        self._process = None
