"""Write docs/filter.md from the committed results: `python docs/generate_filter.py`."""

from __future__ import annotations

import json
import statistics
from pathlib import Path

from sgp_proof.concealed.promises import FACTOR
from sgp_ros.engine import rest
from sgp_ros.physics.joint_terms import Shape

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
        '| case | joint | model of the diagnosis | stated | online | ratio |',
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
        return f'None of the {len(rows)} joints is more than {FACTOR:g} times worse than stated.'
    return f'More than {FACTOR:g} times worse than stated: {"; ".join(missed)}.'


def _left_out(cases):
    named = [
        f'case {name.removeprefix("case_")}, `{finding["effect"]}` of {finding["joint"]}'
        for name, case in cases.items()
        for finding in case['left_out']
    ]
    return f'Effects that a node does not model: {"; ".join(named) or "none"}.'


def _rest(worlds):
    """Return how much depends on the time over which rest is detected."""
    spans = list(worlds[0]['spans'])
    best = [min(x['effort_nmse'] for x in world['spans'].values()) for world in worlds]
    lines = [
        (
            f'The influence of that time was measured on {len(worlds)} simulated robots with stated dry friction '
            '(`sgp_proof.concealed.draw`, tiers A and B), each replayed with the true parameters and with multiples of '
            'the time. The table shows the nMSE of the effort of the worst joint, relative to the best multiple for that '
            'robot. Every joint is scored on the equations in which no multiple takes it for resting:'
        ),
        '',
        '| multiple of the time | median | largest | equations held, mean |',
        '|---|---|---|---|',
    ]
    for span in spans:
        found = [world['spans'][span] for world in worlds]
        ratios = [x['effort_nmse'] / b for x, b in zip(found, best, strict=True)]
        held = statistics.mean(x['held'] for x in found)
        lines.append(
            f'| {span} | {statistics.median(ratios):.2f} | {max(ratios):.3g} | {100 * held:.0f} % |'
        )
    effects = sorted({e for world in worlds for e in world['effects']})
    lines += [
        '',
        (
            'A multiple of 0 means two neighbouring intervals, the minimum. '
            f'Effects: {", ".join(f"`{e}`" for e in effects)}. Command: `python -m sgp_proof.concealed.rest_span WORLDS`; '
            'result: [rest_span.json](../sgp_proof/results/rest_span.json).'
        ),
    ]
    return '\n'.join(lines)


def text():
    """Return the page."""
    cases = _load('promises')['cases']
    values = {
        'PROMISES': _promises(cases), 'MISSES': _misses(cases), 'LEFT_OUT': _left_out(cases),
        'WIDTH': f'{rest.CERTAIN * Shape().coulomb_width:g}', 'REST': _rest(_load('rest_span')['worlds']),
    }  # fmt: skip
    page = TEMPLATE.read_text(encoding='utf-8')
    for name, value in values.items():
        page = page.replace('{' + name + '}', value)
    return page


if __name__ == '__main__':
    TARGET.write_text(text(), encoding='utf-8')
