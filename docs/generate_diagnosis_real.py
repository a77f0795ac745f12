"""Write docs/diagnosis_real.md from committed results: `python docs/generate_diagnosis_real.py`."""

from __future__ import annotations

import json
from pathlib import Path

ROOT = Path(__file__).parents[1]
TARGET = Path(__file__).parent / 'diagnosis_real.md'
RESULT = ROOT / 'benchmarks' / 'results' / 'real_diagnosis.json'
PAGE = (Path(__file__).parent / 'templates' / 'diagnosis_real.txt').read_text(encoding='utf-8')
TITLES = {
    'emps': 'EMPS',
    'simple_pendulum_1kg': 'simple pendulum, heavier weight',
    'simple_pendulum': 'simple pendulum',
    'double_pendulum': 'double pendulum',
    'panda': 'Panda',
    'tiago': 'TIAGo',
}
PHI1 = (0.54615, 0.87224, 0.64068, 1.2794, 0.83904, 0.30301, 0.56489)
"""Heights of the sigmoids of Panda's joints [N m], Gaz et al. 2019."""
HALF_WIDTH = 1.96


def _number(parameter):
    value, std, unit = (parameter.get(key) for key in ('value', 'std', 'unit'))
    if isinstance(value, str):
        return value
    unit = '' if unit == '1' else unit
    half = '' if std is None else f' ± {HALF_WIDTH * std:.2g}'
    return f'{value:.3g}{half} {unit or ""}'.rstrip()


def _row(finding, kind):
    numbers = ', '.join(f'{k} {_number(p)}' for k, p in finding['parameters'].items())
    name = finding['effect'].replace('_', ' ')
    numbers = numbers or finding['why']
    return f'| {kind} | {finding["joint"]} | {name} | {numbers} | {finding["probability"]:.2f} |'


def _scores(machine):
    """Return nMSE before and after, on what was learned from and on what was held out."""
    parts = {('learned from' if k == 'train' else 'held out'): v
             for k, v in machine['fit'].items() if isinstance(v, dict)}  # fmt: skip
    lines = [f'| nMSE | {" | ".join(next(iter(parts.values()))["nmse_before"])} |']
    lines.append('|---' * (lines[0].count('|') - 1) + '|')
    for name, part in parts.items():
        cells = (
            f'{before:.2g} → {part["nmse_after"][joint]:.2g}'
            for joint, before in part['nmse_before'].items()
        )
        lines.append(f'| {name} | {" | ".join(cells)} |')
    return '\n'.join(lines)


def _section(name, machine):
    settings = machine['settings']
    refused = ', '.join(f'{n} {why}' for why, n in settings['refused'].items()) or 'none'
    seconds = ', '.join(f'{verb} {s:.0f} s' for verb, s in machine['seconds'].items())
    lines = ['| | joint | effect | parameters | probability |', '|---|---|---|---|---|']
    lines += [_row(f, 'found') for f in machine['findings']]
    lines += [_row(f, 'not') for f in machine['alternatives']]
    errors = [
        f'{e["parameter"].replace("_", " ")} of {e["link"]} '
        f'{e["value"]:.3g} ± {HALF_WIDTH * e["std"]:.2g} instead of {e["nominal"]:.3g} {e["unit"]}'
        for e in machine['parameter_errors']
    ]
    return '\n'.join([
        '```bash', *machine['commands'], '```', '',
        f'> {machine["sentence"].replace("+-", "±")}', '',
        *(lines if len(lines) > 2 else []), '',
        *([f'Bodies: {"; ".join(errors)}.', ''] if errors else []),
        _scores(machine), '',
        (f'Low-pass {settings["cutoff_hz"]:.3g} Hz, {settings["rows"]} rows; refused samples: '
        f'{refused}; {seconds}.'), '',
        f'![{TITLES[name]}](images/diagnosis_{name}.png)',
    ])  # fmt: skip


def _worst(part):
    joint = max(part['nmse_before'], key=part['nmse_before'].get)
    return joint, part['nmse_before'][joint], part['nmse_after'][joint]


def _overview(machines):
    lines = [
        '| machine | verdict | worst joint | nMSE learned from | held out |',
        '|---' * 5 + '|',
    ]
    for name, machine in machines.items():
        fits = {k: v for k, v in machine['fit'].items() if isinstance(v, dict)}
        joint, before, after = _worst(fits['train'])
        held = [v for k, v in fits.items() if k != 'train']
        cell = 'none'
        if held:
            cell = f'{held[0]["nmse_before"][joint]:.2g} → {held[0]["nmse_after"][joint]:.2g}'
        verdict = machine['verdict'].replace('_', ' ')
        lines.append(
            f'| {TITLES[name]} | {verdict} | {joint} | {before:.2g} → {after:.2g} | {cell} |'
        )
    return '\n'.join(lines)


def _dry_levels(machine):
    """Return what was found of dry friction by joint [N m]: mean of both directions."""
    levels = {}
    for finding in machine['findings']:
        p = {k: v['value'] for k, v in finding['parameters'].items()}
        if finding['effect'] == 'asymmetric_coulomb':
            levels[finding['joint']] = 0.5 * (p['level_pos'] + p['level_neg'])
        elif finding['effect'] in {'coulomb_friction', 'hysteresis'}:
            levels[finding['joint']] = p['level']
    return levels


def text():
    """Return the page."""
    result = json.loads(RESULT.read_text(encoding='utf-8'))
    machines, machine = result['machines'], result['environment']
    emps = {f['effect']: f['parameters'] for f in machines['emps']['findings']}
    levels = [emps['asymmetric_coulomb'][k]['value'] for k in ('level_pos', 'level_neg')]
    loaded = machines['simple_pendulum_1kg']
    joints = list(machines['panda']['fit']['train']['nmse_before'])
    panda = _dry_levels(machines['panda'])
    compared = ', '.join(
        f'joint {joints.index(j) + 1} {level:.3f} ({0.5 * PHI1[joints.index(j)]:.3f})'
        for j, level in sorted(panda.items())
    )
    tiago = machines['tiago']['fit']['train']
    held = machines['emps']['fit']['emps_val_pulses']['nmse_after']['axis']
    fourth = machines['panda']['dependence'][3]
    lag = next(
        f['parameters']['time_constant']['value']
        for f in machines['tiago']['findings']
        if f['effect'] == 'velocity_filter_lag'
    )
    versions = ', '.join(f'{k} {v}' for k, v in result['versions'].items())
    return PAGE.format(
        environment=f'{machine["cores"]} cores of {machine["processor"]}, {versions}',
        overview=_overview(machines),
        emps_mean=f'{0.5 * sum(levels):.1f}',
        emps_half=f'{0.5 * (levels[0] - levels[1]):.1f}',
        emps_left=f'{100 * held:.2g} %',
        rows_1kg=loaded['settings']['rows'],
        cutoff_1kg=f'{loaded["settings"]["cutoff_hz"]:.2g}',
        sigmoid=', '.join(f'{0.5 * phi:.3f}' for phi in PHI1),
        panda_levels=compared,
        panda_4=f'{100 * fourth["scores"]["velocity"]:.0f} %',
        panda_4_share=f'{100 * fourth["share"]:.2g} %',
        panda_rows=machines['panda']['settings']['rows'],
        panda_hz=f'{machines["panda"]["settings"]["cutoff_hz"]:.2g}',
        lag=f'{lag:.2f}',
        tiago_rest=f'{100 * max(tiago["nmse_after"].values()):.2g} %',
        **{name: _section(name, found) for name, found in machines.items()},
    )


if __name__ == '__main__':
    TARGET.write_text(text(), encoding='utf-8')
