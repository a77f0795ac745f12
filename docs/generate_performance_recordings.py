"""Write docs/performance_recordings.md from the measured results.

`python docs/generate_performance_recordings.py [bench.json]`: the benchmarks of a file that is
given take the place of the committed ones, with the machine they ran on.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
TARGET = Path(__file__).parent / 'performance_recordings.md'
RESULT = ROOT / 'sgp_proof' / 'results' / 'performance_recordings.json'
PAGE = (Path(__file__).parent / 'templates' / 'performance_recordings.txt').read_text('utf-8')
COMMANDS = 'diagnose', 'identify'
TARGETS = (('diagnose', 3, 3.0), ('diagnose', 7, 8.0))
"""Command, joints, and processor seconds that 60 s should take at most."""


def _number(x, digits=3):
    return f'{x:.{digits}g}' if isinstance(x, float) else str(x)


def _table(rows):
    head = ('joints', 'seconds', 'processor [s]', 'wall [s]', 'peak memory [MB]',
            'exponent in length', 'exponent in joints')  # fmt: skip
    lines = [f'| {" | ".join(head)} |', '|---' * len(head) + '|']
    names = ('joints', 'seconds', 'processor_s', 'wall_s', 'peak_megabytes', 'exponent_seconds',
             'exponent_joints')  # fmt: skip
    return '\n'.join(
        [*lines, *(f'| {" | ".join(_number(row[name]) for name in names)} |' for row in rows)]
    )


def _targets(result):
    lines = []
    for command, joints, most in TARGETS:
        for row in result.get(command, []):
            if (row['joints'], row['seconds']) == (joints, 60.0):
                word = 'met' if row['processor_s'] <= most else '**missed**'
                lines.append(
                    f'* `sgp {command}` of 60 s with {joints} joints in {most:g} s of processor: '
                    f'{word} ({_number(row["processor_s"])}).'
                )
    return '\n'.join(lines)


def text():
    """Return the page."""
    result = json.loads(RESULT.read_text(encoding='utf-8'))
    tables = [f'## sgp {name}\n{_table(result[name])}' for name in COMMANDS if name in result]
    return PAGE.format(
        machine=', '.join(f'{k} {v}' for k, v in result['machine'].items()),
        tables='\n\n'.join(tables), targets=_targets(result),
    )  # fmt: skip


def main():
    if len(sys.argv) > 1:
        given = json.loads(Path(sys.argv[1]).read_text(encoding='utf-8'))
        known = json.loads(RESULT.read_text(encoding='utf-8')) if RESULT.exists() else {}
        chosen = {name: given[name] for name in COMMANDS if name in given}
        known |= {'schema': given['schema'], 'machine': given['machine'], **chosen}
        RESULT.write_text(json.dumps(known, indent=1) + '\n', encoding='utf-8')
    TARGET.write_text(text(), encoding='utf-8')


if __name__ == '__main__':
    main()
