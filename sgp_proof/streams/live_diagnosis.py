"""A diagnosis on a node at 500 messages a second, seven joints: its time, and what messages wait.

    python -m sgp_proof.streams.live_diagnosis

The node remembers the last minute of an arm that has dry friction its robot file lacks, is asked
for a diagnosis, and goes on to be sent messages until the verdict. Callbacks and latencies are
compared with those of the time before. The verdict should come within twice the time that was
recorded. Stamps are those at which messages were due, as in `soak`: what the node counts as lost
is compared with what it did not read.
"""

from __future__ import annotations

import json
import os
import tempfile
import time
from pathlib import Path

import numpy as np
import rclpy
from std_srvs.srv import Trigger

from sgp_proof.concealed.machines import draw_machine
from sgp_proof.concealed.robots import urdf
from sgp_proof.result_files import ROOT, make_parser, write_result
from sgp_proof.streams.live_rate import BUDGET, TIMED, Listener, Machine
from sgp_proof.streams.soak import PAUSE_S, _counts, _publish, _quiet, _samples
from sgp_ros.apps.live_processes import LiveProcesses, graph_environment
from sgp_ros.recordings.model_files import load_parameters
from sgp_ros.rigid.rigid_body import inverse_dynamics
from sgp_ros.rigid.tree import read_urdf

RATE_HZ, WARM_UP_S, BLOCK_S = 500.0, 20.0, 2.0
_START_LIMIT_S = 60.0
JOINTS, FRICTION = 7, (1, 3.0)
"""Of the arm, and which joint has dry friction of how many newton metres."""


class Arm(Machine):
    """A drawn arm that moves as the machine of `live_rate`, with the efforts that takes.

    Args:
        path: where its robot file is written.
    """

    def __init__(self, path):
        super().__init__()
        seed, family, bodies = 0, '', ()
        while len(bodies) != JOINTS or family != 'arm':
            family, bodies = draw_machine(np.random.default_rng(seed))
            seed += 1
        path.write_text(urdf(family, bodies), encoding='utf-8')
        self._tree = read_urdf(path.read_text(encoding='utf-8'))
        self._message.name = list(self._tree.joint_names)

    def signals(self, t):
        """As that of `Machine`."""
        q, v, _ = super().signals(t)
        angle = self._rate * t[:, None, None] + self._start
        a = -0.3 * (np.sin(angle) * self._rate**2).sum(axis=2)
        effort = inverse_dynamics(self._tree, self._tree.parameters, q, v, a)
        joint, level = FRICTION
        effort[:, joint] += level * np.tanh(v[:, joint] / 1e-3)
        return q, v, effort + 0.005 * self._rng.standard_normal(q.shape)


class Stream:
    """Messages in blocks, one after the other in time.

    Args:
        listener: sends them.
        machine: makes them.
    """

    def __init__(self, listener, machine):
        self._listener, self._machine = listener, machine
        self._began_ns, self.sent, self.pause_s = time.time_ns(), 0, 0.0

    def send(self, seconds):
        """Send so much in real time; return callbacks [ms] and latencies [s] meanwhile."""
        self._listener.callbacks.clear()
        self._listener.latencies_s.clear()
        samples = _samples(self._machine, self.sent / RATE_HZ, seconds)
        pause_s = _publish(self._listener, self._machine, samples, self._began_ns, self.sent)
        self.sent, self.pause_s = self.sent + len(samples), max(self.pause_s, pause_s)
        return [*self._listener.callbacks], [*self._listener.latencies_s]


def _summary(parts):
    callbacks = np.array([row for part in parts for row in part[0]])
    latencies = 1e3 * np.array([x for part in parts for x in part[1]])
    return {
        'callback_ms': {
            'p50': float(np.median(callbacks[:, 0])), 'p99': float(np.median(callbacks[:, 1])),
            'max': float(callbacks[:, 2].max()),
        },
        'latency_ms': dict(zip(('p50', 'p99'), np.percentile(latencies, (50, 99)), strict=True)),
    }  # fmt: skip


def _run(window_s, limit_s, graph, folder):
    processes, robot = LiveProcesses(graph), folder / 'arm.urdf'
    arm = Arm(robot)
    listener = Listener(rclpy.Context(), int(graph['ROS_DOMAIN_ID']))
    try:
        name = processes.start('sgp_ros.ros.sgp_node', {
            **load_parameters(ROOT / 'config' / 'panda.yaml'), 'robot': str(robot),
            'command.type': 'none', 'buffer.budget': BUDGET, 'filter.window': 0.1,
            'refit.enabled': False, 'qos.depth': 1000, 'diagnosis.window': window_s,
        })  # fmt: skip
        processes.wait_for(
            name, listener.publisher.get_subscription_count, _START_LIMIT_S, 'to listen'
        )
        client = listener.client(Trigger, '/sgp_node/diagnose')
        processes.wait_for(name, client.service_is_ready, _START_LIMIT_S, 'to offer diagnoses')
        stream = Stream(listener, arm)
        stream.send(WARM_UP_S)
        before = [stream.send(BLOCK_S) for _ in range(round(window_s / BLOCK_S))]
        asked, future = time.monotonic(), client.call_async(Trigger.Request())
        during, verdict = [], {}
        while time.monotonic() < asked + limit_s and verdict.get('state') in {None, 'running'}:
            during.append(stream.send(BLOCK_S))
            processes.check()
            verdict = listener.last.get('diagnosis', {})
        took_s = time.monotonic() - asked
        answer = future.result()
        _quiet(listener, PAUSE_S)
        counts = _counts(listener)
    finally:
        processes.stop()
        listener.close()
    return {
        'window_s': window_s, 'answer': None if answer is None else answer.message,
        'state': verdict.get('state'), 'verdict': verdict.get('verdict'),
        'said': listener.said.get('diagnosis'), 'took_s': took_s,
        'resolution_s': BLOCK_S, 'sent': stream.sent, **counts,
        'lost': stream.sent - counts['messages'],
        'publisher_pause_s': stream.pause_s, 'load': os.getloadavg()[0],
        'before': _summary(before), 'during': _summary(during),
    }  # fmt: skip


def main():
    """Run the node and write the result."""
    parser = make_parser(__doc__, 'live_diagnosis')
    parser.add_argument('--window', type=float, default=60.0, help='of the diagnosis [s]')
    parser.add_argument('--limit', type=float, default=600.0, help='for the verdict [s]')
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as logs, graph_environment(Path(logs)) as graph:
        graph['PYTHONPATH'] = str(ROOT)
        os.environ.update(graph)
        run = _run(arguments.window, arguments.limit, graph, Path(logs))
    print(json.dumps(run))
    write_result(arguments.out, {'timed': TIMED, 'rate_hz': RATE_HZ, 'joints': JOINTS, **run})


if __name__ == '__main__':
    main()
