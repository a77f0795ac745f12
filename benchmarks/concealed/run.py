"""Draw worlds with concealed physics, diagnose them by the command line, unseal, and score.

    python -m benchmarks.concealed.run --tier B --seeds 100:137 [--only pair] [--worlds DIR]

The answers lie in another folder than the recordings; `sgp diagnose` is started as a user does,
in a process of its own, and sees the recordings alone. Results go to
`benchmarks/results/concealed_<tier>.json`, with `--only pair` to `concealed_<tier>_pair.json`.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from benchmarks.concealed import scoring
from benchmarks.environment import environment

RESULTS = Path(__file__).parents[1] / 'results'
HELD_OUT = ('real_test', 'real_far')
_CALM = {'no_mismatch', 'parameters_only'}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--tier', choices=('A', 'B'), default='A')
    parser.add_argument('--seeds', default='0:40', help='FIRST:LAST+1[,...]')
    parser.add_argument('--only', help='conceal this in every world, as `draw` has it')
    parser.add_argument('--worlds', type=Path, help='worlds drawn before; else they are drawn')
    parser.add_argument('--processes', type=int, default=2)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        worlds = arguments.worlds or Path(folder) / 'worlds'
        cases = []
        for seeds in arguments.seeds.split(','):
            if arguments.worlds is None:
                only = ('--only', arguments.only) if arguments.only else ()
                _run('benchmarks.concealed.draw', '--seeds', seeds, '--tier', arguments.tier,
                     '--out', str(worlds), *only)  # fmt: skip
            first, last = map(int, seeds.split(':'))
            cases += [f'case_{seed:03d}' for seed in range(first, last)]
        cases = [case for case in cases if (worlds / 'answers' / f'{case}.json').exists()]
        with ThreadPoolExecutor(arguments.processes) as pool:
            scored = list(pool.map(lambda case: scored_case(worlds, case, Path(folder)), cases))
    report = {
        'schema': 1, 'tier': arguments.tier, 'seeds': arguments.seeds, 'only': arguments.only,
        'environment': environment(), 'summary': summary(scored), 'cases': scored,
    }  # fmt: skip
    kind = f'_{arguments.only}' if arguments.only else ''
    path = RESULTS / f'concealed_{arguments.tier.lower()}{kind}.json'
    path.write_text(json.dumps(report, indent=1, allow_nan=False) + '\n', encoding='utf-8')
    print(json.dumps(report['summary'], indent=1))


def _run(module, *words):
    subprocess.run([sys.executable, '-m', module, *words], check=True)


def scored_case(worlds, case, scratch):
    """Diagnose one case where its answer is out of sight, then score it."""
    sealed, folder, out = worlds / 'cases' / case, scratch / 'open' / case, scratch / 'out' / case
    shutil.copytree(sealed, folder)
    words = ['diagnose', str(folder / 'real.mcap'), '--robot', str(folder / 'robot.urdf'),
             '--sim', str(folder / 'sim.mcap'), '--out', str(out)]  # fmt: skip
    for name in HELD_OUT:
        words += ['--test', str(folder / f'{name}.mcap')]
    begin = time.perf_counter()
    done = subprocess.run(
        [sys.executable, '-m', 'sgp_ros.cli', *words], capture_output=True, text=True,
        env={**os.environ, 'OPENBLAS_NUM_THREADS': '1'}, check=False,
    )  # fmt: skip
    seconds = time.perf_counter() - begin
    shutil.rmtree(folder)
    answer = json.loads((worlds / 'answers' / f'{case}.json').read_text(encoding='utf-8'))
    truth = np.load(worlds / 'answers' / f'{case}_truth.npz')
    row = {
        'case': case, 'key': answer['key'], 'verdict': answer['verdict'],
        'truth': [[e['effect'], e['joint']] for e in answer['effects']],
        'seconds': round(seconds, 1),
    }  # fmt: skip
    if done.returncode:
        row |= {'said': 'failed', 'why': done.stderr.strip()[-300:], 'right': False, 'found': []}
    else:
        diagnosis = json.loads((out / 'diagnosis.json').read_text(encoding='utf-8'))
        row |= _row(answer, diagnosis, out, truth)
    print(case, answer['key'], '->', row['said'], row['found'],
          'right' if row['right'] else 'WRONG', f'{seconds:.0f} s', flush=True)  # fmt: skip
    return row


def _row(answer, diagnosis, out, truth):
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
        'improvement': {s: scoring.improvement(answer, out, truth, s) for s in HELD_OUT},
    }


def summary(rows):
    """Return the rates, each with its 95 % interval (Wilson 1927), and what was confused."""
    known = [r for r in rows if r['verdict'] == 'missing_physics']
    singles = [r for r in known if len(r['truth']) == 1]
    pairs = [r for r in known if len(r['truth']) == 2]
    calm = [r for r in rows if r['verdict'] in _CALM]
    unknown = [r for r in rows if r['verdict'] == 'unexplained']
    errors = [p['error'] for r in rows for p in r.get('parameters', [])]
    covered = [p['covered'] for r in rows for p in r.get('parameters', [])
               if p['covered'] is not None]  # fmt: skip
    overlaps = [r['overlap'] for r in rows if r.get('overlap') is not None]
    confused = Counter(
        f'{"+".join(e for e, _ in r["truth"]) or r["verdict"]} -> '
        f'{"+".join(f[0] for f in r["found"]) or r["said"]}'
        for r in rows if not r['right']
    )  # fmt: skip
    return {
        'worlds': len(rows),
        'named_single': _rate(r['right'] for r in singles),
        'named_pair_top': _rate(r['right'] for r in pairs),
        'components_of_pairs': _rate(
            hit for r in pairs for hit in _hits(r.get('components', 0), 2)
        ),
        'false_alarms': _rate(r['said'] in {'missing_physics', 'unexplained'} and not r['right']
                              for r in calm),
        'unknown_called_unexplained': _rate(r['right'] for r in unknown),
        'failed': sum(r['said'] == 'failed' for r in rows),
        'overlap_median': _median(overlaps),
        'parameter_error_median': _median(errors),
        'within_two_std': _rate(covered),
        'improvement_median': {
            s: _median([r['improvement'][s] for r in rows
                        if r.get('improvement', {}).get(s) is not None]) for s in HELD_OUT
        },
        'probability': _reliability(rows),
        'seconds_median': _median([r['seconds'] for r in rows]),
        'confused': dict(confused),
    }  # fmt: skip


def _hits(count, total):
    return [True] * count + [False] * (total - count)


def _median(values):
    return float(np.median(values)) if len(values) else None


def _rate(flags):
    """Return share, number and 95 % interval."""
    flags = [bool(f) for f in flags]
    n = len(flags)
    if not n:
        return {'share': None, 'n': 0}
    p, z = sum(flags) / n, 1.959964
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n)) / (1 + z * z / n)
    return {'share': round(p, 4), 'n': n, 'low': round(middle - half, 4),
            'high': round(middle + half, 4)}  # fmt: skip


def _reliability(rows):
    """Return, per band of stated certainty, how often the diagnosis was right."""
    bands = [(0.0, 0.5), (0.5, 0.8), (0.8, 0.95), (0.95, 1.0)]
    stated = [(r['certainty'], r['right']) for r in rows if r.get('certainty') is not None]
    return [
        {'from': a, 'to': b, **_rate(right for p, right in stated if a <= p < b or p == b == 1.0)}
        for a, b in bands
    ]


if __name__ == '__main__':
    main()
