"""Write docs/performance.md from the measured results.

`python docs/generate_performance.py [bench.json]`: a file given becomes the committed result.
"""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
TARGET = Path(__file__).parent / 'performance.md'
RESULT = ROOT / 'sgp_proof' / 'results' / 'performance.json'
PAGE = (Path(__file__).parent / 'templates' / 'performance.txt').read_text(encoding='utf-8')
SIZE = 1000
FLOOR, GPYTORCH, SKLEARN, EVALUATION = 2.5, 100.0, 20.0, 3.0
EVIDENCE_TOLERANCE = 0.1
"""Nats by which an optimiser may stop short of the same maximum."""


def _table(head, rows):
    lines = [f'| {" | ".join(head)} |', '|---' * len(head) + '|']
    return '\n'.join([*lines, *(f'| {" | ".join(row)} |' for row in rows)])


def _number(x, digits=3):
    return 'not installed' if x is None else f'{x:.{digits}g}'


def _steps(rows):
    head = (
        'n', 'outputs', 'inputs', 'step [ms]', 'floor [ms]', 'times floor', 'faster than GPyTorch',
        'faster than scikit-learn', 'allocations', 'temporaries [kB]',
    )  # fmt: skip
    return _table(head, [
        (
            str(r['n']), str(r['outputs']), str(r['inputs']), _number(r['step_ms']),
            _number(r['floor_ms']), _number(r['times_floor']),
            _number(r['times_faster_gpytorch']), _number(r['times_faster_sklearn']),
            str(r['allocations']), _number(r['temporary_kilobytes']),
        )
        for r in rows
    ])  # fmt: skip


def _parts(rows):
    names = ('kernel', 'solve', 'rotate', 'rest')
    head = (
        'n',
        'outputs',
        'inputs',
        'covariances [ms]',
        'solve [ms]',
        'rotations [ms]',
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
    of_size = [r for r in rows if r['n'] == SIZE]

    def column(key):
        return [r[key] for r in of_size]

    return '\n'.join([
        f'Targets at n = {SIZE}, rows in the order of the table:\n',
        _judged(f'at most {FLOOR:g} times the floor', column('times_floor'), lambda x: x <= FLOOR),
        _judged(f'at least {GPYTORCH:g} times faster than GPyTorch',
                column('times_faster_gpytorch'), lambda x: x >= GPYTORCH),
        _judged(f'at least {SKLEARN:g} times faster than scikit-learn',
                column('times_faster_sklearn'), lambda x: x >= SKLEARN),
        _judged('no allocation that stays', column('allocations'), lambda x: x == 0),
    ])  # fmt: skip


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


def text():
    """Return the page."""
    result = json.loads(RESULT.read_text(encoding='utf-8'))
    steps, evidence = result['step'], result['evidence']
    differences = [
        r[f'{name}_difference'] for r in evidence for name in ('gpytorch', 'sklearn')
        if r[f'{name}_difference'] is not None
    ]  # fmt: skip
    return PAGE.format(
        machine=', '.join(f'{name} {value}' for name, value in result['machine'].items()),
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
        shutil.copyfile(sys.argv[1], RESULT)
    TARGET.write_text(text(), encoding='utf-8')
