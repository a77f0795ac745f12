"""Real recordings through `sgp identify`: EMPS, double pendulum, Panda, TIAGo's arm.

    python -m sgp_proof.real.identified [NAME ...]

Every number is one of `identification.json`; what it says of the filter, of held-out time and of
the parameters is kept in `results/<name>.json`.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from pathlib import Path

from sgp_proof.real.recordings import DATA, DOUBLE, ROBOTS, imported
from sgp_proof.result_files import RESULTS, write_result
from sgp_ros.cli import main as sgp

IMPORTED = {
    'emps': ('emps', ('emps/emps_id.csv', 'emps/emps_val_pulses.csv')),
    'panda': ('panda', ('panda/panda_exciting.npz',)),
    'double_pendulum_a0': (
        'dfki_double_pendulum', [DOUBLE.format('A.0__20220815', i) for i in ('00', '01')],
    ),
    'double_pendulum_c0': (
        'dfki_double_pendulum', [DOUBLE.format('C.0__20220914', i) for i in ('00', '01')],
    ),
}  # fmt: skip
"""Name to map and files under the shared data."""
COMMANDS = {
    'double_pendulum_a0': (
        'design_A.0__20220815__sys_id__trajectory_00.mcap', '--robot', 'double_pendulum',
        '--test', 'design_A.0__20220815__sys_id__trajectory_01.mcap',
    ),
    'double_pendulum_c0': (
        'design_C.0__20220914__sys_id__trajectory_00.mcap', '--robot', 'double_pendulum',
        '--test', 'design_C.0__20220914__sys_id__trajectory_01.mcap',
    ),
    'emps': ('emps_id.mcap', '--robot', 'linear_axis', '--test', 'emps_val_pulses.mcap'),
    'panda': ('panda_exciting.mcap', '--robot', 'panda.yaml', '--share', '0.4'),
    'tiago': (
        'mcap_tiago_dynamic', '--robot', 'tiago_arm.yaml', '--holdout', 'alternate',
        '--share', '0.5', '--stretch', '6',
    ),
    'tiago_5hz': (
        'mcap_tiago_dynamic', '--robot', 'tiago_arm.yaml', '--holdout', 'alternate',
        '--share', '0.5', '--stretch', '6', '--cutoff', '5',
    ),
    'panda_5hz': (
        'panda_exciting.mcap', '--robot', 'panda.yaml', '--share', '0.4', '--cutoff', '5',
    ),
    'panda_every_velocity': (
        'panda_exciting.mcap', '--robot', 'panda.yaml', '--share', '0.4',
        '--inputs', 'every:velocity',
    ),
}  # fmt: skip
"""Arguments of `sgp identify` per recording, files by their names alone."""


def _found(argument: str, folder: Path) -> str:
    """Return the path of a file that a command names."""
    for path in (folder / argument, ROBOTS / argument, DATA / 'tiago' / argument):
        if path.exists():
            return str(path)
    return argument


def run(name: str, folder: Path) -> dict:
    """Import and identify one recording."""
    machine = name.removesuffix('_5hz').removesuffix('_every_velocity')
    mapping, files = IMPORTED.get(machine, ('', ()))
    for file in files:
        imported(file, mapping, folder)
    began = time.perf_counter()
    out = folder / name
    arguments = [_found(argument, folder) for argument in COMMANDS[name]]
    if sgp(['identify', *arguments, '--out', str(out)]):
        raise SystemExit(f'{name} cannot be identified')
    findings = json.loads((out / 'identification.json').read_text(encoding='utf-8'))
    del findings['base_parameters'], findings['versions']
    return {
        'command': 'sgp identify ' + ' '.join(COMMANDS[name]),
        'seed': 0,
        'seconds': round(time.perf_counter() - began, 1),
        'findings': findings,
    }


def main() -> None:
    """Run the named recordings, or all."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('names', nargs='*', choices=[*COMMANDS, []], default=[], metavar='NAME')
    parser.add_argument('--out', type=Path, default=RESULTS, help='folder of the results')
    arguments = parser.parse_args()
    for name in arguments.names or COMMANDS:
        with tempfile.TemporaryDirectory() as folder:
            result = run(name, Path(folder))
        write_result(arguments.out / f'{name}_identified.json', result)


if __name__ == '__main__':
    main()
