"""The page of an identification from a whole recording, and its figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.figure import Figure

from sgp_ros.batch.identification import HELD_OUT, Identification
from sgp_ros.gp.scores import INTERVAL_95
from sgp_ros.report.figures import BAND, GREY, MEASURED, PREDICTED, png
from sgp_ros.report.files import write_bytes, write_text
from sgp_ros.report.html import embedded

_SHOWN_S = 12.0
_CORRELATED = 0.2
"""Correlation from row to row that is worth a word: the filter alone leaves some tenth."""


def write_identification(
    out: Path, found: Identification, findings: Mapping[str, Any], remarks: Sequence[str]
) -> None:
    """Write `report.html` and the figures as PNG into `out`."""
    figures = {'filter': png(draw_filter(findings['filter']))}
    for name in found.held:
        figures[f'prediction_{_stem(name)}'] = png(draw_prediction(found, name))
    for name, content in figures.items():
        write_bytes(out / f'{name}.png', content)
    write_text(out / 'report.html', render(found.robot.description, findings, figures, remarks))


def render(
    description: str,
    findings: Mapping[str, Any],
    figures: Mapping[str, bytes],
    remarks: Sequence[str],
) -> str:
    """Return the page as HTML; every text in it is escaped."""
    environment = Environment(
        loader=PackageLoader('sgp_ros.report'), autoescape=True, undefined=StrictUndefined
    )
    regions = list(findings['rows'])
    return environment.get_template('identification.html').render(
        title=f'{findings["robot"]} identified from {findings["recording"]}',
        subtitle=description,
        verdict=verdict(findings),
        cautions=cautions(findings),
        held_note=f'No method has learned from {" or ".join(map(called, findings["held_out"]))}. '
        'Near and far are the halves of its rows that lie closer to and further from the states '
        'learned from.',
        drawn=drawn(findings['scores']),
        predictions=embedded(figures, ('prediction_',)),
        methods=list(findings['scores']),
        tables=[{'title': name, 'rows': _rows(findings, name)} for name in regions],
        inputs=_inputs(findings),
        joints=[{'name': j, 'unit': findings['units']['position'][j]} for j in findings['joints']],
        rollouts=[
            _rollout(name, score) for name, all_ in findings['rollouts'].items() for score in all_
        ],
        excitation=excitation(findings['excitation']),
        suggestions=findings['excitation']['suggestions'],
        parameters=[_parameter(p) for p in findings['parameters']],
        bodies=any('consistent' in p for p in findings['parameters']),
        base=[_base(b) for b in findings['base_parameters']],
        filter=filter_sentence(findings['filter']),
        filter_figures=embedded(figures, ('filter',)),
        counts=', '.join(f'{value} {key}' for key, value in findings['counts'].items()) + '.',
        remarks=list(remarks),
        versions=list(findings['versions'].items()),
    )


def called(name: str) -> str:
    """Return a name of held-out data as it stands in a sentence."""
    return 'the held-out part' if name == HELD_OUT else name


def drawn(scores: Mapping[str, Any]) -> str:
    """Return the method that speaks for the identification, from `scores` by method."""
    return 'SGP' if 'SGP' in scores else next(iter(scores))


def verdict(findings: Mapping[str, Any]) -> str:
    """Say how well what was held out is predicted, and what Z adds."""
    parts = []
    for name in findings['held_out']:
        scores = {m: s[name].get('mean_nmse') for m, s in findings['scores'].items()}
        sgp, physics = scores.get('SGP'), scores.get('PR')
        best = sgp if sgp is not None else next(iter(scores.values()))
        if best is None:
            parts.append(
                f'nothing of {called(name)}: it asks for parameters that are not determined'
            )
            continue
        text = f'the {findings["target"]} in {called(name)} with a mean nMSE of {best:.2g}'
        if sgp is not None and physics is not None:
            text += f' (physics alone {physics:.2g})'
        parts.append(text)
    scale = ' 0 is perfect, 1 no better than a constant.'
    return 'The model predicts ' + '; '.join(parts) + '.' + scale + _learned(findings['inputs'])


def _learned(inputs: Sequence[Sequence[str]] | None) -> str:
    if inputs is None or any(inputs):
        return ''
    return ' Nothing was learned beside the physics: it would not predict better.'


def cautions(findings: Mapping[str, Any]) -> list[str]:
    """Say what is not to be trusted, and why."""
    found = []
    plan = findings['filter']
    rows = [c['rows'] for c in plan['candidates'] if c['cutoff_hz'] == plan['cutoff_hz']]
    by_chance = max(_CORRELATED, 3.0 / max(rows, default=1) ** 0.5)  # white noise has the latter
    if not plan['is_white'] and plan['residual_autocorrelation'] > by_chance:
        found.append(
            'The physics leaves a residual that is not white (correlation '
            f'{plan["residual_autocorrelation"]:.2f} from row to row): something is missing. '
            'Intervals of parameters allow for the correlation, not for a bias.'
        )
    narrow = [
        f'{joint} ({100 * score["coverage95"]:.0f} %)'
        for name, scores in findings['scores'].get('SGP', {}).items()
        if name in findings['held_out']
        for joint, score in scores.get('joints', {}).items()
        if score['coverage95'] < 0.9
    ]
    if narrow:
        found.append(f'Intervals of SGP are too narrow on held-out data: {", ".join(narrow)}.')
    if findings['consistency'] and not findings['consistency']['was_consistent']:
        found.append(
            'The fitted parameters belong to no real bodies: a mass or an inertia is not '
            'positive, or a friction drives. ' + _nearest(findings['consistency']['distance'])
        )
    return found


def _nearest(distance: float | None) -> str:
    if distance is None:
        return 'None near them could be found, so no URDF is written: record more motion.'
    return f'The nearest real bodies lie {distance**0.5:.2g} standard deviations away.'


def excitation(found: Mapping[str, Any]) -> str:
    """Say how many combinations of parameters the motion determines."""
    text = (
        f'This motion determines {found["rank"]} combinations of parameters, of '
        f'{found["structural_rank"]} that some motion could show. The least visible one shows '
        f'{found["condition"]:.3g} times less than the most visible one (condition number).'
    )
    if found['not_excited']:
        text += ' Not determined: ' + '; '.join(found['not_excited']) + '.'
    return text


def filter_choice(plan: Mapping[str, Any]) -> str:
    """Say which filter was chosen."""
    taken = 'as measured' if plan['velocity_source'] == 'measured' else 'from the position'
    return (
        'Both sides of the equation of motion passed a low-pass without delay of '
        f'{plan["cutoff_hz"]:g} Hz; {plan["rate_hz"]:.3g} rows per second were kept. '
        f'The velocity was taken {taken}.'
    )


def filter_sentence(plan: Mapping[str, Any]) -> str:
    """Say which filter was chosen and why."""
    text = filter_choice(plan)
    if len({c['velocity_source'] for c in plan['candidates']}) > 1:
        text += ' It predicts held-out stretches better than the other one.'
    return text + (
        ' The curve shows what each cut-off loses on held-out stretches, summed over all bands; '
        'the least one was taken.'
    )


def draw_filter(plan: Mapping[str, Any]) -> Figure:
    """Draw the regret of every cut-off that was tried."""
    figure = Figure(figsize=(7.5, 3.6), layout='constrained')
    axes = figure.add_subplot()
    for source, colour in (('position', PREDICTED), ('measured', '#D55E00')):
        tried = [c for c in plan['candidates'] if c['velocity_source'] == source]
        if tried:
            label = 'velocity measured' if source == 'measured' else 'velocity differentiated'
            axes.plot(
                [c['cutoff_hz'] for c in tried], [1.0 + c['regret'] for c in tried], 'o-',
                color=colour, label=label,
            )  # fmt: skip
    axes.axvline(plan['cutoff_hz'], color=GREY, ls=':', label='taken')
    axes.set(
        xscale='log',
        yscale='log',
        xlabel='cut-off [Hz]',
        ylabel='loss beside the best: 1 + regret [nat]',
    )
    axes.legend(fontsize='small')
    return figure


def draw_prediction(found: Identification, name: str) -> Figure:
    """Draw the target of every joint over the first seconds of what was held out."""
    data = found.held[name]
    method = drawn(found.fits)
    mean, variance = found.fits[method].predict(data)
    shown = np.flatnonzero(data.time <= data.time[0] + _SHOWN_S)
    joints = found.robot.joints
    figure = Figure(figsize=(10, 1.2 + 1.7 * len(joints)), layout='constrained')
    half = INTERVAL_95 * np.sqrt(np.where(np.isfinite(variance), variance, np.nan))
    for j, joint in enumerate(joints):
        axes = figure.add_subplot(len(joints), 1, j + 1)
        time, y, m, h = data.time[shown], data.y[shown, j], mean[shown, j], half[shown, j]
        axes.fill_between(time, m - h, m + h, color=BAND, lw=0)
        axes.plot(time, y, color=MEASURED, lw=3)
        axes.plot(time, m, color=PREDICTED, lw=1.2)
        axes.set_ylabel(f'{joint.name}\n[{joint.unit(found.robot.target)}]', fontsize='small')
    axes.set_xlabel('time [s]')
    figure.suptitle(f'{found.robot.target} in {called(name)}: measured, and predicted by {method}')
    return figure


def _rows(findings: Mapping[str, Any], name: str) -> list[dict[str, Any]]:
    rows, units = [], findings['units'][findings['target']]
    speaker = drawn(findings['scores'])
    for joint in findings['joints']:
        cells = []
        for scores in findings['scores'].values():
            cell = scores[name].get('joints', {}).get(joint)
            cells.append(
                {'nmse': '', 'coverage': ''} if cell is None else
                {'nmse': _short(cell['nmse']), 'coverage': f'{100 * cell["coverage95"]:.0f} %'}
            )  # fmt: skip
        best = findings['scores'][speaker][name].get('joints', {}).get(joint)
        rmse = '' if best is None else f'{best["rmse"]:.3g} {units[joint]}'
        rows.append({'joint': joint, 'cells': cells, 'rmse': rmse})
    return rows


def _inputs(findings: Mapping[str, Any]) -> str:
    if findings['inputs'] is None:
        return ''
    said = zip(findings['joints'], findings['inputs'], strict=True)
    return '; '.join(
        f'{joint}: ' + (', '.join(n.removeprefix('own:') for n in names) or 'no Z')
        for joint, names in said
    )


def _rollout(name: str, score: Mapping[str, Any]) -> dict[str, Any]:
    cells = [
        {'nmse': _short(c['nmse_end']), 'rms': _short(c['rms_end'])}
        for c in score['joints'].values()
    ]
    return {
        'name': name, 'horizon': f'{score["horizon_s"]:.3g}', 'n': score['n'],
        'diverged': score['diverged'], 'cells': cells,
    }  # fmt: skip


def _parameter(p: Mapping[str, Any]) -> dict[str, Any]:
    row = {
        'name': p['name'], 'unit': p['unit'], 'known': p['identifiable'], 'value': '',
        'interval': unknown(p['status']),
        'consistent': _short(p.get('consistent')),
    }  # fmt: skip
    if p['std'] is not None:
        half = INTERVAL_95 * p['std']
        row['value'] = f'{p["value"]:.5g}'
        row['interval'] = f'{p["value"] - half:.4g} to {p["value"] + half:.4g}'
    return row


def unknown(status: str) -> str:
    """Say why a parameter has no value."""
    if status == 'structural':
        return 'known only in combination with others'
    return 'not determined by this motion'


def _base(b: Mapping[str, Any]) -> dict[str, str]:
    half = INTERVAL_95 * b['std']
    return {
        'text': b['text'], 'value': f'{b["value"]:.5g}',
        'interval': f'{b["value"] - half:.4g} to {b["value"] + half:.4g}',
    }  # fmt: skip


def _short(x: float | None) -> str:
    return '' if x is None else f'{x:.3g}'


def _stem(name: str) -> str:
    return ''.join(c if c.isalnum() else '_' for c in name)
