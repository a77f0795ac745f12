"""A node at 1000 messages a second, seven joints, a buffer of 500: losses, load and latency.

    python -m sgp_proof.streams.live_rate

The node runs in a process of its own over DDS; this one publishes and listens. Latency is counted
from the stamp of a sample to the receipt of its prediction, and once more without the wait for the
order of stamps and for the second half of the filter window, which are settings. With refits every
50 learned samples and without any, in turn: a fit runs in another process, so the time of a
callback must not depend on it. Where this process was itself kept from sending for longer than
`PAUSE_S`, what it sends afterwards in haste says nothing of the node: such a run is void and
repeated.
"""

from __future__ import annotations

import gc
import json
import os
import tempfile
import time
from array import array
from pathlib import Path

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from sgp_proof.result_files import ROOT, make_parser, write_result
from sgp_ros.apps.live_processes import LiveProcesses, graph_environment
from sgp_ros.recordings.model_files import load_parameters

RATE_HZ, WARM_UP_S, BUDGET = 1000.0, 25.0, 500
REORDER_S, WINDOW_S = 0.02, 0.1
_START_LIMIT_S = 30.0
PAUSE_S = 0.25
TIMED = 'callback'
"""Meaning of `callback_ms` in a result; in earlier results it is the engine alone."""
JOINTS = tuple(f'panda_joint{i}' for i in range(1, 8))
RUNS = {
    'no refits': {'refit.enabled': False},
    'refits': {'refit.enabled': True, 'refit.period': 50},
    'basis': {'refit.enabled': False, 'buffer.mode': 'basis', 'basis.features': 100},
}
ORDER = ('no refits', 'refits', 'no refits', 'refits', 'no refits', 'refits', 'basis')


class Machine:
    """Seven joints that move on sums of sines, with inertia, weight and friction of their own."""

    def __init__(self):
        self._rng = np.random.default_rng(0)
        self._rate = 2.0 * np.pi * self._rng.uniform(0.1, 0.6, size=(7, 3))
        self._start = self._rng.uniform(0.0, 2.0 * np.pi, size=(7, 3))
        self._inertia = self._rng.uniform(0.1, 2.0, size=7)
        self._weight = self._rng.uniform(0.0, 20.0, size=7)

        self._message = JointState(name=JOINTS)

    def signals(self, t):
        """Return position, velocity and measured effort, (n, 7) each, at times t (n,) [s]."""
        angle = self._rate * t[:, None, None] + self._start
        q = 0.3 * np.sin(angle).sum(axis=2)
        v = 0.3 * (np.cos(angle) * self._rate).sum(axis=2)
        a = -0.3 * (np.sin(angle) * self._rate**2).sum(axis=2)
        effort = self._inertia * a + self._weight * np.sin(q) + 0.8 * np.tanh(v / 0.05)
        return q, v, effort + 0.05 * self._rng.standard_normal(q.shape)

    def message(self, sample, stamp_ns):
        """Return a state; one object for all, because building one takes as long as sending it."""
        stamp = self._message.header.stamp
        stamp.sec, stamp.nanosec = divmod(stamp_ns, 10**9)
        for name, values in zip(('position', 'velocity', 'effort'), sample, strict=True):
            setattr(self._message, name, values)
        return self._message


class Listener:
    """Messages of the node, with the time of receipt."""

    def __init__(self, context, domain_id):
        rclpy.init(context=context, domain_id=domain_id)
        self._context = context
        self._node = rclpy.create_node('player', context=context)
        self._executor = rclpy.executors.SingleThreadedExecutor(context=context)
        self._executor.add_node(self._node)
        self.publisher = self._node.create_publisher(JointState, 'joint_states', 100)
        self.latencies_s, self.callbacks = [], []
        self.last, self.said = {}, {}
        self._node.create_subscription(
            JointTrajectory, '/sgp_node/prediction', self._hear, 100
        )  # fmt: skip
        self._node.create_subscription(DiagnosticArray, '/diagnostics', self._report, 10)

    def client(self, kind, name):
        """Return a client of a service of the node."""
        return self._node.create_client(kind, name)

    def turn(self):
        """Hear what has come."""
        self._executor.spin_once(timeout_sec=0.0)

    def _hear(self, message):
        stamp = message.header.stamp
        self.latencies_s.append((time.time_ns() - stamp.sec * 10**9 - stamp.nanosec) * 1e-9)

    def _report(self, message):
        for status in message.status:
            values = {pair.key: pair.value for pair in status.values}
            self.last[status.name.split(': ')[-1]] = values
            self.said[status.name.split(': ')[-1]] = status.message
            if 'callback_ms_p99' in values:
                names = ('callback_ms_p50', 'callback_ms_p99', 'callback_ms_max',
                         'callback_cpu_ms_p99', 'push_ms_p99')  # fmt: skip
                self.callbacks.append([float(values[name]) for name in names])

    def close(self):
        """Leave the graph."""
        self._node.destroy_node()
        self._context.try_shutdown()


def node_pid():
    """Return the only child of this process."""
    own = os.getpid()
    text = Path(f'/proc/{own}/task/{own}/children').read_text(encoding='utf-8')
    return int(text.split()[0])


