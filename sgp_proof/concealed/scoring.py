"""Score a diagnosis against the sealed answer, as `DIAGNOSIS_SCHEMA.md` describes."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

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
