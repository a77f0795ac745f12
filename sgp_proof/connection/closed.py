"""Concealed logs of position control: targets and motion alone, no effort, diagnosed and scored.

    python -m sgp_proof.connection.closed --seeds 0:30 [--outputs DIR]

Each world conceals one or two of: gains other than stated, a delay of the target, rotor inertia,
dry friction; or nothing, see `servoed`.
A component is named where effect and joint are right and every number is to 15 % or within three
standard deviations. Results go to `sgp_proof/results/closed_loop.json`.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from sgp_proof.concealed.run import OUTCOME
from sgp_proof.connection.servoed import DELAY, DRY, GAIN, ROTOR, draw_case
from sgp_proof.result_files import RESULTS, seed_range, write_result

_CLOSE, _STD = 0.15, 3.0


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--seeds', default='0:24', help='FIRST:LAST+1[,...]')
    parser.add_argument('--outputs', type=Path, help='where worlds and diagnoses are kept')
    parser.add_argument('--out', type=Path, default=RESULTS, help='folder of the result')
    parser.add_argument('--seconds', type=float, default=math.inf, help='stop after these')
    arguments = parser.parse_args()
    begin = time.monotonic()
    with tempfile.TemporaryDirectory() as scratch:
        folder = arguments.outputs or Path(scratch)
        rows = [
            scored(folder, seed)
            for seeds in arguments.seeds.split(',')
            for seed in seed_range(seeds)
            if time.monotonic() - begin < arguments.seconds or _is_done(folder, seed)
        ]
    report = {'seeds': arguments.seeds, 'summary': summary(rows), 'cases': rows}
    write_result(arguments.out / 'closed_loop.json', report)
    print(json.dumps(report['summary'], indent=1))


def _is_done(folder, seed):
    return (folder / f'case_{seed:03d}' / 'out' / OUTCOME).exists()


def scored(folder, seed):
    """Draw, diagnose and score one world, unless that was done before."""
    case = folder / f'case_{seed:03d}'
    answer_file = case / 'answer.json'
    if not answer_file.exists():
        draw_case(seed, case)
    answer = json.loads(answer_file.read_text(encoding='utf-8'))
    if not (case / 'out' / OUTCOME).exists():
        _diagnose(case)
    outcome = json.loads((case / 'out' / OUTCOME).read_text(encoding='utf-8'))
    row = {'case': case.name, **answer, 'seconds': outcome['seconds']}
    if outcome['status']:
        row |= {'said': 'refused', 'why': outcome['why'], 'named': [False] * len(answer['hidden']),
                'spurious': []}  # fmt: skip
    else:
        diagnosis = json.loads((case / 'out' / 'diagnosis.json').read_text(encoding='utf-8'))
        found = [
            f for f in (*diagnosis['setup'], *diagnosis['findings']) if f['probability'] > 0.5
        ]
        row |= {
            'said': [diagnosis['verdict'], *([f['effect'], f['joint']] for f in found)],
            'named': [any(_is(w, f, answer['driven']) for f in found) for w in answer['hidden']],
            'spurious': [
                [f['effect'], f['joint'], round(f['probability'], 3)] for f in found
                if not any(_is_same(w, f, answer['driven']) for w in answer['hidden'])
            ],
        }  # fmt: skip
    print(row['case'], answer['family'], answer['rate_hz'],
          [(h['effect'], h['joint']) for h in answer['hidden']], '->', row['said'], row['named'],
          f'{row["seconds"]:.0f} s', flush=True)  # fmt: skip
    return row


def _is_same(wanted, found, driven):
    """Return whether effect and joint are those of a component; of one motor, all are it."""
    joints = {wanted['joint'], *(driven if wanted['joint'] == 'all' and len(driven) == 1 else ())}
    return found['effect'] == wanted['effect'] and found['joint'] in joints


def _is(wanted, found, driven):
    if not _is_same(wanted, found, driven):
        return False
    for name, true in wanted['parameters'].items():
        number = found['parameters'].get(name, {})
        off = abs(number.get('value', math.inf) - true)
        size = abs(true - 1.0) if wanted['effect'] == GAIN else abs(true)
        floor = 0.02 if wanted['effect'] == GAIN else 0.0
        if off > max(_CLOSE * size + floor, _STD * (number.get('std') or 0.0)):
            return False
    return True


def summary(rows):
    """Return how many components are named, and in how many worlds something wrong is."""
    components = [(h['effect'], n) for r in rows for h, n in zip(r['hidden'], r['named'],
                                                                 strict=True)]  # fmt: skip
    by_effect = {
        effect: [sum(n for e, n in components if e == effect),
                 sum(e == effect for e, _ in components)]
        for effect in (GAIN, DELAY, ROTOR, DRY)
    }  # fmt: skip
    by_rate = {}
    for r in rows:
        named, count = by_rate.setdefault(f'{r["rate_hz"]:g}', [0, 0])
        by_rate[f'{r["rate_hz"]:g}'] = [named + sum(r['named']), count + len(r['named'])]
    return {
        'worlds': len(rows),
        'all_named': sum(all(r['named']) for r in rows if r['hidden']),
        'with_hidden': sum(bool(r['hidden']) for r in rows),
        'components_named': [sum(n for _, n in components), len(components)],
        'worlds_with_spurious': sum(bool(r['spurious']) for r in rows),
        'refused': sum(r['said'] == 'refused' for r in rows),
        'by_effect': by_effect,
        'by_rate_hz': by_rate,
    }


def _diagnose(case):
    begin = time.perf_counter()
    words = ['diagnose', str(case / 'real.mcap'), '--robot', str(case / 'robot.urdf'),
             '--gains', str(case / 'gains.yaml'), '--out', str(case / 'out')]  # fmt: skip
    done = subprocess.run([sys.executable, '-m', 'sgp_ros.cli', *words], capture_output=True,
                          text=True, check=False)  # fmt: skip
    (case / 'out').mkdir(exist_ok=True)
    outcome = {'status': done.returncode, 'why': done.stderr.strip()[-300:],
               'seconds': round(time.perf_counter() - begin, 1)}  # fmt: skip
    (case / 'out' / OUTCOME).write_text(json.dumps(outcome) + '\n', encoding='utf-8')


if __name__ == '__main__':
    main()
