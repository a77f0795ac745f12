"""How often diagnoses of many worlds are right."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

HELD_OUT = ('real_test', 'real_far')
_CALM = {'no_mismatch', 'parameters_only'}


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