def processor_s(pid):
    fields = Path(f'/proc/{pid}/stat').read_text(encoding='utf-8').rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def _samples(machine, seconds):
    """Return all states, made before the first is sent: the stream must not pause for them."""
    signals = machine.signals(np.arange(round(seconds * RATE_HZ)) / RATE_HZ)
    samples = list(zip(*([array('d', row) for row in signal] for signal in signals), strict=True))
    gc.collect()
    gc.freeze()
    return samples


def _publish(listener, machine, samples):
    """Publish at the rate, stamped with the time of sending.

    Returns:
        How long it took, and the longest time between two turns of this loop [s].
    """
    count, pause_ns = 0, 0
    began_ns = last = time.time_ns()
    while count < len(samples):
        now = time.time_ns()
        pause_ns, last = max(pause_ns, now - last), now
        if now >= began_ns + round(count * 1e9 / RATE_HZ):
            listener.publisher.publish(machine.message(samples[count], now))
            count += 1
        else:
            listener.turn()
            due_ns = began_ns + round(count * 1e9 / RATE_HZ)
            time.sleep(max(0.0, 1e-9 * (due_ns - time.time_ns())))
    return (time.time_ns() - began_ns) * 1e-9, pause_ns * 1e-9


def _run(settings, seconds, graph):
    processes = LiveProcesses(graph)
    listener, machine = Listener(rclpy.Context(), int(graph['ROS_DOMAIN_ID'])), Machine()
    samples, first = _samples(machine, WARM_UP_S + seconds), round(WARM_UP_S * RATE_HZ)
    try:
        node = processes.start('sgp_ros.ros.sgp_node', {
            **load_parameters(ROOT / 'config' / 'panda.yaml'),
            'robot': str(ROOT / 'config/robots/panda.yaml'), 'command.type': 'none',
            'buffer.budget': BUDGET, 'reorder_window': REORDER_S, 'filter.window': WINDOW_S,
            'qos.depth': 1000, **settings,
        })  # fmt: skip
        processes.wait_for(
            node, listener.publisher.get_subscription_count, _START_LIMIT_S, 'to listen'
        )
        _, first_pause_s = _publish(listener, machine, samples[:first])
        listener.latencies_s.clear()
        listener.callbacks.clear()
        pid = node_pid()
        before, wall = processor_s(pid), time.monotonic()
        took_s, pause_s = _publish(listener, machine, samples[first:])
        used, elapsed = processor_s(pid) - before, time.monotonic() - wall
        end = time.monotonic() + 2.0
        while time.monotonic() < end:
            listener.turn()
        processes.check()
    finally:
        processes.stop()
        listener.close()
    found = _summary(listener, len(samples), used / elapsed, took_s)
    return found | {'longest_pause_s': max(first_pause_s, pause_s)}


def _summary(listener, published, processor, took_s):
    latency_ms = 1e3 * np.array(listener.latencies_s)
    structural_ms = 1e3 * (REORDER_S + 0.5 * WINDOW_S)
    callbacks = np.array(listener.callbacks)
    samples, model = listener.last['samples'], listener.last['model']
    found = {
        'published': published, 'read': int(samples['read']),
        'lost': published - int(samples['read']),
        'refused': sum(int(v) for k, v in samples.items() if k.startswith('refused.')),
        'predictions': len(latency_ms), 'learned': int(samples['learned']),
        'refits': int(model['refits']), 'refits_refused': int(model['refits_refused']),
        'buffer': int(model['buffer']), 'processor_share': processor, 'took_s': took_s,
        'callback_ms': dict(zip(('p50', 'p99', 'max'), (
            float(np.median(callbacks[:, 0])), float(np.median(callbacks[:, 1])),
            float(callbacks[:, 2].max()),
        ), strict=True)),
    }  # fmt: skip
    for name, shift in (('latency_ms', 0.0), ('latency_beyond_settings_ms', structural_ms)):
        p50, p99 = np.percentile(latency_ms, (50, 99)) - shift
        found[name] = {'p50': float(p50), 'p99': float(p99)}
    return found


def main():
    """Run the node in each way and write the result."""
    parser = make_parser(__doc__, 'live_rate')
    parser.add_argument('--seconds', type=float, default=60.0)
    arguments = parser.parse_args()
    seconds = arguments.seconds
    found, void, order = {name: [] for name in RUNS}, [], list(ORDER)
    while order:
        name = order.pop(0)
        with tempfile.TemporaryDirectory() as logs, graph_environment(Path(logs)) as graph:
            graph['PYTHONPATH'] = str(ROOT)
            os.environ.update(graph)
            load = os.getloadavg()[0]
            run = _run(RUNS[name], seconds, graph) | {'load_before': load}
        print(name, json.dumps(run), flush=True)
        if run['longest_pause_s'] <= PAUSE_S:
            found[name].append(run)
        elif len(void) < len(ORDER):
            void.append({'name': name, 'longest_pause_s': run['longest_pause_s']})
            order.insert(0, name)
        else:
            raise SystemExit(f'{len(void)} runs were void: this computer has other work to do')
    result = {
        'timed': TIMED, 'rate_hz': RATE_HZ, 'seconds': seconds,
        'budget': BUDGET, 'reorder_s': REORDER_S, 'window_s': WINDOW_S, 'runs': found,
        'void': void, 'pause_s': PAUSE_S,
    }  # fmt: skip
    write_result(arguments.out, result, schema=2)


if __name__ == '__main__':
    main()
