"""Worlds in which a robot is connected wrongly, diagnosed by the command line and scored.

    python -m sgp_proof.connection.run --seeds 0:30 [--outputs DIR]

An answer counts as right where error, joint and channels are named and every number is right to a
tenth of the error; as equivalent where nothing wrong is asserted; else, said with more than .5, as
wrong. Without an error of the connection, right is to assert none. Results go to
`sgp_proof/results/connection.json`.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from pathlib import Path

from sgp_proof.concealed.run import OUTCOME, diagnose_case
from sgp_proof.connection.draw import TRIES, draw_case
from sgp_proof.result_files import RESULTS, seed_range, write_result

_TOLERANCE = 0.1


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--seeds', default='0:20', help='FIRST:LAST+1[,...]')
    parser.add_argument('--outputs', type=Path, help='where worlds and diagnoses are kept')
    parser.add_argument('--out', type=Path, default=RESULTS, help='folder of the result')
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = arguments.outputs or Path(scratch)
        rows = [
            row
            for seeds in arguments.seeds.split(',')
            for seed in seed_range(seeds)
            if (row := scored(folder, seed)) is not None
        ]
    report = {'seeds': arguments.seeds, 'summary': summary(rows), 'cases': rows}
    write_result(arguments.out / 'connection.json', report)
    print(json.dumps(report['summary'], indent=1))


def scored(folder, seed):
    """Draw, diagnose and score one world, unless that was done before; None without a world."""
    sealed, out = folder / 'cases' / f'case_{seed:03d}', folder / 'diagnoses' / f'case_{seed:03d}'
    answer_file = folder / 'answers' / f'case_{seed:03d}.json'
    if not answer_file.exists() and not draw_case(seed, sealed, answer_file):
        print(f'seed {seed}: no suitable world in {TRIES}', file=sys.stderr)
        return None
    answer = json.loads(answer_file.read_text(encoding='utf-8'))
    if not (out / OUTCOME).exists():
        diagnose_case(sealed, out)
    outcome = json.loads((out / OUTCOME).read_text(encoding='utf-8'))
    row = {'case': sealed.name, **answer, 'seconds': outcome['seconds']}
    if outcome['status']:
        row |= {'said': 'refused', 'why': outcome['why'], 'outcome': 'equivalent'}
    else:
        diagnosis = json.loads((out / 'diagnosis.json').read_text(encoding='utf-8'))
        row |= {'said': said(diagnosis), 'outcome': judged(answer, diagnosis)}
    print(row['case'], answer['robot'], answer['setup'], answer['physics'], '->', row['said'],
          row['outcome'], f'{row["seconds"]:.0f} s', flush=True)  # fmt: skip
    return row


def said(diagnosis):
    """Return what is asserted."""
    found = [*diagnosis.get('setup', []), *diagnosis['findings']]
    return diagnosis['verdict'], [[f['effect'], f['joint'], f['probability']] for f in found]


def judged(answer, diagnosis):
    """Return `right`, `equivalent` or `wrong`."""
    setup = [f for f in diagnosis.get('setup', []) if f['probability'] > 0.5]
    wanted = answer['setup']
    if len(setup) == len(wanted) and all(any(is_same(w, f) for f in setup) for w in wanted):
        return 'right'
    rest = [f for f in setup if not any(is_same(w, f) for w in wanted)]
    return 'wrong' if rest else 'equivalent'


def is_same(wanted, found):
    """Return whether an error is named with its joint, channels and numbers."""
    if (wanted['effect'], wanted['joint']) != (found['effect'], found['joint']):
        return False
    for name, true in wanted['parameters'].items():
        value = found['parameters'].get(name, {}).get('value')
        if isinstance(true, str):
            if value != true:
                return False
            continue
        neutral = 1.0 if name == 'scale' else 0.0
        if value is None or abs(value - true) > _TOLERANCE * abs(true - neutral) + 0.01:
            return False
    return True


def summary(rows):
    """Return the shares of the outcomes, with and without an error of the connection."""
    with_error = [r for r in rows if r['setup']]
    without = [r for r in rows if not r['setup']]
    share = lambda group, outcome: sum(r['outcome'] == outcome for r in group)  # noqa: E731
    return {
        'worlds': len(rows),
        'with_error': {k: share(with_error, k) for k in ('right', 'equivalent', 'wrong')},
        'without_error': {k: share(without, k) for k in ('right', 'equivalent', 'wrong')},
    }


if __name__ == '__main__':
    main()
