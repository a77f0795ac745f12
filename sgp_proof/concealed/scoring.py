"""Scores of a diagnosis against the sealed answer, and the rates of many.

`DIAGNOSIS_SCHEMA.md` describes the scores.
"""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

HELD_OUT = ('real_test', 'real_far')
_CALM = {'no_mismatch', 'parameters_only'}
_RELATIVE_TO_RANGE = {'rest', 'position', 'onset'}


def ranked(diagnosis):
    """Return the findings, the top answer first."""
    return sorted(diagnosis['findings'], key=lambda f: -(f['probability'] or 0.0))


def is_right(answer, diagnosis):
    """Return whether the top answer, or the verdict without one, is among the accepted ones."""
    verdict, found = diagnosis['verdict'], ranked(diagnosis)
    names = {(f['effect'], f['joint']) for f in found}
    for accepted in answer['accepted']:
        if accepted['verdict'] != verdict:
            continue
        if accepted['effect'] is None:
            return True
        needed = all((n, found[0]['joint']) in names for n in accepted.get('requires', []))
        is_effect = found and needed and found[0]['effect'] == accepted['effect']
        if is_effect and accepted['joint'] in {'*', found[0]['joint']}:
            return True
    return False


def components(answer, diagnosis):
    """Return how many of the concealed effects are among the findings."""
    found = Counter((f['effect'], f['joint']) for f in diagnosis['findings'])
    concealed = Counter((e['effect'], e['joint']) for e in answer['effects'])
    return sum((found & concealed).values())


def overlap(answer, diagnosis):
    """Return intersection over union of the localised effects; None without any."""
    scores = []
    for place in answer['location']:
        variable = place['variables'][0]
        is_time = variable == 'time'
        true = place['time'] if is_time else place['intervals'][variable]
        best = 0.0
        for f in diagnosis['findings']:
            location = f['location']
            found = location['time'] if is_time else location['intervals'].get(variable, [])
            if f['joint'] == place['joint'] and found:
                best = max(best, _iou(found, true))
        scores.append(best)
    return float(np.mean(scores)) if scores else None


def _iou(found, true):
    shared = sum(max(0.0, min(a[1], b[1]) - max(a[0], b[0])) for a in found for b in true)
    length = sum(b - a for a, b in (*found, *true))
    return shared / max(length - shared, 1e-12)


def parameter_scores(answer, diagnosis):
    """Return relative error and whether the truth lies within two standard deviations.

    Of effects of one name on one joint each gets the finding that is nearest to it.
    """
    result = []
    left = list(diagnosis['findings'])
    for effect in answer['effects']:
        match = [
            f for f in left
            if (f['effect'], f['joint']) == (effect['effect'], effect['joint'])
        ]  # fmt: skip
        if not match:
            continue
        scores, best = min(
            ((_compared(effect, f, answer), f) for f in match),
            key=lambda pair: sum(score['error'] for score in pair[0]),
        )
        left.remove(best)
        result += scores
    return result


def _compared(effect, finding, answer):
    scores = []
    for name in effect['scored']:
        found = finding['parameters'].get(name)
        if found is None:
            continue
        error, std = abs(found['value'] - effect['parameters'][name]), found.get('std')
        covered = None if not std else bool(error <= 2.0 * std)
        scores.append({'name': f'{effect["effect"]}.{name}',
                       'error': error / _scale(name, effect, answer),
                       'covered': covered})  # fmt: skip
    return scores


def _scale(name, effect, answer):
    values = effect['parameters']
    if name in _RELATIVE_TO_RANGE and effect['joint'] in answer['joint_range']:
        low, high = answer['joint_range'][effect['joint']]
        return max(high - low, 1e-9)
    if name in {'roll', 'pitch'}:
        return math.hypot(values['roll'], values['pitch'])
    if name in {'fx', 'fy', 'fz'}:
        return math.sqrt(sum(values[n] ** 2 for n in ('fx', 'fy', 'fz')))
    return abs(values[name] - 1.0) if name == 'gain' else max(abs(values[name]), 1e-12)


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
        'named_single': rate(r['right'] for r in singles),
        'named_pair_top': rate(r['right'] for r in pairs),
        'components_of_pairs': rate(
            hit for r in pairs for hit in _hits(r.get('components', 0), 2)
        ),
        'false_alarms': rate(r['said'] in {'missing_physics', 'unexplained'} and not r['right']
                              for r in calm),
        'unknown_called_unexplained': rate(r['right'] for r in unknown),
        'failed': sum(r['said'] == 'failed' for r in rows),
        'overlap_median': _median(overlaps),
        'parameter_error_median': _median(errors),
        'within_two_std': rate(covered),
        'improvement': {s: _improvement(rows, s) for s in HELD_OUT},
        'oracle_parameter_error_median': _median(
            [p['error'] for r in rows for p in r.get('oracle_parameters', [])]
        ),
        'probability': _reliability(rows),
        'seconds_median': _median([r['seconds'] for r in rows]),
        'confused': dict(confused),
    }  # fmt: skip


def _improvement(rows, stem):
    """Return the shares on one recording held out, and how good the fitted true structure is.

    `above` counts the diagnoses that are better than it; `largest` is the share before clipping.
    """
    known = [r for r in rows if _has(r, 'improvement_of_truth', stem)]
    scored = [r for r in known if _has(r, 'improvement', stem)]
    errors = [r['errors'][stem] for r in scored]
    gains = [(e['nominal'] - e['diagnosed']) / (e['nominal'] - e['oracle']) for e in errors]
    return {
        'of_oracle': _spread([r['improvement'][stem] for r in scored]),
        'of_truth': _spread([r['improvement_of_truth'][stem] for r in known]),
        'above': sum(gain > 1.0 for gain in gains),
        'largest': max(gains, default=None),
        'left_by_oracle_median': _median([e['oracle'] / e['nominal'] for e in errors]),
        'not_scored': {r['case']: _what(r) for r in known if r not in scored},
        'below_nine_tenths': {
            r['case']: _what(r) for r in scored if r['improvement'][stem] < 0.9
        },
    }  # fmt: skip


def _has(row, name, stem):
    return row.get(name, {}).get(stem) is not None


def _what(row):
    return '+'.join(effect for effect, _ in row['truth']) or row['verdict']


def _spread(values):
    if not values:
        return {'worlds': 0, 'median': None, 'mean': None, 'least': None}
    return {'worlds': len(values), 'median': float(np.median(values)),
            'mean': float(np.mean(values)), 'least': float(min(values))}  # fmt: skip


def _hits(count, total):
    return [True] * count + [False] * (total - count)


def _median(values):
    return float(np.median(values)) if len(values) else None


def rate(flags):
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
        {'from': a, 'to': b, **rate(right for p, right in stated if a <= p < b or p == b == 1.0)}
        for a, b in bands
    ]
