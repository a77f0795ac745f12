"""Worlds with concealed physics, drawn, diagnosed by the command line and scored.

    python -m sgp_proof.concealed.run --tier B --seeds 100:137 [--only pair] [--worlds DIR]
        [--outputs DIR]

The answers lie in another folder than the recordings; `sgp diagnose` is started as a user does,
in a process of its own, and sees the recordings alone. Tier C are the machines of `dirty`, with
many effects at once, which are scored as `several` has it. Results go to
`sgp_proof/results/concealed_<tier>.json`, with `--only pair` to `concealed_<tier>_pair.json`.
With `--outputs` the diagnoses are kept, and worlds of which one is there are only scored. What is
predicted of recordings held out is compared with the true structure fitted to the same recording.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from sgp_proof.concealed import scoring, several
from sgp_proof.concealed.oracle import effort_ratios, improvements
from sgp_proof.concealed.scoring import HELD_OUT, summary
from sgp_proof.result_files import RESULTS, seed_range, write_result

OUTCOME = 'outcome.json'
"""How a diagnosis ended and how long it took, beside what it wrote."""


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--tier', choices=('A', 'B', 'C'), default='A')
    parser.add_argument('--seeds', default='0:40', help='FIRST:LAST+1[,...]')
    parser.add_argument('--only', help='conceal this in every world, as `draw` has it')
    parser.add_argument('--worlds', type=Path, help='worlds drawn before; else they are drawn')
    parser.add_argument('--outputs', type=Path, help='where diagnoses are kept; else nowhere')
    parser.add_argument('--out', type=Path, default=RESULTS, help='folder of the result')
    parser.add_argument('--processes', type=int, default=2)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        worlds = arguments.worlds or Path(folder) / 'worlds'
        outputs = arguments.outputs or Path(folder) / 'out'
        cases = []
        for seeds in arguments.seeds.split(','):
            if arguments.worlds is None:
                _run(*_drawing(arguments), '--seeds', seeds, '--out', str(worlds))
            cases += [f'case_{seed:03d}' for seed in seed_range(seeds)]
        cases = [case for case in cases if (worlds / 'answers' / f'{case}.json').exists()]
        with ThreadPoolExecutor(arguments.processes) as pool:
            scored = list(pool.map(lambda case: scored_case(worlds, case, outputs / case), cases))
    rates = several.summary if arguments.tier == 'C' else summary
    report = {
        'tier': arguments.tier, 'seeds': arguments.seeds, 'only': arguments.only,
        'summary': rates(scored), 'cases': scored,
    }  # fmt: skip
    kind = f'_{arguments.only}' if arguments.only else ''
    write_result(arguments.out / f'concealed_{arguments.tier.lower()}{kind}.json', report)
    print(json.dumps(report['summary'], indent=1))


def _drawing(arguments):
    """Return module and words that draw the worlds of a tier."""
    if arguments.tier == 'C':
        return ('sgp_proof.concealed.dirty',)
    only = ('--only', arguments.only) if arguments.only else ()
    return 'sgp_proof.concealed.draw', '--tier', arguments.tier, *only


def _run(module, *words):
    subprocess.run([sys.executable, '-m', module, *words], check=True)


def scored_case(worlds, case, out):
    """Score the diagnosis of one case, which is made first where none lies in `out`."""
    if not (out / OUTCOME).exists():
        diagnose_case(worlds / 'cases' / case, out)
    outcome = json.loads((out / OUTCOME).read_text(encoding='utf-8'))
    answer = json.loads((worlds / 'answers' / f'{case}.json').read_text(encoding='utf-8'))
    if 'wanted' in answer:
        return _scored_machine(worlds / 'cases' / case, answer, outcome, out)
    truth = np.load(worlds / 'answers' / f'{case}_truth.npz', allow_pickle=False)
    row = {
        'case': case, 'key': answer['key'], 'verdict': answer['verdict'],
        'truth': [[e['effect'], e['joint']] for e in answer['effects']],
        'seconds': outcome['seconds'],
    }  # fmt: skip
    if outcome['status']:
        row |= {'said': 'failed', 'why': outcome['why'], 'right': False, 'found': []}
    else:
        diagnosis = json.loads((out / 'diagnosis.json').read_text(encoding='utf-8'))
        row |= _row(answer, diagnosis)
        row |= improvements(worlds / 'cases' / case, answer, truth, out)
    print(case, answer['key'], '->', row['said'], row['found'],
          'right' if row['right'] else 'WRONG', f'{row["seconds"]:.0f} s', flush=True)  # fmt: skip
    return row


def _scored_machine(sealed, answer, outcome, out):
    """Score the diagnosis of a machine of tier C."""
    row = {'case': answer['case'], 'key': answer['key'], 'wanted': answer['wanted'],
           'verdicts': answer['verdicts'], 'seconds': outcome['seconds']}  # fmt: skip
    if outcome['status']:
        row |= several.failed(answer) | {'why': outcome['why']}
    else:
        diagnosis = json.loads((out / 'diagnosis.json').read_text(encoding='utf-8'))
        row |= several.score(answer, diagnosis)
        row['held_out'] = effort_ratios(sealed, answer, diagnosis)
    print(row['case'], row['key'], '->', row['said'], 'right' if row['right'] else 'WRONG',
          f'{row["seconds"]:.0f} s, missed', row['missed'], 'wrong', row['wrong'],
          flush=True)  # fmt: skip
    return row


def diagnose_case(sealed, out):
    """Diagnose one case where its answer is out of sight, and write how that ended."""
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        folder = shutil.copytree(sealed, Path(scratch) / sealed.name)
        words = ['diagnose', str(folder / 'real.mcap'), '--robot', str(folder / 'robot.urdf'),
                 '--out', str(out)]  # fmt: skip
        for word, name in (('--sim', 'sim'), *(('--test', name) for name in HELD_OUT)):
            if (folder / f'{name}.mcap').exists():
                words += [word, str(folder / f'{name}.mcap')]
        begin = time.perf_counter()
        done = subprocess.run(
            [sys.executable, '-m', 'sgp_ros.cli', *words], capture_output=True, text=True,
            env={**os.environ, 'OPENBLAS_NUM_THREADS': '1'}, check=False,
        )  # fmt: skip
        seconds = round(time.perf_counter() - begin, 1)
    outcome = {
        'status': done.returncode, 'why': done.stderr.strip()[-300:], 'seconds': seconds,
    }  # fmt: skip
    (out / OUTCOME).write_text(json.dumps(outcome) + '\n', encoding='utf-8')


def _row(answer, diagnosis):
    found = scoring.ranked(diagnosis)
    return {
        'said': diagnosis['verdict'],
        'found': [[f['effect'], f['joint'], round(f['probability'], 3)] for f in found],
        'certainty': diagnosis['certainty'],
        'right': scoring.is_right(answer, diagnosis),
        'components': scoring.components(answer, diagnosis),
        'overlap': scoring.overlap(answer, diagnosis),
        'parameters': scoring.parameter_scores(answer, diagnosis),
        'refused': diagnosis['settings']['refused'],
    }


if __name__ == '__main__':
    main()
