"""Write the measured tables of regression into docs/pendulums.md.

    python docs/generate_pendulums.py

They stand between two marks there; the rest of the page is written by hand.
"""

from __future__ import annotations

import json
from pathlib import Path

ROOT = Path(__file__).parents[1]
TARGET = Path(__file__).parent / 'pendulums.md'
TEMPLATE = Path(__file__).parent / 'templates' / 'pendulums.txt'
RESULTS = ROOT / 'sgp_proof' / 'results'
BEGIN, END = '<!-- generated -->', '<!-- end of what is generated -->'
TITLES = {'effort': 'torque from acceleration', 'acceleration': 'acceleration from torque'}


def _simple(windows, rollouts):
    """Inertia and gravity torque by window, from both regressions, beside roll-outs."""
    widths = list(next(iter(windows.values()))['inverse'])
    lines = ['| J, G | ' + ' | '.join(f'{w} s' for w in widths) + ' | roll-outs |']
    lines.append('|---' * (len(widths) + 2) + '|')
    for name, found in windows.items():
        if 'forward' not in found:
            continue
        known = rollouts[name]['whole']['offset']['parameters']
        for kind in found:
            cell = _forward if kind == 'forward' else _inverse
            cells = [cell(found[kind][w]['parameters']) for w in widths]
            cells.append(f'{known["J"]["value"]:.3f}, {known["G"]["value"]:.2f}')
            lines.append(f'| {name}, {kind} | {" | ".join(cells)} |')
    return '\n'.join(lines)


def _inverse(p):
    return f'{p["J"]:.3f}, {p["G"]:.2f}'


def _forward(p):
    if p['1/J'] <= 0.0:
        return 'none'
    return f'{1.0 / p["1/J"]:.3f}, {p["G/J"] / p["1/J"]:.2f}'


def _double(windows, designs):
    widths = list(next(iter(windows.values()))['inverse'])
    lines = ['| J1, G1 | ' + ' | '.join(f'{w} s' for w in widths) + ' | roll-outs |']
    lines.append('|---' * (len(widths) + 2) + '|')
    for name, found in windows.items():
        if 'forward' in found:
            continue
        known = designs[name[:3]]['identified']['Coulomb']['parameters']
        cells = [
            f'{x["parameters"]["J1"]:.3f}, {x["parameters"]["G1"]:.2f}'
            for x in found['inverse'].values()
        ]
        cells.append(f'{known["J1"]["value"]:.3f}, {known["G1"]["value"]:.2f}')
        lines.append(f'| {name} | {" | ".join(cells)} |')
    return '\n'.join(lines)


def _methods(methods):
    lines = [
        '| predicted | learned from | scored on | rows | PR | GP | PRGP | SGP |',
        '|---' * 8 + '|',
    ]
    for target, recordings in methods.items():
        for name, found in recordings.items():
            held = found['held_out'][0]
            for region in (held, f'{held}, near', f'{held}, far'):
                scores = (s[region]['joints']['pendulum'] for s in found['scores'].values())
                cells = (f'{s["nmse"]:.2g}, {100 * s["coverage95"]:.0f} %' for s in scores)
                place = region.replace('held out', 'its last 40 %')
                lines.append(
                    f'| {TITLES[target]} | {name} | {place} | {found["rows"][region]} | '
                    f'{" | ".join(cells)} |'
                )
    return '\n'.join(lines)


def text():
    """Return the page."""
    found, simple, double = (
        json.loads((RESULTS / f'{name}.json').read_text(encoding='utf-8'))
        for name in ('pendulum_regression', 'simple_pendulum', 'double_pendulum')
    )
    page = TARGET.read_text(encoding='utf-8')
    before, after = page.split(BEGIN)[0], page.split(END)[1]
    generated = TEMPLATE.read_text(encoding='utf-8').format(
        simple=_simple(found['windows'], simple['recordings']),
        double=_double(found['windows'], double['designs']),
        methods=_methods(found['methods']),
    )
    return f'{before}{BEGIN}\n{generated}{END}{after}'


if __name__ == '__main__':
    TARGET.write_text(text(), encoding='utf-8')
