"""The page of a diagnosis, which opens with the finding in one sentence."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from sgp_ros.diagnosis.result import Diagnosis, Finding, ParameterError
from sgp_ros.diagnosis.shown import Predictions
from sgp_ros.gp.scores import INTERVAL_95
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.report.charts import Chart
from sgp_ros.report.diagnosis_cards import cards, joint_shares, share_rows
from sgp_ros.report.diagnosis_charts import diagnosis_charts
from sgp_ros.report.diagnosis_figures import draw_diagnosis
from sgp_ros.report.diagnosis_maps import band_sentences, important_joints
from sgp_ros.report.diagnosis_proof import (
    columns,
    densities,
    errors_in_units,
    near_and_far,
    proof_rows,
    rollouts_sentences,
)
from sgp_ros.report.diagnosis_text import (
    chance,
    differences_text,
    effect_name,
    equivalence_sentences,
    is_calm,
    numbers,
    percent,
    place,
    quantity,
    visibility_sentences,
)
from sgp_ros.report.figures import write_figures
from sgp_ros.report.files import write_text
from sgp_ros.report.html import MEANINGS
from sgp_ros.report.law_search import search_rows
from sgp_ros.report.metrics import versions
from sgp_ros.report.next_steps import Steps
from sgp_ros.report.overlay_charts import motion_columns, motion_rows
from sgp_ros.report.page import render_page
from sgp_ros.report.robot_picture import robot_picture
from sgp_ros.report.verdict import held_out_sentence, verdict_sentence
from sgp_ros.rigid.tree import Tree

_NAMED = ('kind', 'source_joint', 'encoder')
"""Parameters that are part of the name of an effect."""
_SHOWN_RIVALS, _SHOWN_VARIABLES = 4, 5
_FAR_ABOVE = 1.5
"""Ratio of the share of an effect to what was left, from which the page says why."""
_VERDICTS = {
    'missing_physics': 'Physics is missing',
    'parameters_only': 'Only parameters are wrong',
    'no_mismatch': 'No mismatch',
    'unexplained': 'Unexplained',
    'setup_error': 'Set-up error',
}


def write_diagnosis(
    out: Path, found: Diagnosis, tree: Tree | None = None, steps: Steps = ()
) -> None:
    """Write `report.html` and its figures as PNG and SVG into `out`.

    Args:
        out: folder.
        found: the diagnosis.
        tree: of the robot, for its picture; None for none.
        steps: what to do next.
    """
    figures = write_figures(out, draw_diagnosis(found))
    picture = '' if tree is None else picture_of(found, tree)
    write_text(out / 'report.html', render(found, figures, picture, steps))


def render(
    found: Diagnosis, figures: Mapping[str, bytes], picture: str = '', steps: Steps = ()
) -> str:
    """Return the page as HTML; every text in it is escaped.

    Args:
        found: the diagnosis.
        figures: PNG by stem.
        picture: of the robot, an `svg` element.
        steps: what to do next.
    """
    charts = diagnosis_charts(found)
    large = [found.joints[j] for j in important_joints(found)]
    shown = {name: x for name, x in figures.items() if name != 'dependence'}  # bars of the page
    return render_page(
        'diagnosis.html', charts, shown,
        title=f'{_title(found)}: diagnosis of {found.robot}',
        verdict=verdict_sentence(found),
        held_out='' if len(found.proofs) > 1 else held_out_sentence(found),
        cards=cards(found),
        picture=Markup(picture),  # noqa: S704 - names in it are escaped
        shares=share_rows(found),
        large=large,
        regions=band_sentences(found, large),
        has_bands=any(name.startswith('band ') for name in charts),
        bands=[name for name in charts if name.startswith('band ')],
        shapes=[name for name in charts if name.startswith('shape ')],
        dependences=_dependences(found, large) if found.findings else [],
        is_calm=is_calm(found),
        setup=[_finding(f) | {'share': ''} for f in found.setup],
        findings=[
            _finding(f, _chart_of(found, f, charts)) | _cancelled(found, f) for f in found.findings
        ],
        shared=[_finding(f) for f in found.shared],
        rivals=[_rival(f) for f in found.alternatives[:_SHOWN_RIVALS]],
        more_rivals=[_rival(f) for f in found.alternatives[_SHOWN_RIVALS:]],
        differences=differences_text(found),
        equivalents=equivalence_sentences(found),
        hidden=visibility_sentences(found),
        is_unexplained=found.verdict == 'unexplained',
        errors=[_error(e) for e in found.parameter_errors],
        searches=search_rows(found),
        columns=columns(found),
        errors_in_units=errors_in_units(found),
        motion_columns=motion_columns(found),
        motion_rows=motion_rows(found),
        proofs=proof_rows(found),
        rollouts=rollouts_sentences(found),
        near_and_far=near_and_far(found),
        densities=densities(found),
        **_data_quality(found),
        next_steps=list(steps),
        versions=list(versions().items()),
    )  # fmt: skip


def picture_of(found: Diagnosis, tree: Tree) -> str:
    """Return the robot as it stood in the middle of its motion; pale where nothing is wrong."""
    shares = {} if is_calm(found) else dict(joint_shares(found))
    return robot_picture(tree, np.median(found.traces.position, axis=0), shares)


def _dependences(found: Diagnosis, joints: Sequence[str]) -> list[dict[str, Any]]:
    """Return the variables that explain most of the discrepancy of each joint."""
    return [
        {'joint': d.joint, 'rows': [
            {'name': name, 'share': max(d.scores[name], 0.0),
             'percent': percent(max(d.scores[name], 0.0)),
             'is_significant': d.is_significant(name)}
            for name in sorted(d.scores, key=lambda name: -d.scores[name])[:_SHOWN_VARIABLES]
        ]}
        for d in found.dependences if d.joint in joints
    ]  # fmt: skip


def _title(found: Diagnosis) -> str:
    """Return the verdict in three words, behind an error of the set-up that is beside it."""
    said = _VERDICTS[found.verdict]
    if found.setup and found.verdict != 'setup_error':
        return f'{_VERDICTS["setup_error"]}; {said[:1].lower()}{said[1:]}'
    return said


def _chart_of(found: Diagnosis, finding: Finding, charts: Mapping[str, Chart]) -> str:
    """Return the name of the chart of a finding's law; empty where there is none."""
    name = f'law {found.findings.index(finding)}'
    return name if name in charts else ''


