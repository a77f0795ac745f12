"""Processor time, wall time and peak memory of whole commands, over length and number of joints.

Drawn arms with friction that their robot files lack are simulated once; each command then runs in
a process of its own, as a user starts it, imports and report included.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from sgp_proof.bench.rivals import Rivals
from sgp_proof.concealed.machines import draw_machine
from sgp_proof.concealed.robots import urdf
from sgp_ros.apps.simulation import write_simulated
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.recording import simulate
from sgp_ros.simulation.tree_simulator import tree_simulator

RATE_HZ = 200.0
SIZES = {
    'diagnose': ((3, 20.0), (3, 60.0), (3, 180.0), (7, 20.0), (7, 60.0)),
    'identify': ((3, 20.0), (3, 60.0), (7, 20.0)),
}
"""Joints and seconds, by command."""
_SEED = 36
_FRICTION = ('coulomb_friction:joint=joint_2,level=3',)


def bench_diagnose(
    _rivals: Rivals, progress: Callable[[float], None], *, is_quick: bool
) -> list[dict[str, Any]]:
    """Return one row per size of `sgp diagnose`."""
    return _rows('diagnose', progress, is_quick=is_quick)


def bench_identify(
    _rivals: Rivals, progress: Callable[[float], None], *, is_quick: bool
) -> list[dict[str, Any]]:
    """Return one row per size of `sgp identify`."""
    return _rows('identify', progress, is_quick=is_quick)


def _rows(
    command: str, progress: Callable[[float], None], *, is_quick: bool
) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    sizes = ((1, 12.0),) if is_quick else SIZES[command]
    with tempfile.TemporaryDirectory() as folder:
        for i, (joints, seconds) in enumerate(sizes):
            robot, recording = draw_recording(Path(folder), joints, seconds)
            words = [command, str(recording), '--robot', str(robot)]
            found = measured([*words, '--out', str(Path(folder) / f'out_{i}')])
            rows.append({'joints': joints, 'seconds': seconds, **found})
            progress((i + 1) / len(sizes))
    return [row | _exponents(row, rows) for row in rows]


def draw_recording(folder: Path, joints: int, seconds: float) -> tuple[Path, Path]:
    """Write robot file and recording of a drawn arm, and return their paths."""
    seed = _SEED
    while True:
        family, bodies = draw_machine(np.random.default_rng([seed, joints]))
        if len(bodies) == joints and family in {'arm', 'pendulum'}:
            break
        seed += 1
    text = urdf(family, bodies)
    robot = folder / f'arm_{joints}.urdf'
    robot.write_text(text, encoding='utf-8')
    effects = _FRICTION if joints > 1 else ()
    simulation = make_simulation(
        tree_simulator(text), seed=1, rate_hz=RATE_HZ, effects=effects, start_ns=10**18
    )
    recording = folder / f'arm_{joints}_{seconds:g}.mcap'
    write_simulated(simulate(simulation, seconds), recording)
    return robot, recording


def measured(words: list[str]) -> dict[str, float]:
    """Return what a command of `sgp` costs.

    Raises:
        RuntimeError: the command failed.
    """
    began = time.perf_counter()
    with subprocess.Popen(
        [sys.executable, '-m', 'sgp_ros.cli', *words],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    ) as process:  # fmt: skip
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f'sgp {" ".join(words)} ended with {process.returncode}')
    return {
        'processor_s': used.ru_utime + used.ru_stime, 'wall_s': time.perf_counter() - began,
        'peak_megabytes': used.ru_maxrss / 1024.0,
    }  # fmt: skip


def _exponents(row: dict[str, Any], rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return growth of the cost since the row before with fewer seconds, or fewer joints.

    The exponent e of `cost ~ size^e` between two rows that differ in this size alone.
    """
    found: dict[str, Any] = {'exponent_seconds': '', 'exponent_joints': ''}
    for size, other in (('seconds', 'joints'), ('joints', 'seconds')):
        smaller = [x for x in rows if x[other] == row[other] and x[size] < row[size]]
        if smaller:
            last = max(smaller, key=lambda x: x[size])
            ratio = math.log(row['processor_s'] / last['processor_s'])
            found[f'exponent_{size}'] = ratio / math.log(row[size] / last[size])
    return found
