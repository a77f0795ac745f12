"""Every command that writes, on a disk that is full and on one that nobody may write to.

    python -m sgp_proof.robustness.disk            # as root, for a disk of its own

Each command runs three times into one folder on a small disk in memory: once with room, once after
the disk was filled up but for some pages, once after it was made read-only. The second and third
run must end with status 2 and one line, and leave the results of the first as they are.
"""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from sgp_proof.result_files import ROOT, make_parser, read_result, write_result
from sgp_proof.robustness.kills import ROBOT, make_recordings
from sgp_proof.robustness.result_folders import broken_in, litter_in, results_in

NAMES = ('simulate', 'import', 'export', 'effects', 'check', 'replay', 'identify', 'diagnose')
SIZE_MB, LEFT_BYTES = 8, (0, 6000)
STATUS = 2


def commands(folder: Path, bag: Path) -> dict[str, list[str]]:
    """Return a command line of each command by name; `demo` and `watch` write no such results."""
    table = folder / 'log.csv'
    table.write_text('t,q\n' + ''.join(f'{0.01 * i},{0.1 * i}\n' for i in range(900)))
    robot, recording = ['--robot', str(ROBOT)], str(bag)
    return {
        'simulate': ['simulate', str(ROBOT), '--duration', '2'],
        'import': ['import', str(table)],
        'export': ['export', str(ROOT / 'config/robots/panda.urdf'), '--to', 'urdf'],
        'effects': ['effects'],
        'check': ['check', recording, *robot],
        'replay': ['replay', recording, *robot],
        'identify': ['identify', recording, *robot],
        'diagnose': ['diagnose', recording, *robot],
    }


def _run(arguments: list[str], out: Path) -> tuple[int, str]:
    done = subprocess.run(
        [sys.executable, '-m', 'sgp_ros.cli', *arguments, '--out', str(out), '--quiet'],
        capture_output=True, text=True, check=False, timeout=300.0,
    )  # fmt: skip
    return done.returncode, done.stderr


def _fill(disk: Path, left_bytes: int) -> Path:
    """Fill a disk up but for so many bytes; return the file that does it."""
    path = disk / 'filler'
    with path.open('wb', buffering=0) as file:
        try:
            while True:
                file.write(bytes(4096))
        except OSError as error:
            if error.errno != errno.ENOSPC:
                raise
    os.truncate(path, max(path.stat().st_size - left_bytes, 0))
    return path


def _faults(out: Path, before: dict[str, str], status: int, said: str) -> list[str]:
    found = [] if status == STATUS else [f'status {status}']
    found += [] if said.count('\n') == 1 else [f'{said.count(chr(10))} lines']
    found += [] if results_in(out) == before else ['the old results are not as they were']
    return [*found, *(f'left behind: {x}' for x in litter_in(out)), *broken_in(out)]


def measure(name: str, arguments: list[str], disk: Path) -> dict[str, Any]:
    """Run a command in the three ways; return what came of it."""
    out = disk / name
    status, said = _run(arguments, out)
    if status:
        raise SystemExit(f'{name}: {said}')
    before, rows = results_in(out), {}
    for left in LEFT_BYTES:
        filler = _fill(disk, left)
        status, said = _run(arguments, out)
        rows[f'full but for {left} bytes'] = [said.strip(), _faults(out, before, status, said)]
        filler.unlink()
    subprocess.run(['mount', '-o', 'remount,ro', str(disk)], check=True)
    status, said = _run(arguments, out)
    subprocess.run(['mount', '-o', 'remount,rw', str(disk)], check=True)
    rows['read-only'] = [said.strip(), _faults(out, before, status, said)]
    return {'results': len(before), 'runs': {k: {'said': s, 'faults': f}
                                             for k, (s, f) in rows.items()}}  # fmt: skip


def main() -> None:
    """Measure the named commands and add what came of them to the result."""
    parser = make_parser(__doc__, 'robust_disk', NAMES)
    arguments = parser.parse_args()
    rows = read_result(arguments.out).get('commands', {})
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        known = commands(folder, make_recordings(folder)[0])
        for command in arguments.names:
            disk = folder / f'disk_{command}'
            disk.mkdir()
            subprocess.run(['mount', '-t', 'tmpfs', '-o', f'size={SIZE_MB}m', 'tmpfs', str(disk)],
                           check=True)  # fmt: skip
            try:
                found = measure(command, known[command], disk)
            finally:
                subprocess.run(['umount', str(disk)], check=True)
            print(command, found, flush=True)
            # what was said names folders of one computer
            rows[command] = {
                'results': found['results'],
                'faults': {way: run['faults'] for way, run in found['runs'].items()},
            }
            rows = {name: rows[name] for name in NAMES if name in rows}
            faults = [f'{name} {way}: {fault}' for name, row in rows.items()
                      for way, all_ in row['faults'].items() for fault in all_]  # fmt: skip
            write_result(arguments.out, {'size_mb': SIZE_MB, 'commands': rows, 'faults': faults})


if __name__ == '__main__':
    main()
