"""Write docs/diagnosis_real.md and a page for each machine, from committed results.

python docs/generate_diagnosis_real.py
"""

from __future__ import annotations

import json
import re
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from sgp_ros.diagnosis.criteria import LEAST_SHARE
from sgp_ros.diagnosis.result import Equivalent
from sgp_ros.report.diagnosis_text import equivalence_sentence, percent, plain_name

ROOT = Path(__file__).parents[1]
DOCS = ROOT / 'docs'
RESULTS = ROOT / 'sgp_proof' / 'results'
TITLES = {
    'emps': 'EMPS',
    'simple_pendulum_1kg': 'Simple pendulum, heavier weight',
    'simple_pendulum': 'Simple pendulum',
    'double_pendulum': 'Double pendulum, design A.0',
    'double_pendulum_c0': 'Double pendulum, design C.0',
    'panda': 'Panda',
    'tiago': 'TIAGo',
    'staubli_tx40': 'Staubli TX40',
    'tflex': 'T-Flex',
    'laas_settled': 'LAAS motor, settled points',
    'laas_speed': 'LAAS motor, speed control',
}
CAPTIONS = {
    'location': 'The discrepancy from the nominal robot over the state, before and after.',
    'motion': 'Recorded motion, and that of the nominal and the diagnosed robot under the same efforts.',
    'search': 'The shape of the force without a formula, with its band, and the formulas that were tried.',
    'others': 'The other joints on one scale, relative to their own effort.',
    'time': 'The discrepancy over time (grey), the part that was found, and the residual (orange).',
    'bands': 'The Gaussian process Z over each variable, with its 95 % band.',
    'dependence': 'The share of the discrepancy that each variable predicts on held-out stretches.',
    'law': 'The laws that were found, over their variables, with the data.',
    'shape': 'What a model with other inertial parameters, but without effects, leaves.',
    'proof': 'Errors of efforts and roll-outs before and after the correction.',
}
GRADES = ('right', 'partly', 'wrong')
HALF_WIDTH = 1.96
ERRORS = {'nmse': 'effort', 'rollout_nmse': 'roll-outs'}


def quantity(parameter):
    """Return a parameter with interval and unit."""
    value, std, unit = (parameter.get(key) for key in ('value', 'std', 'unit'))
    if isinstance(value, str):
        return value
    interval = '' if std is None else f' ± {HALF_WIDTH * std:.2g}'
    return f'{value:.3g}{interval} {"" if unit == "1" else unit or ""}'.rstrip()


def parts(machine):
    """Return the scores of the training data and of what was held out, by these names."""
    fit = {stem: part for stem, part in machine['fit'].items() if isinstance(part, dict)}
    return {'training' if k == 'train' else 'held out': part for k, part in fit.items()}


def worst(machine):
    """Return the joint of which the nominal robot leaves most, and each part's nMSE of it."""
    before = parts(machine)['training']['nmse_before']
    joint = max(before, key=before.get)
    errors = {name: f'{part["nmse_before"][joint]:.2g} → {part["nmse_after"][joint]:.2g}'
              for name, part in parts(machine).items()}  # fmt: skip
    return {'joint': joint, **errors}


def named(machine):
    """Return what a diagnosis names, each effect once."""
    names = [plain_name(f['effect']) for f in machine['findings'] if f['effect'] != 'unknown']
    return ', '.join(dict.fromkeys(names)) or 'nothing'


def effects(machine):
    """Return the table of what was found and what was not."""
    lines = ['| | joint | effect | parameters | probability |', '|---|---|---|---|---|']
    for kind, found in (('found', machine['findings']), ('not', machine['alternatives'])):
        for f in found:
            numbers = ', '.join(
                f'{key.replace("_", " ")} {quantity(p)}' for key, p in f['parameters'].items()
            )
            cells = (kind, f['joint'], plain_name(f['effect']), numbers or f['why'])
            lines.append(f'| {" | ".join(cells)} | {f["probability"]:.2f} |')
    return '\n'.join(lines)


def bodies(machine):
    """Return the bodies that differ from the nominal ones."""
    errors = [
        f'{e["parameter"].replace("_", " ")} of {e["link"]} '
        f'{e["value"]:.3g} ± {HALF_WIDTH * e["std"]:.2g} instead of {e["nominal"]:.3g} {e["unit"]}'
        for e in machine['parameter_errors']
    ]
    return f'Bodies: {"; ".join(errors)}.' if errors else ''


