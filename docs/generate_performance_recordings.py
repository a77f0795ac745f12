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
TARGETS = (
    ('diagnose', 3, 60.0, 3.0), ('diagnose', 7, 60.0, 8.0), ('diagnose', 7, 900.0, 60.0),
    ('identify', 7, 60.0, 15.0),
)  # fmt: skip
"""Command, joints, seconds, and processor seconds that it should take at most."""
LONG, MOST_MEGABYTES = ('diagnose', 7, 900.0), 1024.0
MOST_GROWTH = {'seconds': 1.0, 'joints': 2.0}
RIVALS = (('one', 'one unknown: that friction'), ('all', 'eight unknowns'))


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


def _word(is_met):
    return 'met' if is_met else '**missed**'


def _targets(result):
    lines = []
    for command, joints, seconds, most in TARGETS:
        for row in result.get(command, []):
            if (row['joints'], row['seconds']) == (joints, seconds):
                lines.append(
                    f'* `sgp {command}` of {seconds:g} s with {joints} joints in {most:g} s of '
                    f'processor time: {_word(row["processor_s"] <= most)} '
                    f'({_number(row["processor_s"])}).'
                )
                if (command, joints, seconds) == LONG:
                    found = row['peak_megabytes']
                    lines.append(
                        f'* the same within {MOST_MEGABYTES:g} MB of memory: '
                        f'{_word(found <= MOST_MEGABYTES)} ({_number(found)}).'
                    )
    for size, most in MOST_GROWTH.items():
        for command in COMMANDS:
            rows = [row for row in result.get(command, []) if row[f'exponent_{size}'] != '']
            found = [row[f'exponent_{size}'] for row in rows]
            if found:
                lines.append(
                    f'* time of `sgp {command}` at most as {size}^{most:g}: '
                    f'{_word(max(found) <= most)} ({", ".join(map(_number, found))}).'
                )
    return '\n'.join(lines)


def _stages(result):
    """Return the stages of each command as one table, a column each."""
    rows = result['stages']
    heads = list(dict.fromkeys((r['command'], r['joints'], r['seconds']) for r in rows))
    names = list(dict.fromkeys(r['stage'] for r in rows))
    names.remove('the rest')
    cells = {(r['command'], r['joints'], r['seconds'], r['stage']): r['processor_s'] for r in rows}
    lines = [
        f'| stage | {" | ".join(f"{c}, {j} joints, {s:g} s" for c, j, s in heads)} |',
        '|---' * (1 + len(heads)) + '|',
    ]
    for name in (*names, 'the rest'):
        values = (cells.get((*head, name)) for head in heads)
        found = ('' if x is None else f'{x:.2f}' for x in values)
        lines.append(f'| {name} | {" | ".join(found)} |')
    return '\n'.join(lines)


def _changes(result):
    """Return the stages of commands before and after the last changes, a command after the other."""
    lines = ['| command | stage | before [s] | after [s] |', '|---|---|---|---|']
    for row in result['changes']:
        size = f'{row["command"]}, {row["joints"]} joints, {row["seconds"]:g} s'
        lines.append(f'| {size} | {row["stage"]} | {row["before_s"]:.2f} | {row["after_s"]:.2f} |')
    return '\n'.join(lines)


def _rivals(result):
    """Return what mujoco.sysid took for a recording, beside the diagnosis of the same one."""
    for row in result['diagnose']:
        if row.get('sysid_one_s'):
            lines = ['| | processor [s] | level of friction off by [%] |', '|---|---|---|']
            lines += [
                f'| `mujoco.sysid`, {words} | {_number(row[f"sysid_{name}_s"])} | '
                f'{_number(row[f"sysid_{name}_off_percent"], 2)} |'
                for name, words in RIVALS
            ]
            lines.append(
                f'| `sgp diagnose`, given no parameters: it named {row["named"].replace("_", " ")} | '
                f'{_number(row["processor_s"])} | {_number(row["off_percent"], 2)} |'
            )
            return '\n'.join(lines)
    return 'Not installed where this was measured.'


def text():
    """Return the page."""
    result = json.loads(RESULT.read_text(encoding='utf-8'))
    tables = [f'## sgp {name}\n{_table(result[name])}' for name in COMMANDS if name in result]
    return PAGE.format(
        machine=', '.join(f'{k} {v}' for k, v in result['machine'].items()),
        remark=result.get('remark', ''),
        tables='\n\n'.join(tables), targets=_targets(result), stages=_stages(result),
        changes=_changes(result), rivals=_rivals(result),
    )  # fmt: skip


def main():
    if len(sys.argv) > 1:
        given = json.loads(Path(sys.argv[1]).read_text(encoding='utf-8'))
        known = json.loads(RESULT.read_text(encoding='utf-8')) if RESULT.exists() else {}
        chosen = {name: given[name] for name in (*COMMANDS, 'stages') if name in given}
        known |= {'schema': given['schema'], 'machine': given['machine'], **chosen}
        known['remark'] = given.get('remark', '')
        RESULT.write_text(json.dumps(known, indent=1) + '\n', encoding='utf-8')
    TARGET.write_text(text(), encoding='utf-8')


if __name__ == '__main__':
    main()
