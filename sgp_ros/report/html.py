"""The page of a run through the online engine, opening with the finding in a sentence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from sgp_ros.engine.engine import Engine
from sgp_ros.gp.scores import INTERVAL_95
from sgp_ros.report.charts import Chart
from sgp_ros.report.figures import History, draw_all, write_figures
from sgp_ros.report.files import write_text
from sgp_ros.report.next_steps import Steps
from sgp_ros.report.page import render_page
from sgp_ros.report.robot_picture import picture_of_robot
from sgp_ros.report.run_charts import run_charts

MEANINGS = {
    'late': 'older than a state that was already used',
    'duplicate': 'a stamp that was already used',
    'stale': 'the numbers of the state before it, sent again while joints move',
    'nonfinite': 'NaN or infinite where a number is needed',
    'unpaired': 'no command at or before it, or one that is too old, and no measured effort',
    'unknown_joint': 'a joint of the robot is not in the message',
    'gap': 'the first state after a pause longer than max_gap',
    'wrong_length': 'the numbers of positions, velocities or efforts and of names differ',
    'clock': 'a stamp far from those of the other states',
    'implausible': 'far beyond the limits of position, speed or effort in the model file',
    'reset': 'still waiting to be sorted when everything was reset on request',
    'error': 'an internal error of this package; please report it',
}


def write_report(
    out: Path,
    engine: Engine,
    history: History,
    metrics: Mapping[str, Any],
    *,
    truth: Mapping[str, float] | None = None,
    checks: Sequence[str] = (),
    steps: Steps = (),
) -> list[Path]:
    """Write `report.html` and the figures as PNG and SVG into `out`; return the page and the PNG.

    Args:
        out: folder.
        engine: after the run.
        history: of the run.
        metrics: as `collect_metrics` gives them.
        truth: true values of parameters by name, where known.
        checks: sentences to stand below the verdict.
        steps: what to do next.
    """
    figures = write_figures(out, draw_all(engine, history, truth))
    paths = [out / f'{name}.png' for name in figures]
    charts = run_charts(engine, history, truth or {})
    picture = _picture(engine, history, metrics)
    page = render(engine, metrics, charts, figures, truth or {}, checks, steps, picture)
    paths.append(out / 'report.html')
    write_text(paths[-1], page)
    return paths


def render(
    engine: Engine,
    metrics: Mapping[str, Any],
    charts: Mapping[str, Chart],
    figures: Mapping[str, bytes],
    truth: Mapping[str, float],
    checks: Sequence[str],
    steps: Steps = (),
    picture: str = '',
) -> str:
    """Return the page as HTML; every text in it is escaped, names in the picture are already."""
    samples = metrics['samples']
    timing = metrics['timing']
    return render_page(
        'run.html', charts, figures,
        title=f'{metrics["robot"]} identified from {metrics["recording"]}',
        subtitle=engine.robot.description,
        verdict=verdict(metrics),
        picture=Markup(picture),  # noqa: S704 - names in it are escaped
        target=engine.robot.target,
        checks=list(checks),
        cards=_cards(metrics),
        predictions=[name for name in charts if name.startswith(('acceleration ', 'effort '))],
        parameter_charts=[name for name in charts if name.startswith('parameter ')],
        scores=_scores(metrics),
        parameters=[_parameter_row(p, metrics, truth) for p in metrics['parameters']],
        parameter_note=_parameter_note(metrics),
        has_truth=bool(truth),
        counts=(
            f'{samples["read"]} states read, {samples["used"]} used; '
            f'{metrics["commands"]["read"]} commands read, '
            f'{sum(metrics["commands"]["refused"].values())} refused. '
            f'The filter averages over a window; predictions lag {metrics["delay_s"]:.3g} s '
            'behind the newest state.'
        ),
        refusals=[
            {'reason': reason, 'count': count, 'meaning': MEANINGS[reason]}
            for reason, count in samples['refused'].items()
            if count
        ],
        remarks=metrics['remarks'],
        timing=(
            f'A message took {timing["push_ms"]["p50"]:.3g} ms (median), '
            f'{timing["push_ms"]["p99"]:.3g} ms (99th percentile); the run was '
            f'{timing["realtime_factor"]:.3g} times faster than real time.'
        ),
        settings=sorted(metrics['settings'].items()),
        next_steps=list(steps),
        versions=list(metrics['versions'].items()),
    )  # fmt: skip


def _picture(engine: Engine, history: History, metrics: Mapping[str, Any]) -> str:
    """Return the robot in the middle of its motion, coloured by the physics' residual."""
    robot = engine.robot
    left = {
        joint: scores[robot.target]['nmse']
        for joint, scores in metrics['physics_alone'].items()
        if robot.target in scores
    }
    total = sum(left.values())
    shares = {joint: x / total for joint, x in left.items()} if total > 0.0 else {}
    rows = [e.position for e in history.estimates]  # n of (k,)
    middle = np.median(rows, axis=0) if rows else np.zeros(len(robot.joints))
    posture = dict(zip(robot.joint_names, middle.tolist(), strict=True))
    what = 'share of the residual of the physics alone by joint'
    return picture_of_robot(robot, posture, shares, what)


