"""A node at 500 messages a second for a long time, beside a loaded core: loss, memory, callbacks.

    python -m sgp_proof.streams.soak --minutes 30

Seven joints of Panda's URDF with the parameter file that is shipped for ros2_control, record and
autosave included, and a process that computes without a pause. A message is lost that was
published and not read; the node counts what it misses by the period of the stamps, which are those
at which messages were due. Both are differences over the run, which begins after a warm-up and a
pause long enough to be none of a loss. Memory is the resident set of the node's process, once a
minute.

With `--niceness -5` the node has a higher priority than the others in every second minute:

    python -m sgp_proof.streams.soak --minutes 8 --niceness -5 --out out/soak_priority.json
"""

from __future__ import annotations

import gc
import json
import os
import subprocess
import sys
import tempfile
import time
from array import array
from pathlib import Path

import numpy as np
import rclpy
import yaml

from sgp_proof.result_files import ROOT, make_parser, write_result
from sgp_proof.streams.live_rate import TIMED, Listener, Machine, node_pid, processor_s
from sgp_ros.apps.live_processes import LiveProcesses, graph_environment

RATE_HZ, WARM_UP_S, PAUSE_S = 500.0, 40.0, 12.0
SETTINGS = ROOT / 'config' / 'bringup' / 'ros2_control.yaml'
ROBOT = ROOT / 'config' / 'robots' / 'panda.urdf'
BLOCK_S = 60.0
_START_LIMIT_S = 60.0
_BUSY = 'while True: pass'


def _resident_mb(pid):
    for line in Path(f'/proc/{pid}/status').read_text(encoding='utf-8').splitlines():
        if line.startswith('VmRSS'):
            return int(line.split()[1]) / 1024.0
    raise SystemExit(f'no process {pid}')


def _samples(machine, first_s, seconds):
    """Return the states of a block, made before the first of them is sent."""
    times = first_s + np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    signals = machine.signals(times)
    return list(zip(*([array('d', row) for row in signal] for signal in signals), strict=True))


def _publish(listener, machine, samples, began_ns, first):
    """Publish a block at the rate; return the longest time between two turns of the loop [s]."""
    pause_ns, last = 0, time.time_ns()
    for i, sample in enumerate(samples):
        due_ns = began_ns + round((first + i) * 1e9 / RATE_HZ)
        while (now := time.time_ns()) < due_ns:
            listener.turn()
            time.sleep(max(0.0, min(1e-9 * (due_ns - time.time_ns()), 1e-3)))
        pause_ns, last = max(pause_ns, now - last), now
        listener.publisher.publish(machine.message(sample, due_ns))
    return pause_ns * 1e-9


def _quiet(listener, seconds):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        listener.turn()
        time.sleep(1e-3)


def _counts(listener):
    values = listener.last['samples']
    refused = sum(int(v) for k, v in values.items() if k.startswith('refused.'))
    return {'messages': int(values['messages']), 'counted_lost': int(values['lost'])} | {
        'refused': refused
    }


def _renice(pid, niceness):
    """Give all threads of a process another niceness; to lower it needs the right to."""
    for thread in Path(f'/proc/{pid}/task').iterdir():
        os.setpriority(os.PRIO_PROCESS, int(thread.name), niceness)


def _shipped_settings():
    """Return all settings of the shipped file by dotted name, those of the node alone too."""

    def flat(prefix, entries):
        for key, value in entries.items():
            if isinstance(value, dict):
                yield from flat(f'{prefix}{key}.', value)
            else:
                yield f'{prefix}{key}', value

    document = yaml.safe_load(SETTINGS.read_text(encoding='utf-8'))
    return dict(flat('', document['/**']['ros__parameters']))


