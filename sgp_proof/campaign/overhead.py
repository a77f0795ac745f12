"""Cost of spreading tasks over workers: `python -m sgp_proof.campaign.overhead`.

Tasks that only wait need no processor, so any number of workers can be tried on any computer: what
they take beyond waiting is what Dask takes. Real recordings follow on one and two workers, then
with workers and whole runs killed at random, and the tables are compared byte by byte.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from sgp_proof.campaign.wear import measured
from sgp_proof.result_files import make_parser, write_result
from sgp_ros.campaign.cluster import cluster, run_tasks
from sgp_ros.cli import main

WORKERS = (1, 2, 4, 8)
WAIT_S, WAITS = 0.5, 20
BAGS, LENGTH_S = 24, '4'
SEED, PAUSE_S = 0, (5.0, 15.0)


def wait(job):
    """Be a recording that takes a while."""
    time.sleep(job['seconds'])
    return {}


def waiting(counts=WORKERS, waits=WAITS):
    """Return by number of workers the seconds that tasks took, beside those without any cost.

    Scheduler and client are in this process: its processor time is what a task costs them.
    """
    found = {}
    for workers in counts:
        with cluster(None, workers) as client:
            client.wait_for_workers(workers)
            list(run_tasks(client, wait, [{'seconds': 0.1}] * 4 * workers))
            begun, used, load = time.perf_counter(), time.process_time(), os.getloadavg()[0]
            list(run_tasks(client, wait, [{'seconds': WAIT_S}] * waits * workers))
            seconds, used = time.perf_counter() - begun, time.process_time() - used
        ideal = waits * WAIT_S
        found[str(workers)] = {
            'seconds': seconds, 'ideal': ideal, 'share': ideal / seconds, 'load_before': load,
            'scheduler_ms_per_task': 1e3 * used / (waits * workers),
        }  # fmt: skip
    return {'tasks_per_worker': waits, 'task_s': WAIT_S, 'workers': found}


def make_bags(folder):
    """Write short recordings of a linear axis."""
    for i in range(BAGS):
        out = folder / 'made' / str(i)
        arguments = ['simulate', 'linear_axis', '--duration', LENGTH_S, '--seed', str(100 + i)]
        if main([*arguments, '--out', str(out), '--quiet']):
            raise SystemExit(1)
        (folder / 'bags').mkdir(exist_ok=True)
        (out / 'linear_axis.mcap').rename(folder / 'bags' / f'{i:02d}.mcap')
    return folder / 'bags'


def arguments_of(bags, out, workers):
    options = ['--robot', 'linear_axis', '--task', 'identify', '--workers', str(workers)]
    return [sys.executable, '-m', 'sgp_ros.cli', 'campaign', str(bags), *options,
            '--out', str(out), '--quiet']  # fmt: skip


def speed(bags, folder):
    """Return the wall seconds between the first and the last result, by number of workers."""
    found = {}
    for workers in (1, 2):
        out = folder / f'speed{workers}'
        load = os.getloadavg()[0]
        subprocess.run(arguments_of(bags, out, workers), check=True)
        times = sorted(path.stat().st_mtime for path in (out / 'recordings').glob('*.json'))
        skipped = 2 * workers  # the first of each worker loads the package
        rate = (len(times) - skipped) / (times[-1] - times[skipped - 1])
        found[str(workers)] = {'recordings_per_s': rate, 'load_before': load}
    found['ratio'] = found['2']['recordings_per_s'] / found['1']['recordings_per_s']
    return found


def kills(bags, folder):
    """Kill workers and whole runs at random until the campaign is done; return the counts."""
    rng, out = random.Random(SEED), folder / 'killed'
    lost_workers = lost_runs = 0
    while True:
        running = subprocess.Popen(arguments_of(bags, out, 2))
        while running.poll() is None:
            time.sleep(rng.uniform(*PAUSE_S))
            workers = children_of(running.pid)
            if rng.random() < 0.2:
                running.kill()
                running.wait()
                lost_runs += 1
            elif workers and running.poll() is None:
                os.kill(rng.choice(workers), signal.SIGKILL)
                lost_workers += 1
        if running.returncode == 0:
            break
    same = (out / 'results.parquet').read_bytes() == (
        folder / 'speed1' / 'results.parquet').read_bytes()  # fmt: skip
    return {'recordings': BAGS, 'killed_workers': lost_workers, 'killed_runs': lost_runs,
            'same_table': same, 'seed': SEED}  # fmt: skip


def children_of(process):
    """Return the worker processes below a run, none that only watches."""
    found = []
    for place in Path('/proc').glob('[0-9]*'):
        try:
            parent = int((place / 'stat').read_text().rpartition(')')[2].split()[1])
            line = (place / 'cmdline').read_bytes()
        except OSError:
            continue
        if parent == process and b'spawn_main' in line:
            found.append(int(place.name))
    return found


def bench_campaign(_rivals, progress, *, is_quick):
    """Return one row per number of workers: tasks that wait, and recordings where there are cores.

    As `sgp bench campaign`.
    """
    counts, waits = ((1,), 2) if is_quick else (WORKERS, WAITS)
    found = waiting(counts, waits)['workers']
    progress(0.5)
    rates = {}
    if not is_quick:
        with tempfile.TemporaryDirectory() as name:
            rates = speed(make_bags(Path(name)), Path(name))
    return [
        {'workers': n, **found[str(n)],
         'recordings_per_s': rates.get(str(n), {}).get('recordings_per_s', '')}
        for n in counts
    ]  # fmt: skip


def measure():
    """Measure and write."""
    arguments = make_parser(__doc__, 'campaign', ['waiting', 'speed', 'kills']).parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder, done = Path(name), {}
        if 'waiting' in arguments.names:
            done['waiting'] = waiting()
        if {'speed', 'kills'} & set(arguments.names):
            bags = make_bags(folder)
            done['speed'] = speed(bags, folder)
            if 'kills' in arguments.names:  # compared with the undisturbed run before
                done['kills'] = kills(bags, folder)
    write_result(arguments.out, measured(arguments.out) | done, 'distributed', 'pyarrow')
    print(done)


if __name__ == '__main__':
    measure()
