"""Processor time, wall time and peak memory of whole commands, over length and number of joints.

Drawn arms with friction that their robot files lack are simulated once; each command then runs in
a process of its own, as a user starts it, imports and report included.
"""

from __future__ import annotations

import json
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
from sgp_proof.bench.stages import stages_of
from sgp_proof.bench.sysid import SYSID_KEYS, sysid_row
from sgp_proof.concealed.machines import draw_machine
from sgp_proof.concealed.robots import urdf
from sgp_ros.apps.simulation import write_simulated
from sgp_ros.physics.example import example_effect
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.recording import simulate
from sgp_ros.simulation.tree_simulator import tree_simulator

RATE_HZ = 200.0
STAGED = (('diagnose', 3, 60.0), ('diagnose', 7, 60.0), ('identify', 7, 60.0))
"""Command, joints and seconds of which the stages are timed."""
SIZES = {
    'diagnose': ((3, 20.0), (3, 60.0), (3, 180.0), (7, 20.0), (7, 60.0), (7, 900.0)),
    'identify': ((3, 20.0), (3, 60.0), (7, 20.0), (7, 60.0)),
}
"""Joints and seconds, by command."""
_SEED = 36
_JOINT, _LEVEL = 'joint_2', 3.0
_FRICTION = (example_effect(_JOINT, _LEVEL),)
_RIVALLED = ('diagnose', 3, 60.0)
"""Command, joints and seconds at which `mujoco.sysid` is asked too."""


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


def bench_stages(
    _rivals: Rivals, progress: Callable[[float], None], *, is_quick: bool
) -> list[dict[str, Any]]:
    """Return one row per stage of commands: processor seconds, imports and all."""
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        for i, (command, joints, seconds) in enumerate(STAGED):
            size = (1, 12.0) if is_quick else (joints, seconds)
            robot, recording = draw_recording(Path(folder), *size)
            words = [command, str(recording), '--robot', str(robot)]
            found = stages_of([*words, '--out', str(Path(folder) / f'out_{i}')])
            head = {'command': command, 'joints': size[0], 'seconds': size[1]}
            rows += [{**head, 'stage': name, 'processor_s': x} for name, x in found.items()]
            progress((i + 1) / len(STAGED))
    return rows


def _rows(
    command: str, progress: Callable[[float], None], *, is_quick: bool
) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    sizes = ((1, 12.0),) if is_quick else SIZES[command]
    with tempfile.TemporaryDirectory() as folder:
        for i, (joints, seconds) in enumerate(sizes):
            robot, recording = draw_recording(Path(folder), joints, seconds)
            words = [command, str(recording), '--robot', str(robot)]
            out = Path(folder) / f'out_{i}'
            row = {'joints': joints, 'seconds': seconds, **measured([*words, '--out', str(out)])}
            if command == 'diagnose':
                row |= named(out)
            if (command, joints, seconds) == _RIVALLED:
                row |= sysid_row(robot, recording, _JOINT, _LEVEL)
            elif command == 'diagnose':
                row |= dict.fromkeys(SYSID_KEYS, '')
            rows.append(row)
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


def named(out: Path) -> dict[str, Any]:
    """Return the first finding of a diagnosis, and how far the level of friction is off."""
    findings = json.loads((out / 'diagnosis.json').read_text(encoding='utf-8'))['findings']
    if not findings:
        return {'named': '', 'off_percent': ''}
    first = findings[0]
    level = first['parameters'].get('level', {}).get('value')
    off = '' if level is None else 100.0 * abs(level - _LEVEL) / _LEVEL
    return {'named': f'{first["effect"]} of {first["joint"]}', 'off_percent': off}


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