def _cards(metrics: Mapping[str, Any]) -> list[dict[str, str]]:
    """Return for each joint the error of SGP beside that of the physics alone."""
    cards = []
    for joint, channels in metrics['joints'].items():
        for channel, score in channels.items():
            alone = metrics['physics_alone'].get(joint, {}).get(channel)
            if alone is not None:
                cards.append({
                    'value': f'{alone["nmse"]:.2g} -> {score["nmse"]:.2g}',
                    'label': f'nMSE of the {channel} of {joint}: physics alone -> SGP',
                })  # fmt: skip
    return cards


def verdict(metrics: Mapping[str, Any]) -> str:
    """Say in a sentence how well the model predicts; of several joints, from best to worst."""
    scores: dict[str, list[tuple[float, float, str]]] = {}
    for joint, channels in metrics['joints'].items():
        for channel, score in channels.items():
            spread = 100 * score['nmse'] ** 0.5
            scores.setdefault(channel, []).append((spread, 100 * score['coverage95'], joint))
    if not scores:
        return 'Nothing could be predicted from this recording.'
    parts = []
    for channel, found in scores.items():
        best, worst = min(found), max(found)
        reach = '' if len(found) == 1 else f'{best[0]:.2g} % ({best[2]}) to '
        inside = [round(share, 1) for _, share, _ in found]
        least, most = min(inside), max(inside)
        shares = f'{least:.1f}' if least == most else f'{least:.1f} to {most:.1f}'
        parts.append(
            f'the {channel} to {reach}{worst[0]:.2g} % ({worst[2]}) of its spread, with '
            f'{shares} % of the measurements inside the 95 % interval'
        )
    return f'The model predicts {"; ".join(parts)}.'


def _scores(metrics: Mapping[str, Any]) -> list[dict[str, str]]:
    rows = []
    for joint, channels in metrics['joints'].items():
        for channel, score in channels.items():
            alone = metrics['physics_alone'].get(joint, {}).get(channel)
            rows.append(
                {
                    'joint': joint,
                    'channel': channel,
                    'nmse': f'{score["nmse"]:.3g}',
                    'baseline': f'{alone["nmse"]:.3g}' if alone else '',
                    'coverage': f'{100 * score["coverage95"]:.1f} %',
                    'nlpd': f'{score["nlpd"]:.3g}',
                    'n': str(score['n']),
                }
            )
    return rows


def _parameter_row(
    parameter: Mapping[str, Any], metrics: Mapping[str, Any], truth: Mapping[str, float]
) -> dict[str, Any]:
    name, value, std = parameter['name'], parameter['value'], parameter['std']
    alone = {p['name']: p['value'] for p in metrics['physics_parameters']}
    row = {
        'name': name,
        'meaning': parameter['meaning'],
        'joint': parameter['joint'] or '',
        'unit': parameter['unit'],
        'known': parameter['identifiable'],
        'value': f'{value + 0.0:.5g}' if parameter['identifiable'] else '',
        'interval': 'not determined by this motion',
        'physics': f'{alone[name] + 0.0:.5g}' if name in alone else '',
        'truth': f'{truth[name]:.5g}' if name in truth else '',
        'inside': '',
        'missed': False,
    }
    if std is not None:
        half = INTERVAL_95 * std
        row['interval'] = f'{value - half:.5g} to {value + half:.5g}'
        if name in truth:
            row['missed'] = abs(value - truth[name]) > half
            row['inside'] = 'outside' if row['missed'] else 'inside'
    return row


def _parameter_note(metrics: Mapping[str, Any]) -> str:
    if metrics['settings']['parameters.source'] == 'physics':
        return (
            'The values come from a fit of the physics alone, as the process Z could take over '
            'what the parameters explain. Their intervals assume that the model is complete.'
        )
    return (
        'The values were estimated together with the process Z. The last column is a fit of the '
        'physics alone to the same samples: where the two differ by more than the interval, '
        'physics is missing, or Z takes over part of what the parameters explain.'
    )