def _run(minutes, niceness, settings, graph):
    processes = LiveProcesses(graph)
    listener, machine = Listener(rclpy.Context(), int(graph['ROS_DOMAIN_ID'])), Machine()
    busy = None
    blocks, published, elapsed_s, t0 = [], 0, 0.0, 0.0
    try:
        node = processes.start('sgp_ros.ros.sgp_node', settings)
        processes.wait_for(
            node, listener.publisher.get_subscription_count, _START_LIMIT_S, 'to listen'
        )
        pid = node_pid()  # the only child so far
        busy = subprocess.Popen([sys.executable, '-c', _BUSY])
        samples = _samples(machine, 0.0, WARM_UP_S)
        _publish(listener, machine, samples, time.time_ns(), 0)
        _quiet(listener, PAUSE_S)
        before = _counts(listener)
        listener.callbacks.clear()
        began_ns, used_s, began = time.time_ns(), processor_s(pid), time.monotonic()
        for block in range(round(60.0 * minutes / BLOCK_S)):
            t0 = WARM_UP_S + block * BLOCK_S
            samples = _samples(machine, t0, BLOCK_S)
            if niceness:
                _renice(pid, niceness * (block % 2))
            pause_s = _publish(listener, machine, samples, began_ns, published)
            published += len(samples)
            processes.check()
            blocks.append(_block(listener, pid, published, pause_s))
            blocks[-1]['niceness'] = niceness * (block % 2)
            print(json.dumps(blocks[-1]), flush=True)
            gc.collect()
        elapsed_s, used_s = time.monotonic() - began, processor_s(pid) - used_s
        _quiet(listener, PAUSE_S)
        after = _counts(listener)
    finally:
        if busy is not None:
            busy.kill()
            busy.wait()
        processes.stop()
        listener.close()
    found = {name: after[name] - before[name] for name in after}
    model = listener.last['model']
    return {
        'minutes': elapsed_s / 60.0, 'published': published, **found,
        'lost': published - found['messages'],
        'processor_share': used_s / elapsed_s,
        'refits': int(model['refits']), 'learned': int(listener.last['samples']['learned']),
        'blocks': blocks,
    }  # fmt: skip


def _block(listener, pid, published, pause_s):
    callbacks = np.array(listener.callbacks)
    listener.callbacks.clear()
    return {
        'published': published, 'resident_mb': _resident_mb(pid), 'publisher_pause_s': pause_s,
        'callback_ms_p50': float(np.median(callbacks[:, 0])),
        'callback_ms_p99': float(np.median(callbacks[:, 1])),
        'callback_ms_max': float(callbacks[:, 2].max()),
        'callback_cpu_ms_p99': float(np.median(callbacks[:, 3])),
        'push_ms_p99': float(np.median(callbacks[:, 4])),
        'counted_lost': int(listener.last['samples']['lost']),
        'load': os.getloadavg()[0],
    }  # fmt: skip


def main():
    """Run the node and write the result."""
    parser = make_parser(__doc__, 'soak')
    parser.add_argument('--minutes', type=float, default=30.0)
    parser.add_argument('--niceness', type=int, default=0, help='in every second minute')
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as logs, graph_environment(Path(logs)) as graph:
        graph['PYTHONPATH'] = str(ROOT)
        os.environ.update(graph)
        settings = {**_shipped_settings(), 'robot': str(ROBOT)}
        for name in ('record.path', 'save.path'):
            settings[name] = str(Path(logs) / str(settings[name]))
        run = _run(arguments.minutes, arguments.niceness, settings, graph)
        recorded = sum(p.stat().st_size for p in Path(logs).rglob('*.mcap'))
        saved = [path.name for path in Path(logs).glob('*.npz')]
    result = {
        'timed': TIMED, 'settings': SETTINGS.name, 'recorded_mb': recorded / 1e6, 'saved': saved,
        'rate_hz': RATE_HZ, 'joints': 7, 'budget': settings['buffer.budget'],
        'qos_depth': settings['qos.depth'],
        'executor': 'EventsExecutor', 'warm_up_s': WARM_UP_S, **run,
    }  # fmt: skip
    write_result(arguments.out, result, schema=1)


if __name__ == '__main__':
    main()
