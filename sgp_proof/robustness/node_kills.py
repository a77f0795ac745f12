"""A node that is killed while it records, and what is left of its record.

This process publishes a simulated reaction wheel in real time and hears what the node predicts.
What it heard before the node was dead, the node had acknowledged: all of that must be in the
record, but for what was made less than a second before a SIGKILL.
"""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import rclpy
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from sgp_proof.result_files import ROOT
from sgp_ros.apps.live_processes import graph_environment
from sgp_ros.engine.samples import JointSample
from sgp_ros.recordings.reader import open_recording
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.recording import simulate

RATE_HZ, LONGEST_S, START_S = 100.0, 6.0, 60.0
MOST_LOST_S = 1.0
_PREDICTION = '/sgp_node/prediction'


class NodeKills:
    """Kills of nodes, one after the other, on one graph.

    Args:
        folder: where they record.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder / 'node'
        self._folder.mkdir()
        self._stack = contextlib.ExitStack()
        self._graph = self._stack.enter_context(graph_environment(self._folder))
        self._graph['PYTHONPATH'] = str(ROOT)
        os.environ.update(self._graph)
        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=int(self._graph['ROS_DOMAIN_ID']))
        self._node = rclpy.create_node('player', context=self._context)
        self._executor = rclpy.executors.SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._states = self._node.create_publisher(JointState, 'joint_states', 100)
        self._commands = self._node.create_publisher(JointState, 'command', 100)
        self._heard: list[int] = []
        self._node.create_subscription(JointTrajectory, _PREDICTION, self._hear, 1000)
        world = make_simulation('reaction_wheel', seed=1, rate_hz=RATE_HZ)
        self._run = simulate(world, START_S + LONGEST_S)

    def kill(self, rng: np.random.Generator, number: signal.Signals) -> dict[str, object]:
        """Kill a node that records; return what came of it, with `faults`."""
        known, faults = set(self._folder.glob('run*.mcap')), []
        self._heard.clear()
        errors = self._folder / 'stderr.txt'
        process = self._start(errors)
        try:
            self._publish(process, rng.uniform(0.0, LONGEST_S))
            process.send_signal(number)
            status = process.wait(timeout=10.0)
            self._drain(0.3)
        except subprocess.TimeoutExpired:
            faults.append('lives 10 s after the signal')
            status = None
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        if status is not None and status not in ((-9,) if number == signal.SIGKILL else (0,)):
            faults.append(f'status {status}')
        if 'Traceback' in errors.read_text(encoding='utf-8', errors='replace'):
            faults.append('a traceback')
        records = set(self._folder.glob('run*.mcap')) - known
        if len(records) != 1:
            return {'what': 'node', 'status': status, 'faults': [*faults, 'no record']}
        found = self._compare(records.pop(), is_killed=number == signal.SIGKILL)
        return {'what': 'node', 'status': status, **found, 'faults': faults + found['faults']}

    def _compare(self, record: Path, *, is_killed: bool) -> dict[str, object]:
        """Hold what was heard against the record."""
        faults = []
        recording = open_recording(record)
        states = sum(isinstance(event, JointSample) for event in recording.events())
        has_predictions = any(topic.name == _PREDICTION for topic in recording.topics)
        stamps = {
            message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
            for _, message in (recording.messages(_PREDICTION) if has_predictions else ())
        }
        newest = max(stamps, default=min(self._heard))  # none yet, where none was flushed
        missing = [stamp for stamp in self._heard if stamp not in stamps]
        lost_s = max(0.0, 1e-9 * (max(self._heard) - newest))
        if any(stamp < newest for stamp in missing):
            faults.append('a hole in the record')
        if lost_s > (MOST_LOST_S if is_killed else 0.0):
            faults.append(f'{lost_s:.2f} s of the record lost')
        if not is_killed and recording.remarks:
            faults.append('a record that is not complete')
        return {'acknowledged': len(self._heard), 'missing': len(missing), 'lost_s': lost_s,
                'states': states, 'faults': faults}  # fmt: skip

    def _start(self, errors: Path) -> subprocess.Popen[bytes]:
        settings = {
            'robot': 'reaction_wheel', 'command.type': 'sensor_msgs/JointState',
            'record.path': str(self._folder / 'run.mcap'), 'buffer.budget': 100,
            'learning.initial': 20, 'refit.enabled': False,
        }  # fmt: skip
        arguments = [part for item in settings.items() for part in ('-p', '{}:={}'.format(*item))]
        with errors.open('wb') as file:
            return subprocess.Popen(
                [sys.executable, '-m', 'sgp_ros.ros.sgp_node', '--ros-args', *arguments],
                env=self._graph, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=file,
                start_new_session=True,
            )  # fmt: skip

    def _publish(self, process: subprocess.Popen[bytes], seconds: float) -> None:
        """Publish in real time until so long [s] after the first prediction."""
        limit, start_ns, end = time.monotonic() + START_S, 0, None
        for i, position in enumerate(self._run.position):
            now = time.monotonic()
            start_ns = start_ns or time.time_ns()
            if end is None and self._heard:
                end = now + seconds
            if now > (limit if end is None else end):
                break
            if process.poll() is not None:
                raise SystemExit(f'the node ended with {process.returncode}')
            stamp_ns = start_ns + round(i * 1e9 / RATE_HZ)
            self._send(stamp_ns, position, self._run.command[i])
            while time.time_ns() < stamp_ns + round(1e9 / RATE_HZ):
                self._executor.spin_once(timeout_sec=0.001)
        if not self._heard:
            raise SystemExit(f'no prediction within {START_S} s')

    def _send(self, stamp_ns: int, position: np.ndarray, command: np.ndarray) -> None:
        state = JointState(name=list(self._run.joint_names), position=position.tolist())
        asked = JointState(name=['wheel'], effort=command.tolist())
        for message in (asked, state):
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
        self._commands.publish(asked)
        self._states.publish(state)

    def _drain(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self._executor.spin_once(timeout_sec=0.01)

    def _hear(self, message: JointTrajectory) -> None:
        stamp = message.header.stamp
        self._heard.append(stamp.sec * 10**9 + stamp.nanosec)

    def close(self) -> None:
        """Leave the graph."""
        self._node.destroy_node()
        self._context.try_shutdown()
        self._stack.close()
