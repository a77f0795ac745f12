"""Write docs/filter.md from the committed results: `python docs/generate_filter.py`."""

from __future__ import annotations

import json
from pathlib import Path

from sgp_proof.concealed.promises import FACTOR
from sgp_ros.engine.rest import SPAN_S

ROOT = Path(__file__).parents[1]
TARGET = Path(__file__).parent / 'filter.md'
TEMPLATE = Path(__file__).parent / 'templates' / 'filter.txt'


def _load(name):
    path = ROOT / 'sgp_proof/results' / f'{name}.json'
    return json.loads(path.read_text(encoding='utf-8'))


def _rows(cases):
    """Return case, joint, nMSE and the ratio of what was delivered to what was promised."""
    return [
        (name.removeprefix('case_'), joint, x, x['delivered'] / x['promised'])
        for name, case in cases.items()
        for joint, x in case['effort_nmse'].items()
    ]


def _promises(cases):
    lines = [
        '| case | joint | diagnosed | promised | delivered | ratio |',
        '|---|---|---|---|---|---|',
    ]
    lines += [
        f'| {case} | {joint} | {x["diagnosed"]:.2g} | {x["promised"]:.2g} | {x["delivered"]:.2g} | '
        f'{ratio:.2g} |'
        for case, joint, x, ratio in _rows(cases)
    ]
    return '\n'.join(lines)


def _misses(cases):
    rows = _rows(cases)
    missed = [f'case {c}, {j} ({ratio:.2g} times)' for c, j, _, ratio in rows if ratio > FACTOR]
    if not missed:
        return f'None of the {len(rows)} joints is more than {FACTOR:g} times worse than promised.'
    return f'More than {FACTOR:g} times worse than promised: {"; ".join(missed)}.'


def _left_out(cases):
    named = [
        f'case {name.removeprefix("case_")}, `{finding["effect"]}` of {finding["joint"]}'
        for name, case in cases.items()
        for finding in case['left_out']
    ]
    return f'Not taken over by a node: {"; ".join(named) or "nothing"}.'


def text():
    """Return the page."""
    cases = _load('promises')['cases']
    values = {
        'PROMISES': _promises(cases), 'MISSES': _misses(cases), 'LEFT_OUT': _left_out(cases),
        'SPAN': f'{SPAN_S:g}',
    }  # fmt: skip
    page = TEMPLATE.read_text(encoding='utf-8')
    for name, value in values.items():
        page = page.replace('{' + name + '}', value)
    return page


if __name__ == '__main__':
    TARGET.write_text(text(), encoding='utf-8')
