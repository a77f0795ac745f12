"""Numbers of commands before and after a change of the code, compared one by one.

    python -m sgp_proof.unchanged OUT [--before OLD] [--cases FOLDER] [--only PART ...]

Runs a few commands with the code that is imported and leaves what they write in OUT: diagnoses of
cases with known answers, the replay of a recorded wheel, what is identified of a real axis, and
the toy experiment on two seeds. With `--before`, an OUT of an earlier version, it prints each
value that differs with its relative difference; the status is 1 if any does. Whoever changes code
that should change no number runs it twice: before, and after.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from sgp_proof.result_files import ROOT
from sgp_ros.cli import main as sgp

SHARED = ROOT.parent / 'shared'
PASSING = ('seconds', 'versions', 'timing', 'environment')
"""Keys that differ from run to run, and say nothing of the numbers."""
HELD_OUT = ('real_test.mcap', 'real_far.mcap')
CHOICES = ('practice', 'replay_wheel', 'identify_emps', 'toy')


def runs(out: Path, cases: Path) -> Iterator[tuple[str, Path, list[str]]]:
    """Yield part, folder of the results and words of each command."""
    for case in sorted(cases.glob('case_*')):
        folder = out / 'practice' / case.name
        tests = [f'--test={case / name}' for name in HELD_OUT]
        yield 'practice', folder, [
            'diagnose', str(case / 'real.mcap'), '--robot', str(case / 'robot.urdf'),
            '--sim', str(case / 'sim.mcap'), *tests,
        ]  # fmt: skip
    wheel = ['replay', str(ROOT / 'bags' / 'reaction_wheel.mcap'), '--robot', 'reaction_wheel']
    yield 'replay_wheel', out / 'replay_wheel', wheel
    axis = ['import', str(SHARED / 'data/emps/emps_id.csv')]
    yield 'identify_emps', out / 'emps', [*axis, '--map', str(ROOT / 'config/import/emps.yaml')]
    identify = ['identify', str(out / 'emps' / 'emps_id.mcap'), '--robot', 'linear_axis']
    yield 'identify_emps', out / 'identify_emps', identify
    yield 'toy', out / 'toy', ['reproduce', 'toy', '--seeds', '2']


def values(path: Path) -> dict[str, Any]:
    """Return the leaves of a JSON file by their path, without what passes."""
    found: dict[str, Any] = {}

    def visit(node: Any, name: str) -> None:
        children: list[tuple[Any, Any]] = []
        if isinstance(node, dict):
            children = [(k, v) for k, v in node.items() if k not in PASSING]
        elif isinstance(node, list):
            children = list(enumerate(node))
        else:
            found[name] = node
        for key, child in children:
            visit(child, f'{name}/{key}')

    visit(json.loads(path.read_text(encoding='utf-8')), '')
    return found


def differences(before: Path, after: Path, tolerance: float) -> list[str]:
    """Return a line for each value of two folders that is not the same, and for each file.

    Args:
        before: folder of JSON files.
        after: the same, of the newer version.
        tolerance: relative difference of numbers up to which they count as the same.
    """
    lines = []
    names = {p.relative_to(f) for f in (before, after) for p in f.rglob('*.json')}
    for name in sorted(names):
        one, other = before / name, after / name
        if not (one.exists() and other.exists()):
            lines.append(f'{name}: only {"before" if one.exists() else "after"}')
            continue
        old, new = values(one), values(other)
        lines += [
            f'{name} {key}: {line}'
            for key in sorted(old.keys() | new.keys())
            if (line := _difference(old.get(key, 'absent'), new.get(key, 'absent'), tolerance))
        ]
    return lines


def _difference(old: Any, new: Any, tolerance: float) -> str:
    if old == new:
        return ''
    if all(isinstance(x, (int, float)) and not isinstance(x, bool) for x in (old, new)):
        relative = abs(new - old) / max(abs(old), abs(new))
        return f'{old:.9g} -> {new:.9g} ({relative:.1e})' if relative > tolerance else ''
    return f'{str(old)[:60]!r} -> {str(new)[:60]!r}'


def main() -> int:
    """Run the commands, compare if asked to, and return the status."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').split('\n')[0])
    parser.add_argument('out', type=Path, help='folder of the results')
    parser.add_argument('--before', type=Path, help='an earlier folder to compare with')
    parser.add_argument('--cases', type=Path, default=SHARED / 'practice' / 'cases')
    parser.add_argument('--only', nargs='+', choices=CHOICES, default=CHOICES)
    parser.add_argument('--tolerance', type=float, default=0.0, help='relative (default: none)')
    arguments = parser.parse_args()
    folders = []
    for part, folder, words in runs(arguments.out, arguments.cases):
        if part in arguments.only:
            folders.append(folder)
            if sgp([*words, '--out', str(folder)]):
                sys.exit(f'sgp {" ".join(words)} failed')
    if arguments.before is None:
        return 0
    lines = [
        f'{folder.relative_to(arguments.out)}/{line}'
        for folder in folders
        for line in differences(
            arguments.before / folder.relative_to(arguments.out), folder, arguments.tolerance
        )
    ]
    print('\n'.join(lines) or 'no number differs')
    return 1 if lines else 0


if __name__ == '__main__':
    sys.exit(main())
