"""The page of an identification from a whole recording, and its figures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.figure import Figure

from sgp_ros.core.scores import INTERVAL_95
from sgp_ros.report.figures import BAND, GREY, MEASURED, PREDICTED, png
from sgp_ros.report.files import write_bytes, write_text
from sgp_ros.report.html import embedded

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from sgp_ros.offline.identification import Identification

_SHOWN_S = 12.0


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
    held = [name for name in findings['rows'] if name != 'train']
    return environment.get_template('identification.html').render(
        title=f'{findings["robot"]} identified from {findings["recording"]}',
        subtitle=description,
        verdict=verdict(findings),
        cautions=cautions(findings),
        held_note=f'Held out: {", ".join(held)}; near and far: the halves of the rows that lie '
        'closer to and further from the states learned from.',
        predictions=embedded(figures, ('prediction_',)),
        methods=list(findings['scores']),
        tables=[{'title': name, 'rows': _rows(findings, name)} for name in ('train', *held)],
        inputs=_inputs(findings),
        joints=findings['joints'],
        rollouts=[
            _rollout(name, score) for name, all_ in findings['rollouts'].items() for score in all_
        ],
        excitation=excitation(findings['excitation']),
        suggestions=findings['excitation']['suggestions'],
        parameters=[_parameter(p) for p in findings['parameters']],
        base=[_base(b) for b in findings['base_parameters']],
        filter=filter_sentence(findings['filter']),
        filter_figures=embedded(figures, ('filter',)),
        counts=', '.join(f'{value} {key}' for key, value in findings['counts'].items()) + '.',
        remarks=list(remarks),
        versions=list(findings['versions'].items()),
    )


def verdict(findings: Mapping[str, Any]) -> str:
    """Say how well what was held out is predicted, and what Z adds."""
    parts = []
    for name in findings['rows']:
        if name == 'train' or name.endswith((', near', ', far')):
            continue
        scores = {m: s[name].get('mean_nmse') for m, s in findings['scores'].items()}
        sgp, physics = scores.get('SGP'), scores.get('PR')
        best = sgp if sgp is not None else next(iter(scores.values()))
        if best is None:
            parts.append(f'nothing of {name}, which asks about parameters not determined')
            continue
        text = f'{findings["target"]} of {name} with a mean nMSE of {best:.2g}'
        if sgp is not None and physics is not None:
            text += f' (physics alone {physics:.2g})'
        parts.append(text)
    return 'The model predicts ' + '; '.join(parts) + '.'


def cautions(findings: Mapping[str, Any]) -> list[str]:
    """Say what is not to be trusted, and why."""
    found = []
    plan = findings['filter']
    if not plan['is_white']:
        found.append(
            'The physics leaves a residual that is not white (correlation '
            f'{plan["residual_autocorrelation"]:.2f} from row to row): something is missing. '
            'Intervals of parameters allow for the correlation, not for a bias.'
        )
    narrow = [
        f'{joint} ({100 * score["coverage95"]:.0f} %)'
        for name, scores in findings['scores'].get('SGP', {}).items()
        if name in findings['rows'] and name != 'train' and ', ' not in name
        for joint, score in scores.get('joints', {}).items()
        if score['coverage95'] < 0.9
    ]
    if narrow:
        found.append(f'Intervals of SGP are too narrow on held-out data: {", ".join(narrow)}.')
    if findings['consistency'] and not findings['consistency']['was_consistent']:
        found.append(
            'The fitted parameters belong to no real bodies; the nearest ones that do lie '
            f'{findings["consistency"]["distance"] ** 0.5:.2g} standard deviations away.'
        )
    return found


def excitation(found: Mapping[str, Any]) -> str:
    """Say how many combinations of parameters the motion determines."""
    text = (
        f'{found["rank"]} combinations of parameters are determined by this motion, of '
        f'{found["structural_rank"]} that any motion could show; condition '
        f'{found["condition"]:.3g}.'
    )
    if found['not_excited']:
        text += ' Not excited: ' + '; '.join(found['not_excited']) + '.'
    return text


def filter_sentence(plan: Mapping[str, Any]) -> str:
    """Say which filter was chosen and why."""
    sources = {c['velocity_source'] for c in plan['candidates']}
    text = (
        f'Both sides of the equation of motion passed one zero-phase low-pass of '
        f'{plan["cutoff_hz"]:g} Hz and were thinned out to {plan["rate_hz"]:.3g} Hz. '
    )
    if len(sources) > 1:
        taken = 'measured' if plan['velocity_source'] == 'measured' else 'differentiated'
        text += f'The {taken} velocity predicts held-out stretches better and was taken. '
    return text + (
        'The curve shows what each cut-off loses on held-out stretches, summed over all bands; '
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
    axes.set(xscale='log', yscale='log', xlabel='cut-off [Hz]', ylabel='1 + regret [nat]')
    axes.legend(fontsize='small')
    return figure


def draw_prediction(found: Identification, name: str) -> Figure:
    """Draw the target of every joint over the first seconds of what was held out."""
    data = found.held[name]
    method = 'SGP' if 'SGP' in found.fits else next(iter(found.fits))
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
    figure.suptitle(f'{found.robot.target} of {name}: measured, and predicted by {method}')
    return figure


def _rows(findings: Mapping[str, Any], name: str) -> list[dict[str, Any]]:
    rows = []
    for joint in findings['joints']:
        cells = []
        for scores in findings['scores'].values():
            cell = scores[name].get('joints', {}).get(joint)
            cells.append(
                {'nmse': '', 'coverage': ''} if cell is None else
                {'nmse': f'{cell["nmse"]:.3g}', 'coverage': f'{100 * cell["coverage95"]:.0f} %'}
            )  # fmt: skip
        rows.append({'joint': joint, 'cells': cells})
    return rows


def _inputs(findings: Mapping[str, Any]) -> str:
    if findings['inputs'] is None:
        return ''
    said = zip(findings['joints'], findings['inputs'], strict=True)
    return '; '.join(
        f'{joint}: ' + (', '.join(n.removeprefix('own:') for n in names) or 'nothing')
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
    reasons = {
        'not_excited': 'not determined by this motion',
        'structural': 'known only in combination with others',
    }
    row = {
        'name': p['name'], 'unit': p['unit'], 'known': p['identifiable'], 'value': '',
        'interval': reasons.get(p['status'], 'not determined by this motion'),
        'consistent': _short(p.get('consistent')),
    }  # fmt: skip
    if p['std'] is not None:
        half = INTERVAL_95 * p['std']
        row['value'] = f'{p["value"]:.5g}'
        row['interval'] = f'{p["value"] - half:.4g} to {p["value"] + half:.4g}'
    return row


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
