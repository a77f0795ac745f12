"""Write docs/performance.md from the measured results.

`python docs/generate_performance.py [bench.json]`: the benchmarks of a file that is given take the
place of the committed ones, with the machine they ran on.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
TARGET = Path(__file__).parent / 'performance.md'
RESULT = ROOT / 'sgp_proof' / 'results' / 'performance.json'
PAGE = (Path(__file__).parent / 'templates' / 'performance.txt').read_text(encoding='utf-8')
FLOORS = (
    ('n = 250', lambda r: r['n'] == 250, 3.0),
    ('n = 1000, 1 output', lambda r: r['n'] == 1000 and r['outputs'] == 1, 1.5),
    ('n = 1000, 7 outputs', lambda r: r['n'] == 1000 and r['outputs'] == 7, 1.8),
)
SKLEARN, EVALUATION = 20.0, 3.0
REPLAY_S = 5.0
EVIDENCE_TOLERANCE = 0.1
"""Nats by which an optimiser may stop short of the same maximum."""


def _table(head, rows):
    lines = [f'| {" | ".join(head)} |', '|---' * len(head) + '|']
    return '\n'.join([*lines, *(f'| {" | ".join(row)} |' for row in rows)])


def _number(x, digits=3):
    return 'not installed' if x is None else f'{x:.{digits}g}'


def _steps(rows):
    head = (
        'n', 'outputs', 'inputs', 'step [ms]', 'wall [ms]', 'floor [ms]', 'times floor',
        'faster than scikit-learn', 'calls', 'allocations', 'temporaries [kB]',
    )  # fmt: skip
    return _table(head, [
        (
            str(r['n']), str(r['outputs']), str(r['inputs']), _number(r['step_ms']),
            _number(r['wall_ms']), _number(r['floor_ms']), _number(r['times_floor']),
            _number(r['times_faster_sklearn']), str(r['calls']),
            str(r['allocations']), _number(r['temporary_kilobytes']),
        )
        for r in rows
    ])  # fmt: skip


def _parts(rows):
    names = ('kernel', 'solve', 'rotate', 'features', 'rest')
    head = (
        'n',
        'outputs',
        'inputs',
        'covariances [ms]',
        'solve [ms]',
        'rotations [ms]',
        'features [ms]',
        'rest [ms]',
    )
    return _table(head, [
        (str(r['n']), str(r['outputs']), str(r['inputs']), *(_number(r[f'{x}_ms']) for x in names))
        for r in rows
    ])  # fmt: skip


def _judged(what, values, is_met):
    """Return one line on a target: met, or missed with the values."""
    if not values or None in values:
        return f'* {what}: not measured.'
    worst = ', '.join(_number(x) for x in values)
    verdict = 'met' if all(is_met(x) for x in values) else '**missed**'
    return f'* {what}: {verdict} ({worst}).'


def _step_targets(rows):
    floors = [
        _judged(f'at most {most:g} times the floor at {what}',
                [r['times_floor'] for r in rows if is_meant(r)], lambda x, y=most: x <= y)
        for what, is_meant, most in FLOORS
    ]  # fmt: skip
    return '\n'.join([
        'Targets, rows in the order of the table:\n',
        *floors,
        _judged(f'at least {SKLEARN:g} times faster than scikit-learn',
                [r['times_faster_sklearn'] for r in rows], lambda x: x >= SKLEARN),
        _judged('no allocation that stays', [r['allocations'] for r in rows], lambda x: x == 0),
    ])  # fmt: skip


def _before(rows):
    head = ('n', 'outputs', 'inputs', 'step [ms]', 'floor [ms]', 'times floor', 'GPyTorch [ms]',
            'faster than GPyTorch')  # fmt: skip
    names = ('step_ms', 'floor_ms', 'times_floor', 'gpytorch_ms', 'times_faster_gpytorch')
    return _table(head, [
        (str(r['n']), str(r['outputs']), str(r['inputs']), *(_number(r[x]) for x in names))
        for r in rows
    ])  # fmt: skip


def _replays(rows):
    head = (
        'robot', 'joints', 'coefficients', 'rate [Hz]', 'length [s]', 'equations',
        'processor [s]', 'wall [s]', 'state [us]', 'equation [ms]', 'calls a state',
        'calls an equation', 'one fit [s]',
    )  # fmt: skip
    names = ('processor_s', 'wall_s', 'state_us', 'equation_ms')
    return _table(head, [
        (
            r['robot'], *(_number(r[x], 6) for x in (
                'joints', 'coefficients', 'rate_hz', 'seconds', 'equations')),
            *(_number(r[x]) for x in names), str(r['state_calls']), str(r['equation_calls']),
            _number(r['fit_s']),
        )
        for r in rows
    ])  # fmt: skip


def _replay_target(rows):
    arms = [r['processor_s'] for r in rows if r['joints'] == 7]
    return _judged(
        f'60 s of 7 joints in under {REPLAY_S:g} s of processor time, without fits and report',
        arms, lambda x: x < REPLAY_S,
    )  # fmt: skip


def _machine(found):
    return ', '.join(f'{name} {value}' for name, value in found.items())


def _evaluations(rows):
    head = ('world', 'ours [ms]', 'GPyTorch [ms]', 'scikit-learn [ms]', 'faster', 'faster')
    return _table(head, [
        (f'{r["world"]}, {r["seed"]}', *(_number(r[key]) for key in (
            'evaluation_ms', 'gpytorch_ms', 'sklearn_ms', 'times_faster_gpytorch',
            'times_faster_sklearn',
        )))
        for r in rows
    ])  # fmt: skip


def _fits(rows):
    names = ('', 'gpytorch_', 'sklearn_')
    head = ('world', *(f'{x} {y}' for x in ('ours', 'GPyTorch', 'scikit-learn')
                       for y in ('[nat]', '[s]')))  # fmt: skip
    return _table(head, [
        (f'{r["world"]}, {r["seed"]}', *(
            _number(r[f'{name}fit_{key}'], digits)
            for name in names for key, digits in (('log_evidence', 7), ('s', 3))
        ))
        for r in rows
    ])  # fmt: skip


def _evidence_targets(rows):
    lines = [
        _judged(f'at least {EVALUATION:g} times faster than {label}',
                [r[f'times_faster_{name}'] for r in rows], lambda x: x >= EVALUATION)
        for name, label in (('gpytorch', 'GPyTorch'), ('sklearn', 'scikit-learn'))
    ]  # fmt: skip
    gains = [
        None if r[f'{name}_fit_log_evidence'] is None
        else r['fit_log_evidence'] - r[f'{name}_fit_log_evidence']
        for r in rows for name in ('gpytorch', 'sklearn')
    ]  # fmt: skip
    what = f'an evidence at least as high, to {EVIDENCE_TOLERANCE:g} nat'
    what = f'{what} (ours less theirs, world by world)'
    return '\n'.join([
        'Targets:\n', *lines, _judged(what, gains, lambda x: x >= -EVIDENCE_TOLERANCE)
    ])  # fmt: skip


def _take(path):
    committed = json.loads(RESULT.read_text(encoding='utf-8'))
    given = json.loads(path.read_text(encoding='utf-8'))
    for name in set(given) - {'schema', 'machine'}:
        committed[name] = given[name]
        committed['machines'][name] = given['machine']
    RESULT.write_text(json.dumps(committed, indent=1, allow_nan=False) + '\n', encoding='utf-8')


def text():
    """Return the page."""
    result = json.loads(RESULT.read_text(encoding='utf-8'))
    steps, evidence, machines = result['step'], result['evidence'], result['machines']
    differences = [
        r[f'{name}_difference'] for r in evidence for name in ('gpytorch', 'sklearn')
        if r[f'{name}_difference'] is not None
    ]  # fmt: skip
    return PAGE.format(
        machine=_machine(machines['step']),
        machine_before=_machine(machines['before']),
        before=_before(result['before']),
        replays=_replays(result['replay']),
        replay_target=_replay_target(result['replay']),
        per_output=steps[0]['coefficients'] // steps[0]['outputs'],
        steps=_steps(steps),
        parts=_parts(steps),
        step_targets=_step_targets(steps),
        samples=evidence[0]['n'],
        inputs=evidence[0]['inputs'],
        lapack=_number(evidence[0]['lapack_ms']),
        evaluation=_number(evidence[0]['evaluation_ms']),
        difference=_number(max(differences, default=None), 2),
        evaluations=_evaluations(evidence),
        fits=_fits(evidence),
        evidence_targets=_evidence_targets(evidence),
    )


if __name__ == '__main__':
    if len(sys.argv) > 1:
        _take(Path(sys.argv[1]))
    TARGET.write_text(text(), encoding='utf-8')
