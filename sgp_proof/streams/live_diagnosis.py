"""A diagnosis on a node at 500 messages a second, seven joints: its time, and what messages wait.

    python -m sgp_proof.streams.live_diagnosis

The node remembers `WINDOW_S` of the stream of `live_rate`, is asked for a diagnosis, and goes on
to be sent messages until the verdict. Callbacks and latencies are compared with those of the time
before. The verdict should come within twice the time that was recorded.
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

from sgp_proof.result_files import ROOT, make_parser, write_result
from sgp_proof.streams.live_rate import BUDGET, Listener, Machine
from sgp_proof.streams.soak import _publish, _samples
from sgp_ros.apps.live_processes import LiveProcesses, graph_environment
from sgp_ros.recordings.model_files import load_parameters

RATE_HZ, WARM_UP_S, BLOCK_S = 500.0, 20.0, 5.0
_START_LIMIT_S = 60.0


class Stream:
    """Messages in blocks, one after the other in time.

    Args:
        listener: sends them.
    """

    def __init__(self, listener):
        self._listener, self._machine = listener, Machine()
        self._began_ns, self.sent, self.pause_s = time.time_ns(), 0, 0.0

    def send(self, seconds):
        """Send so much in real time; return callbacks [ms] and latencies [s] meanwhile."""
        self._listener.callbacks.clear()
        self._listener.latencies_s.clear()
        samples = _samples(self._machine, self.sent / RATE_HZ, seconds)
        late_ns = time.time_ns() - self._began_ns - round(self.sent * 1e9 / RATE_HZ)
        self._began_ns += max(late_ns, 0)  # making them took its time
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


def _run(window_s, limit_s, graph):
    processes = LiveProcesses(graph)
    listener = Listener(rclpy.Context(), int(graph['ROS_DOMAIN_ID']))
    try:
        name = processes.start('sgp_ros.ros.sgp_node', {
            **load_parameters(ROOT / 'config' / 'panda.yaml'), 'robot': 'panda',
            'command.type': 'none', 'buffer.budget': BUDGET, 'filter.window': 0.1,
            'refit.enabled': False, 'qos.depth': 1000, 'diagnosis.window': window_s,
        })  # fmt: skip
        processes.wait_for(
            name, listener.publisher.get_subscription_count, _START_LIMIT_S, 'to listen'
        )
        client = listener.client(Trigger, '/sgp_node/diagnose')
        processes.wait_for(name, client.service_is_ready, _START_LIMIT_S, 'to offer diagnoses')
        stream = Stream(listener)
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
    finally:
        processes.stop()
        listener.close()
    lost = int(listener.last['samples']['lost'])
    return {
        'window_s': window_s, 'answer': None if answer is None else answer.message,
        'state': verdict.get('state'), 'verdict': verdict.get('verdict'), 'took_s': took_s,
        'resolution_s': BLOCK_S, 'sent': stream.sent, 'counted_lost': lost,
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
        run = _run(arguments.window, arguments.limit, graph)
    print(json.dumps(run))
    write_result(arguments.out, {'rate_hz': RATE_HZ, 'joints': 7, **run})


if __name__ == '__main__':
    main()
