"""Worlds without any law: what is asserted there is wrong.

    python -m sgp_proof.concealed.no_law --tier B --numbers 700:704 [--worlds DIR]

For each number a robot as the nominal one behind noisy sensors, one with wrong bodies, and one
with a force that wanders in time. They are drawn as all worlds are, diagnosed from one recording
alone, and what is asserted beside bodies is counted: laws of the search, and effects of the list.
Goes to `sgp_proof/results/no_law.json`, world by world, so that a run may be stopped.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

from sgp_proof.concealed.draw import NOTHING, PARAMETERS, UNLISTED, draw_case
from sgp_proof.concealed.run import OUTCOME, diagnose_case
from sgp_proof.concealed.scoring import HELD_OUT, rate
from sgp_proof.concealed.unlisted import FAMILIES
from sgp_proof.result_files import RESULTS, seed_range, write_result

WALK = 'walk'
KINDS = (NOTHING, PARAMETERS, WALK)
LEAST = 0.5
"""Probability from which a finding is asserted."""


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--tier', choices=('A', 'B'), default='B')
    parser.add_argument('--numbers', default='700:704', help='FIRST:LAST+1')
    parser.add_argument('--worlds', type=Path, help='where worlds and diagnoses are kept')
    arguments = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for number in seed_range(arguments.numbers):
            for kind in KINDS:
                place = (arguments.worlds or Path(folder)) / kind
                rows.append(diagnosed(place, number, kind, arguments.tier))
                print(json.dumps(rows[-1]), flush=True)
                report = {'tier': arguments.tier, 'numbers': arguments.numbers}
                write_result(
                    RESULTS / 'no_law.json', report | {'summary': summary(rows), 'worlds': rows}
                )


def diagnosed(folder, number, kind, tier):
    """Return what a diagnosis asserts in one world, which is drawn and diagnosed if need be."""
    seed = number if kind != WALK else len(FAMILIES) * number + list(FAMILIES).index(WALK)
    case = f'case_{seed:03d}'
    for name in ('cases', 'answers'):
        (folder / name).mkdir(parents=True, exist_ok=True)
    if not (folder / 'cases' / case).exists():
        draw_case(seed, tier, UNLISTED if kind == WALK else kind, folder)
    for other in ('sim', *HELD_OUT):
        (folder / 'cases' / case / f'{other}.mcap').unlink(missing_ok=True)
    out = folder / 'out' / case
    if not (out / OUTCOME).exists():
        diagnose_case(folder / 'cases' / case, out)
    return said(kind, case, json.loads((out / 'diagnosis.json').read_text(encoding='utf-8')))


def said(kind, case, diagnosis):
    """Return what a diagnosis asserts."""
    asserted = [f for f in diagnosis['findings'] if f['probability'] >= LEAST]
    return {
        'kind': kind, 'case': case, 'verdict': diagnosis['verdict'],
        'searched': len(diagnosis.get('law_search', [])),
        'laws': [f['formula'] for f in asserted if f['effect'] == 'law'],
        'listed': [[f['effect'], f['joint']] for f in asserted
                   if f['effect'] not in {'law', 'unknown'}],
    }  # fmt: skip


def summary(rows):
    """Return the rates of wrong laws and of wrong names of the list, by kind and over all."""
    found = {}
    for kind in (*KINDS, 'all'):
        some = [r for r in rows if kind in {r['kind'], 'all'}]
        found[kind] = {
            'wrong_law': rate(r['laws'] for r in some),
            'wrong_name': rate(r['laws'] or r['listed'] for r in some),
        }
    return found


if __name__ == '__main__':
    main()
