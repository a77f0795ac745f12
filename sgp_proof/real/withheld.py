"""A real machine with the listed answer withheld from the list: what does the search say?

    python -m sgp_proof.real.withheld out/learn.mcap --test out/test.mcap --name tflex
        --robot config/robots/revolute_axis.urdf --without spring,cogging,end_stop,hysteresis

The recordings are made as docs/real_machines says. The effects are taken from the catalogue of
this process alone. Writes `sgp_proof/results/withheld.json`; with `--outputs` it keeps the
diagnosis, and one that is there is only read.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

from sgp_proof.result_files import RESULTS, write_result
from sgp_ros.cli import main as sgp
from sgp_ros.physics.catalogue import EFFECTS

TARGET = RESULTS / 'withheld.json'
_FORMULAS = 3


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('bag')
    parser.add_argument('--name', required=True, help='of the machine')
    parser.add_argument('--robot', required=True)
    parser.add_argument('--test', required=True)
    parser.add_argument('--without', required=True, help='effects that are withheld')
    parser.add_argument('--outputs', type=Path, help='where the diagnosis is kept')
    arguments = parser.parse_args()
    withheld = arguments.without.split(',')
    for name in withheld:
        EFFECTS.pop(name)
    with tempfile.TemporaryDirectory() as scratch:
        out = arguments.outputs or Path(scratch)
        words = ['diagnose', arguments.bag, '--robot', arguments.robot, '--test', arguments.test]
        if not (out / 'diagnosis.json').exists() and sgp([*words, '--out', str(out)]):
            raise SystemExit('no diagnosis')
        found = json.loads((out / 'diagnosis.json').read_text(encoding='utf-8'))
    known = {}
    if TARGET.exists():
        known = json.loads(TARGET.read_text(encoding='utf-8'))['machines']
    known[arguments.name] = summary(found, withheld)
    write_result(TARGET, {'machines': known})
    print(json.dumps(known[arguments.name], indent=1))


def summary(found, withheld):
    """Return what a diagnosis says, as far as the page needs it."""
    return {
        'withheld': list(withheld),
        'verdict': found['verdict'],
        'findings': [[f['effect'], f['joint'], f['probability']] for f in found['findings']],
        'nmse_after': {
            part: proof['nmse_after'] for part, proof in found['fit'].items()
            if isinstance(proof, dict) and 'nmse_after' in proof
        },
        'searches': [
            {
                'joint': s['joint'], 'words': s['words'], 'is_asserted': s['is_asserted'],
                'why_not': s['why_not'], 'left': s['left'], 'left_by_listed': s['left_by_listed'],
                'formulas': [
                    {'formula': f['formula'], 'left': f['left']} for f in s['formulas'][:_FORMULAS]
                ],
            }
            for s in found['law_search']
        ],
    }  # fmt: skip


if __name__ == '__main__':
    main()
