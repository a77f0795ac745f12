"""The page of an identification from a whole recording, and its figures."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure

from sgp_ros.batch.identification import Identification
from sgp_ros.gp.scores import INTERVAL_95
from sgp_ros.report.charts import Chart
from sgp_ros.report.figures import BAND, GREY, MEASURED, PREDICTED, write_figures
from sgp_ros.report.files import write_text
from sgp_ros.report.identification_text import (
    called,
    cautions,
    drawn,
    excitation,
    filter_sentence,
    unknown,
    verdict,
)
from sgp_ros.report.next_steps import Steps
from sgp_ros.report.page import render_page
from sgp_ros.report.robot_picture import robot_picture
from sgp_ros.report.run_charts import filter_chart, identification_charts
from sgp_ros.rigid.tree import Tree

_SHOWN_S = 12.0
_MOST_CARDS = 4


def write_identification(
    out: Path,
    found: Identification,
    findings: Mapping[str, Any],
    steps: Steps = (),
    tree: Tree | None = None,
) -> None:
    """Write `report.html` and the figures as PNG and SVG into `out`.

    Args:
        out: folder.
        found: the identification.
        findings: its numbers.
        steps: what to do next.
        tree: of the robot, for its picture; None for none.
    """
    drawings = {'filter': draw_filter(findings['filter'])}
    for name in found.held:
        drawings[f'prediction_{_stem(name)}'] = draw_prediction(found, name)
    figures = write_figures(out, drawings)
    charts = identification_charts(found, drawn(found.fits))
    charts['filter'] = filter_chart(findings['filter'])
    picture = '' if tree is None else picture_of(found, findings, tree)
    page = render(found.robot.description, findings, figures, charts, steps, picture=picture)
    write_text(out / 'report.html', page)


def render(
    description: str,
    findings: Mapping[str, Any],
    figures: Mapping[str, bytes],
    charts: Mapping[str, Chart] = MappingProxyType({}),
    steps: Steps = (),
    *,
    picture: str = '',
) -> str:
    """Return the page as HTML; every text in it is escaped, names in the picture are already."""
    regions = list(findings['rows'])
    return render_page(
        'identification.html', charts, figures,
        title=f'{findings["robot"]} identified from {findings["recording"]}',
        subtitle=description,
        verdict=verdict(findings),
        cautions=cautions(findings),
        held_note=f'No method was fitted to {" or ".join(map(called, findings["held_out"]))}. '
        'Near and far are the halves of its rows whose states lie closer to, and further from, '
        'those learned from.',
        predictions=[name for name in charts if name.startswith('held ')],
        stills=[name for name in figures if name.startswith('prediction_')],
        picture=Markup(picture),  # noqa: S704 - names in it are escaped
        cards=_cards(findings),
        target=findings['target'],
        tables=[
            {
                'title': 'Learned from' if name == 'train' else called(name),
                'rows': _rows(findings, name), 'is_open': name in findings['held_out'],
            }
            for name in sorted(regions, key=lambda name: name not in findings['held_out'])
        ],
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
        counts=', '.join(f'{value} {key}' for key, value in findings['counts'].items()) + '.',
        remarks=findings['remarks'],
        next_steps=list(steps),
        versions=list(findings['versions'].items()),
    )  # fmt: skip


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
    """Draw the target of every joint over the first seconds of the held-out data."""
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


def picture_of(found: Identification, findings: Mapping[str, Any], tree: Tree) -> str:
    """Return the robot in the middle of its motion, coloured by the physics' residual.

    On held-out data, each joint relative to the variance of its own target.
    """
    left = dict.fromkeys(findings['joints'], 0.0)
    for name in findings['held_out']:
        for joint, score in (
            findings['scores'].get('PR', {}).get(name, {}).get('joints', {}).items()
        ):
            left[joint] += score['nmse'] or 0.0
    total = sum(left.values())
    shares = {joint: x / total for joint, x in left.items()} if total else {}
    posture = np.median(found.data.U[:, : len(left)], axis=0)
    return robot_picture(
        tree, posture, shares, 'share of the residual of the physics alone by joint'
    )


def _cards(findings: Mapping[str, Any]) -> list[dict[str, str]]:
    """Return the errors of the joints that are predicted worst, without and with Z."""
    units, spoken = findings['units'][findings['target']], drawn(findings['scores'])
    methods = [m for m in ('PR', spoken) if m in findings['scores']]
    methods = list(dict.fromkeys(methods))
    each = [
        (score['nmse'] or 0.0, name, joint)
        for name in findings['held_out']
        for joint, score in findings['scores'][spoken][name].get('joints', {}).items()
    ]
    called_so = ' -> '.join('physics alone' if m == 'PR' else m for m in methods)
    return [
        {
            'value': ' -> '.join(
                _short(findings['scores'][m][name]['joints'][joint]['rmse']) for m in methods
            ) + f' {units[joint]}',
            'label': f'rms error of the {findings["target"]} of {joint} in {called(name)}: '
                     f'{called_so}',
        }
        for _, name, joint in sorted(each, reverse=True)[:_MOST_CARDS]
    ]  # fmt: skip


def _rows(findings: Mapping[str, Any], name: str) -> list[dict[str, Any]]:
    units = findings['units'][findings['target']]
    return [
        {
            'joint': joint, 'method': method, 'nmse': _short(cell['nmse']),
            'coverage': f'{100 * cell["coverage95"]:.0f} %',
            'rmse': f'{_short(cell["rmse"])} {units[joint]}',
        }
        for joint in findings['joints']
        for method, scores in findings['scores'].items()
        for cell in [scores[name].get('joints', {}).get(joint)] if cell is not None
    ]  # fmt: skip


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
        'name': p['name'], 'meaning': p.get('meaning', ''), 'unit': p['unit'],
        'known': p['identifiable'], 'value': '',
        'interval': unknown(p['status']),
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
