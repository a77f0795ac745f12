"""Harmful files through every command: one line, status 2, in bounds, and nothing left behind.

    python -m sgp_proof.robustness.harmful              # all files through all commands
    python -m sgp_proof.robustness.harmful --turn 0     # each file through one command
    python -m sgp_proof.robustness.harmful --again      # what had a fault, once more

Each file of `harmful_files` and `harmful_recordings` is given to every command that reads one of
its kind. Anything else than status 2 with one line within ten seconds of the processor and one
gibibyte is a fault, and so is a file that is left in the folder of the results or of temporary
files.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from multiprocessing import get_context
from pathlib import Path
from threading import Timer
from typing import Any

from sgp_proof.result_files import make_parser, read_result, write_result
from sgp_proof.robustness import harmful_files, harmful_recordings
from sgp_proof.robustness.events import LONGEST_S, MOST_KILOBYTES
from sgp_proof.robustness.kills import ROBOT, make_recordings
from sgp_ros.cli import BAD_INPUT

_ROBOT = ['--robot', str(ROBOT)]
_SIMULATE = ['simulate', str(ROBOT), '--duration', '2']
ELAPSED_S = 600.0
"""After which a command hangs, on a computer that does other work too [s]."""
KINDS = {
    'recording': (harmful_recordings.RECORDINGS, [
        ['check', '{}', *_ROBOT], ['replay', '{}', *_ROBOT], ['identify', '{}', *_ROBOT],
        ['diagnose', '{}', *_ROBOT], [*_SIMULATE[:2], '--commands', '{}'],
        ['identify', 'BAG', *_ROBOT, '--test', '{}'], ['diagnose', 'BAG', *_ROBOT, '--test', '{}'],
        ['diagnose', 'BAG', *_ROBOT, '--sim', '{}'],
    ]),
    'table': (harmful_files.TABLES, [['import', '{}']]),
    'robot': (harmful_files.ROBOTS, [
        ['check', 'BAG', '--robot', '{}'], ['replay', 'BAG', '--robot', '{}'],
        ['identify', 'BAG', '--robot', '{}'], ['diagnose', 'BAG', '--robot', '{}'],
        ['diagnose', 'BAG', *_ROBOT, '--sim', '{}'], ['simulate', '{}', '--duration', '2'],
        ['simulate', '{}', '--commands', 'BAG'], ['export', '{}', '--to', 'urdf'],
        ['import', 'TABLE', '--robot', '{}'],
    ]),
    'settings': (harmful_files.SETTINGS, [
        ['replay', 'BAG', *_ROBOT, '--params', '{}'], ['check', 'BAG', *_ROBOT, '--gains', '{}'],
        ['identify', 'BAG', *_ROBOT, '--gains', '{}'],
        ['diagnose', 'BAG', *_ROBOT, '--gains', '{}'],
        ['diagnose', 'BAG', *_ROBOT, '--bodies', '{}'], [*_SIMULATE, '--gains', '{}'],
        ['import', 'TABLE', '--map', '{}'],
    ]),
    'model': (harmful_files.MODELS, [['replay', 'BAG', *_ROBOT, '--model', '{}']]),
    'truth': (harmful_files.TRUTHS, [['replay', 'BAG', *_ROBOT, '--truth', '{}']]),
}  # fmt: skip
"""Kind to its files, and the commands that read one, with BAG and TABLE for intact ones."""


def measure(command: list[str], folder: Path) -> dict[str, Any]:
    """Run a command; return its time [s], its memory [MB] and its faults."""
    out, temporary = folder / 'out', folder / 'tmp'
    temporary.mkdir(exist_ok=True)
    with tempfile.TemporaryFile() as stream:
        process = subprocess.Popen(
            [sys.executable, '-m', 'sgp_ros.cli', *command, '--out', str(out), '--quiet'],
            stdout=subprocess.DEVNULL, stderr=stream, stdin=subprocess.DEVNULL,
            env={**os.environ, 'TMPDIR': str(temporary)},
        )  # fmt: skip
        end = Timer(ELAPSED_S, process.kill)
        end.start()
        _, status, used = os.wait4(process.pid, 0)  # of it and of its children
        end.cancel()
        process.returncode = os.waitstatus_to_exitcode(status)
        stream.seek(0)
        said = stream.read()
    seconds, megabytes = used.ru_utime + used.ru_stime, used.ru_maxrss // 1024
    found = [] if process.returncode == BAD_INPUT else [f'status {process.returncode}']
    found += [] if said.count(b'\n') == 1 else [f'{said.count(10)} lines']
    found += ['a traceback'] if b'Traceback' in said else []
    found += ['longer than 10 s'] if seconds > LONGEST_S else []
    found += ['more than 1 GiB'] if used.ru_maxrss > MOST_KILOBYTES else []
    left = [*temporary.iterdir(), *(out.iterdir() if out.exists() else ())]
    found += [f'left behind: {path.name}' for path in left]
    return {'seconds': round(seconds, 1), 'megabytes': megabytes, 'faults': found,
            'said': said.decode(errors='replace')}  # fmt: skip


def cases(kinds: list[str], folder: Path, turn: int | None) -> Iterator[tuple[str, list[str]]]:
    """Yield the name and the command of each case; its file exists until the next one.

    Args:
        kinds: of files.
        folder: to write them into.
        turn: gives each file to one command, the next file to the next one, from that one on;
            None gives each to all.
    """
    bag = str(make_recordings(folder)[0])
    table = folder / 'log.csv'
    table.write_text('t,q\n' + ''.join(f'{0.01 * i},{0.1 * i}\n' for i in range(900)))
    for kind in kinds:
        files, commands = KINDS[kind]
        for number, (name, make) in enumerate(files.items()):
            chosen = commands if turn is None else [commands[(number + turn) % len(commands)]]
            with tempfile.TemporaryDirectory(dir=folder) as place:
                path = Path(place) / name
                # in a process of its own: a command would inherit the memory of its parent
                maker = get_context('fork').Process(target=make, args=(path,))
                maker.start()
                maker.join()
                filled = {'{}': str(path), 'BAG': bag, 'TABLE': str(table)}
                for command in chosen:
                    title = ' '.join(x if x == '{}' else Path(x).name for x in command)
                    yield (f'{kind} {name}: {title}', [filled.get(x, x) for x in command])


def main() -> None:
    """Run all cases of the named kinds and add what came of them to the result."""
    parser = make_parser(__doc__, 'robust_harmful', KINDS)
    parser.add_argument('--turn', type=int, help='give each file to one command, from that on')
    parser.add_argument('--again', action='store_true', help='only what had a fault')
    arguments = parser.parse_args()
    rows = read_result(arguments.out).get('cases', {})
    at_fault = {title for title, row in rows.items() if row['faults']}
    with tempfile.TemporaryDirectory() as name:
        for title, command in cases(arguments.names, Path(name), arguments.turn):
            if arguments.again and title not in at_fault:
                continue
            found = measure(command, Path(name))
            if found['faults']:
                print(title, found, flush=True)
            found.pop('said')  # it names folders of one computer
            rows[title] = found
            _write(arguments.out, rows)
    print(len(rows), 'cases')


def _write(path: Path, rows: dict[str, Any]) -> None:
    faults = {title: row['faults'] for title, row in rows.items() if row['faults']}
    write_result(path, {
        'number': len(rows), 'most_seconds': max(row['seconds'] for row in rows.values()),
        'most_megabytes': max(row['megabytes'] for row in rows.values()),
        'faults': faults, 'cases': rows,
    })  # fmt: skip


if __name__ == '__main__':
    main()