def equivalents(machine):
    """Return what this motion cannot tell from the findings."""
    sentences = (
        equivalence_sentence(
            Equivalent(
                tuple((x['joint'], x['effect']) for x in e['effects']),
                e['separating_motion'],
                e['contrast'],
            ),
            [(f['joint'], f['effect']) for f in machine['findings']],
        )
        for e in machine['equivalents']
    )
    return '\n'.join(dict.fromkeys(sentences))


def scores(machine):
    """Return the table of errors before and after, with the 95 % interval of those after."""
    columns = [(f'{what}, {name}', part, key) for name, part in parts(machine).items()
               for key, what in ERRORS.items() if part.get(f'{key}_before')]  # fmt: skip
    lines = [f'| nMSE | {" | ".join(title for title, *_ in columns)} |']
    lines.append('|---' * (len(columns) + 1) + '|')
    for joint in parts(machine)['training']['nmse_before']:
        cells = ' | '.join(_error(part, key, joint) for _, part, key in columns)
        lines.append(f'| {joint} | {cells} |')
    return '\n'.join(lines)


def _error(part, key, joint):
    before, after = (_short(part[f'{key}_{when}'][joint]) for when in ('before', 'after'))
    interval = part.get(f'{key}_after_interval', {}).get(joint)
    between = f' ({_short(interval[0])} to {_short(interval[1])})' if interval else ''
    return f'{before} → {after}{between}'


def _short(x):
    return f'{x:.2g}' if x < 100.0 else f'{x:.0f}'


def settings(machine):
    """Return how the recording was filtered, what was refused, how long it took."""
    given = machine['settings']
    refused = ', '.join(f'{n} {why}' for why, n in given['refused'].items()) or 'none'
    seconds = ', '.join(f'{verb} {s:.0f} s' for verb, s in machine['seconds'].items())
    return (f'Low-pass {given["cutoff_hz"]:.3g} Hz, {given["rows"]} rows; refused samples: '
            f'{refused}; {seconds}.')  # fmt: skip


def best_family(design):
    """Return the columns with which least is left of the runs left out, and how much less, (k,)."""
    known = design['known']['left_out']
    ratios = {
        family: [x / y for x, y in zip(shares['left_out'], known, strict=True)]
        for family, shares in design['families'].items()
    }
    best = min(ratios, key=lambda family: sum(ratios[family]))
    return best, [1.0 - ratio for ratio in ratios[best]]


def judgement(machine):
    """Return how far a diagnosis meets what was expected, and why not wholly."""
    judged = machine['judged']
    why = '\n'.join(f'* {reason}' for reason in judged['reasons'])
    return f'Judged **{judged["grade"]}** (source of what was expected: {machine["source"]}).' + (
        f'\n\n{why}' if why else ''
    )


def tally(machines):
    """Return how many recordings are judged right, partly right and wrong."""
    grades = [m['judged']['grade'] for m in machines.values()]
    counts = ', '.join(f'{grades.count(grade)} {grade}' for grade in GRADES)
    return f'Of {len(grades)} recordings: {counts}.'


def pages():
    """Return the text of each page by its path."""
    result, rest = (
        json.loads((RESULTS / f'{name}.json').read_text(encoding='utf-8'))
        for name in ('real_diagnosis', 'double_pendulum_rest')
    )
    templates = Environment(  # noqa: S701 - Markdown, and nothing in it is from outside
        loader=FileSystemLoader(DOCS / 'templates' / 'real_machines'), undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True,
    )  # fmt: skip
    templates.globals |= {
        f.__name__: f
        for f in (percent, quantity, parts, worst, named, effects, bodies, equivalents, scores,
                  settings,
                  best_family, judgement, tally)
    }  # fmt: skip
    templates.globals |= {'titles': TITLES, 'captions': CAPTIONS, 'least_share': LEAST_SHARE}
    versions = ', '.join(f'{k} {v}' for k, v in result['versions'].items())
    place, machines = result['environment'], result['machines']
    environment = f'{place["cores"]} cores of {place["processor"]}, {versions}'
    context = {'environment': environment, 'machines': machines, 'rest': rest}  # fmt: skip
    paths = {'overview': DOCS / 'diagnosis_real.md'}
    paths |= {name: DOCS / 'real_machines' / f'{name}.md' for name in machines}
    return {
        path: _page(templates, name, context | {'name': name, 'm': machines.get(name)})
        for name, path in paths.items()
    }


def _page(templates, name, content):
    """Return a page without the blanks that macros and loops leave."""
    text = templates.get_template(f'{name}.txt').render(content)
    return re.sub(r'\n{3,}', '\n\n', re.sub(r' +\n', '\n', text))


if __name__ == '__main__':
    for target, text in pages().items():
        target.write_text(text, encoding='utf-8')
