"""Diagnoses that an expert expects, and how far a diagnosis meets them.

`expected.yaml` beside this module says for each recording which verdicts are right, which effects
must be found with numbers between which limits, what else may be named, and what a fit by hand
leaves of held-out efforts. A diagnosis is

* right: a right verdict, all that is expected with its numbers, nothing else of probability
  0.5 or more, and held-out errors as small as asked for;
* wrong: refused, a name of probability 0.5 or more that is not expected, or nothing that is;
* partly right: anything between.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

PATH = Path(__file__).with_name('expected.yaml')
CONFIDENT = 0.5
"""Probability from which a name counts as said. The schema of diagnosis.json."""
BODIES = 'parameters'
"""Word for corrected bodies where effects are listed."""


def read_expected(path: Path = PATH) -> dict[str, Any]:
    """Return what is expected, by recording."""
    content: dict[str, Any] = yaml.safe_load(path.read_text(encoding='utf-8'))
    return content


def judge(expected: Mapping[str, Any], found: Mapping[str, Any]) -> dict[str, Any]:
    """Return how far a diagnosis is right, and each reason why it is not wholly so.

    Args:
        expected: of one recording.
        found: content of diagnosis.json; `{'refused': sentence}` of a diagnosis that was refused.

    Returns:
        `grade` (right, partly, wrong), `reasons`, and `held_out`, the mean nMSE over the joints
        of what was not learned from, None where nothing was held out.
    """
    if 'refused' in found:
        return {'grade': 'wrong', 'reasons': [f'refused: {found["refused"]}'], 'held_out': None}
    reasons = []
    if found['verdict'] not in expected['verdict']:
        reasons.append(f'verdict {_plain(found["verdict"])}')
    misses = [_miss(item, found) for item in expected['expected']]
    reasons += [miss for miss in misses if miss]
    strangers = [_said(f) for f in found['findings'] if not _is_expected(f, expected)]
    reasons += [f'not expected: {said}' for said in strangers]
    error, limit = held_out_error(found['fit']), expected.get('held_out')
    if limit is not None:
        target = limit['nmse'] * limit['factor']
        if error is None or error > target:
            left = 'nothing held out' if error is None else f'held out {error:.3g}'
            reasons.append(f'{left}, asked for at most {target:.3g}')
    is_nothing = all(miss.endswith(_NOT_FOUND) for miss in misses)
    grade = 'wrong' if strangers or is_nothing else 'partly' if reasons else 'right'
    return {'grade': grade, 'reasons': reasons, 'held_out': error}


_NOT_FOUND = 'not found'


def _miss(item: Mapping[str, Any], found: Mapping[str, Any]) -> str:
    """Return what is missing of one expected effect; empty where it was found."""
    if BODIES in item['effects'] and found['parameter_errors']:
        return ''
    named = [f for f in found['findings'] if _matches(f, item)]
    if not named:
        effects = ' or '.join(map(_plain, item['effects']))
        return f'{" or ".join(item["joint"])}: {effects}{_unseen(item, found)} {_NOT_FOUND}'
    problems = [_problems(f, item['effects'][f['effect']]) for f in named]
    best = min(problems, key=len)
    return '; '.join(best)


def _unseen(item: Mapping[str, Any], found: Mapping[str, Any]) -> str:
    """Say from what size on the recording shows what is expected, where that is too much."""
    for seen in found.get('visibility', ()):
        limits = item['effects'].get(seen['effect'], {}).get(seen['parameter'])
        if limits and seen['joint'] in item['joint'] and seen['value'] > limits[1]:
            least, most = f'{seen["value"]:.2g} {seen["unit"]}', f'{limits[1]:g}'
            return f', which this recording shows from {least} on (expected: at most {most}),'
    return ''


def _matches(finding: Mapping[str, Any], item: Mapping[str, Any]) -> bool:
    return finding['joint'] in item['joint'] and finding['effect'] in item['effects']


def _problems(finding: Mapping[str, Any], ranges: Mapping[str, Any]) -> list[str]:
    """Return numbers of a finding out of their range, and a low probability."""
    lead = f'{finding["joint"]}: {_plain(finding["effect"])}'
    problems = []
    for name, (low, high) in ranges.items():
        value = finding['parameters'].get(name, {}).get('value')
        if value is None or not low <= value <= high:
            said = 'none' if value is None else f'{value:.3g}'
            problems.append(f'{lead} {_plain(name)} {said}, expected {low:g} to {high:g}')
    if finding['probability'] < CONFIDENT:
        problems.append(f'{lead} with probability {finding["probability"]:.2f} only')
    return problems


def _is_expected(finding: Mapping[str, Any], expected: Mapping[str, Any]) -> bool:
    return (
        finding['probability'] < CONFIDENT
        or finding['effect'] in ('unknown', *expected.get('allowed', ()))
        or any(_matches(finding, item) for item in expected['expected'])
    )


def _said(finding: Mapping[str, Any]) -> str:
    return f'{_plain(finding["effect"])} of {finding["joint"]} ({finding["probability"]:.2f})'


def _plain(name: str) -> str:
    return name.replace('_', ' ')


def held_out_error(fit: Mapping[str, Any]) -> float | None:
    """Return the mean over joints and held-out parts of the nMSE of the effort after."""
    parts = [x for stem, x in fit.items() if isinstance(x, Mapping) and stem != 'train']
    errors = [e for part in parts for e in part.get('nmse_after', {}).values()]
    return float(np.mean(errors)) if errors else None