def _cancelled(found: Diagnosis, f: Finding) -> dict[str, str]:
    """Return the share of an effect in words where it is far above all that was left at its joint.

    The share is of the mean square, and what was left of the variance, which is no larger.
    """
    left = found.proofs['train'].nmse_before.get(f.joint, math.inf)
    is_force = f.effect not in EFFECTS or EFFECTS[f.effect].is_force
    if not is_force or f.share <= _FAR_ABOVE * left:
        return {}
    return {
        'share': f'it accounts for {percent(f.share)} of the mean squared effort, more than the '
        'nominal robot leaves: other effects or bodies cancel part of it'
    }


def _finding(f: Finding, chart: str = '') -> dict[str, Any]:
    named = effect_name(f)
    measured = 'variance of the velocity'
    if f.effect not in EFFECTS or EFFECTS[f.effect].is_force:
        measured = 'mean squared effort'
    return {
        'name': named[:1].upper() + named[1:],
        'place': place(f),
        'chart': chart,
        'probability': f'{f.probability:.2f}',
        'share': f'it accounts for {percent(f.share)} of the {measured}',
        'formula': f.formula,
        'why': f.why[:1].upper() + f.why[1:],
        'is_compared': bool(f.in_simulation),
        'parameters': [
            {
                'name': name.replace('_', ' '),
                'value': quantity(p),
                'simulated': quantity(f.in_simulation[name]) if name in f.in_simulation else '',
                'difference': quantity(f.difference[name]) if name in f.difference else '',
            }
            for name, p in f.parameters.items()
            if name not in _NAMED
        ],
        'where': [
            f'{name} from {lo:.3g} to {hi:.3g}'
            for name, intervals in f.location.intervals.items()
            for lo, hi in intervals
        ]
        + [f'time from {lo:.3g} s to {hi:.3g} s' for lo, hi in f.location.time],
    }


def _rival(f: Finding) -> dict[str, str]:
    return {
        'name': effect_name(f),
        'joint': f.joint,
        'numbers': ', '.join(numbers(f)),
        'probability': chance(f.probability),
        'why': f.why,
    }


def _error(e: ParameterError) -> dict[str, str]:
    half = INTERVAL_95 * e.std
    return {
        'name': f'{e.parameter.replace("_", " ")} of {e.link}',
        'value': f'{e.value:.4g}',
        'interval': f'{e.value - half:.4g} to {e.value + half:.4g}',
        'nominal': f'{e.nominal:.4g}',
        'unit': e.unit,
    }


def _data_quality(found: Diagnosis) -> dict[str, Any]:
    return {
        'settings': _settings(found),
        'refusals': [
            {'reason': reason, 'count': count, 'meaning': MEANINGS.get(reason, '')}
            for reason, count in found.refused.items()
            if count
        ],
        'remarks': list(found.remarks),
    }


def _settings(found: Diagnosis) -> list[tuple[str, str]]:
    settings = [
        ('robot', found.robot),
        ('joints', ', '.join(found.joints)),
        ('cut-off of the low-pass', f'{found.cutoff_hz:.3g} Hz'),
        ('rows', f'{found.rows}, at {found.rate_hz:.3g} Hz'),
    ]
    if found.simulation:
        shares = ', '.join(f'{joint} {percent(x)}' for joint, x in found.simulation.items())
        settings.append(('residual of the robot file on the simulation', shares))
    return settings


def write_predictions(folder: Path, found: Diagnosis) -> None:
    """Write `pred_<stem>.csv` for each held-out recording."""
    for stem, prediction in found.predictions.items():
        write_text(folder / f'pred_{stem}.csv', _predictions_table(found.joints, prediction))


def _predictions_table(joints: tuple[str, ...], prediction: Predictions) -> str:
    lines = [','.join(['t', *(f'ddq_{name}' for name in joints)])]
    for t, row in zip(prediction.time, prediction.acceleration, strict=True):
        lines.append(','.join([f'{t:.6f}', *(f'{x:.7g}' for x in row)]))
    return '\n'.join(lines) + '\n'
