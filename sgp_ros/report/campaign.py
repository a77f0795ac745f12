"""The page of a campaign: what changed first, then small multiples, then every recording."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from datetime import datetime, timezone
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from sgp_ros.campaign.trends import PER_DAY, WARM_UP, Trend
from sgp_ros.report.charts import Chart, Series, spoken
from sgp_ros.report.figures import GREY, PREDICTED, png
from sgp_ros.report.metrics import versions
from sgp_ros.report.page import render_page

_MOST_CHARTS = 24
_COLUMNS = 3
_WORDS = {'no_mismatch': 'no mismatch', 'parameters_only': 'wrong parameters only',
          'setup_error': 'set-up error', 'missing_physics': 'missing physics'}  # fmt: skip


def render_campaign(
    content: Mapping[str, Any],
    results: Sequence[Mapping[str, Any]],
    rows: Sequence[Mapping[str, Any]],
    trends: Sequence[Trend],
) -> str:
    """Return the page as HTML; every text in it is escaped.

    Args:
        content: of campaign.json.
        results: of the recordings.
        rows: of the table of results.
        trends: of all quantities.
    """
    shown = sorted(trends, key=lambda trend: trend.chance)[:_MOST_CHARTS]
    order = sorted(range(len(results)), key=lambda i: results[i].get('start_ns') or math.inf)
    names = [results[i]['recording'] for i in order]
    rank = np.argsort(order)
    charts = {' '.join(trend.key): trend_chart(trend, names, rank) for trend in shown}
    sentences = trend_sentences(content['trends'])
    covariates = list(dict.fromkeys(
        term.name for trend in trends for term in trend.terms
        if term.name not in {'level', PER_DAY, WARM_UP}
    ))  # fmt: skip
    still = {'multiples': png(_multiples(list(charts.values())))} if shown else {}
    return render_page(
        'campaign.html', charts, still,
        title=f'Campaign of {len(results)} recordings',
        verdict=campaign_sentence(content),
        changes=sentences, remarks=content['remarks'],
        cards=_cards(content, results, sentences),
        bound=f'{100.0 * content["false_alarms"]:g} %',
        covariates=covariates,
        trends=[_trend_row(trend, covariates) for trend in trends],
        shown=list(charts), left_out=len(trends) - len(shown),
        recordings=[_recording_row(result, rows_of) for result, rows_of in _by_recording(
            results, rows)],
        failures=_reasons(content['failures']),
        versions=list(versions().items()),
    )  # fmt: skip


def campaign_sentence(content: Mapping[str, Any]) -> str:
    """Say in a sentence what the recordings are and how many changes there were."""
    verdicts = ', '.join(
        f'{n} {_WORDS.get(name, name)}' for name, n in sorted(content['verdicts'].items())
    )
    failed = len({f['recording'] for f in content['failures']})
    text = f'{content["recordings"]} recordings' + (f': {verdicts}' if verdicts else '')
    text += f'; {failed} failed' if failed else ''
    changed = sum(bool(t['changes'] or t['is_drift']) for t in content['trends'])
    if content['trends']:
        text += f'; {changed or "none"} of {len(content["trends"])} frictions and gains changed'
    return f'{text}.'


def trend_sentences(trends: Sequence[Mapping[str, Any]]) -> list[str]:
    """Say of each quantity that changed when, and by how much; `+-` is for 95 %."""
    said = []
    for t in trends:
        terms = {term['name']: term for term in t['terms']}
        level, name = terms['level']['value'], quantity(t['joint'], t['effect'], t['parameter'])
        for c in t['changes']:
            where = f'between {c["first"]} and {c["last"]}' * (c['first'] != c['last'])
            said.append(
                f'{name} of {c["robot"]} changed by {_share(c, "size", level)} at '
                f'{c["recording"]}{f" ({where})" if where else ""}; chance {c["chance"]:.1g}'
            )
        if t['is_drift']:
            said.append(
                f'{name} drifts by {_share(terms[PER_DAY], "value", level)} a day; '
                f'chance {t["chance"]:.1g}'
            )
    return said


def trend_chart(trend: Trend, names: Sequence[str], rank: np.ndarray) -> Chart:
    """Return the estimates of a quantity and the fit over the recordings.

    Args:
        trend: of the quantity.
        names: (m,) of the recordings in the order of time.
        rank: (m,) place in that order of each recording.
    """
    rows = np.argsort(rank[trend.rows])
    spans = [(names.index(c.first) - 0.5, names.index(c.last) + 0.5) for c in trend.changes]
    level = trend.terms[0]
    said = f'Level {spoken(level.value)} {trend.unit}, {len(trend.rows)} recordings'
    said += f', changed at {_changes(trend)}' if spans else ', a drift' * trend.is_drift
    return Chart(
        quantity(*trend.key[1:]), f'{said}.', 'recording', f'[{trend.unit}]',
        rank[trend.rows][rows].astype(float),
        [Series('estimate', trend.value[rows], 'soft', 'points'),
         Series('fit', trend.fitted[rows], 'final', 'line')],
        spans=spans, group='campaign',
    )  # fmt: skip


def _multiples(charts: Sequence[Chart]) -> Figure:
    """Draw all charts beside each other, for paper and readers without scripts."""
    rows = math.ceil(len(charts) / _COLUMNS)
    figure = Figure(figsize=(10, 2.3 * rows), layout='constrained')
    for i, chart in enumerate(charts):
        axes = figure.add_subplot(rows, _COLUMNS, i + 1)
        axes.plot(chart.x, chart.series[0].y, '.', color=GREY, markersize=3)
        axes.plot(chart.x, chart.series[1].y, color=PREDICTED, linewidth=1)
        for ends in chart.spans:
            axes.axvspan(*ends, color=GREY, alpha=0.3)
        axes.set_title(chart.title, fontsize=8)
        axes.set_ylabel(chart.y_label, fontsize=7)
        axes.tick_params(labelsize=7)
    return figure


def quantity(joint: str, effect: str, parameter: str) -> str:
    """Return what a friction or gain is called."""
    what = f'{effect.replace("_", " ")} {parameter}'.strip()
    return what if what.startswith(joint) else f'{what} of {joint}'


def _changes(trend: Trend) -> str:
    return '; '.join(c.recording for c in trend.changes) or ('drift' if trend.is_drift else '')


def _share(number: Mapping[str, Any], key: str, level: float) -> str:
    """Return a change in percent of the level with its 95 % interval."""
    half = 0.5 * (number['high'] - number['low'])
    scale = 100.0 / abs(level) if level else math.nan
    return f'{scale * number[key]:+.3g} +- {scale * half:.2g} %'


def _cards(
    content: Mapping[str, Any], results: Sequence[Mapping[str, Any]], changes: Sequence[str]
) -> list[tuple[str, str]]:
    hours = sum(result.get('duration_s') or 0.0 for result in results) / 3600.0
    robots = len({result['robot'] for result in results})
    return [
        (str(len(results)), f'recordings of {robots} {"robot" if robots == 1 else "robots"}'),
        (f'{hours:.3g} h', 'recorded'),
        (str(len({f['recording'] for f in content['failures']})), 'recordings failed'),
        (str(len(changes)), f'{"change" if len(changes) == 1 else "changes"} beyond chance'),
    ]


def _trend_row(trend: Trend, covariates: Sequence[str]) -> dict[str, Any]:
    """Return the cells of a row: text and the number that it is sorted by."""
    terms = {term.name: term for term in trend.terms}
    level = terms['level'].value

    def cell(name: str) -> tuple[str, float | str]:
        if name not in terms:
            return '', ''
        t = {'value': terms[name].value, 'low': terms[name].low, 'high': terms[name].high}
        return _share(t, 'value', level), t['value'] / level if level else 0.0

    half = 0.5 * (terms['level'].high - terms['level'].low)
    return {
        'what': quantity(*trend.key[1:]), 'n': len(trend.rows), 'change': _changes(trend),
        'cells': [
            (f'{trend.chance:.1g}', trend.chance),
            (f'{level:.4g} +- {half:.2g} {trend.unit}', level), cell(PER_DAY), cell(WARM_UP),
            (f'{trend.tau_s / 60.0:.3g}', trend.tau_s) if trend.tau_s else ('', ''),
            *(cell(name) for name in covariates),
        ],
        'remarks': '; '.join(trend.remarks),
    }  # fmt: skip


def _by_recording(
    results: Sequence[Mapping[str, Any]], rows: Sequence[Mapping[str, Any]]
) -> list[tuple[Mapping[str, Any], list[Mapping[str, Any]]]]:
    found: dict[str, list[Mapping[str, Any]]] = {result['recording']: [] for result in results}
    for row in rows:
        found[row['recording']].append(row)
    return [(result, found[result['recording']]) for result in results]


def _recording_row(result: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    verdict = next((row for row in rows if row['kind'] == 'verdict'), {})
    found = {f'{row["effect"]} of {row["joint"]}'.replace('_', ' '): row['probability']
             for row in rows if row['kind'] in {'finding', 'setup'}}  # fmt: skip
    start = result.get('start_ns')
    name = verdict.get('verdict', '')
    return {
        'recording': result['recording'], 'robot': result['robot'],
        'start': '' if start is None else datetime.fromtimestamp(
            1e-9 * start, timezone.utc).strftime('%Y-%m-%d %H:%M'),
        'start_ns': start or 0,
        'length': f'{result["duration_s"]:.4g}' if result.get('duration_s') else '',
        'verdict': _WORDS.get(name, name),
        'certainty': '' if verdict.get('certainty') is None else f'{verdict["certainty"]:.2f}',
        'found': '; '.join(f'{what} ({p:.2f})' for what, p in found.items()),
        'failure': '; '.join(dict.fromkeys(r['failure'] for r in rows if r['kind'] == 'failure')),
    }  # fmt: skip


def _reasons(failures: Sequence[Mapping[str, str]]) -> list[tuple[int, str, str]]:
    """Return how many recordings failed for each reason, and one of them; names left out."""
    counts: dict[str, list[str]] = {}
    for f in failures:
        reason = f['failure'].replace(f['recording'], 'RECORDING')
        counts.setdefault(reason, []).append(f['recording'])
    found = [(len(set(names)), reason, names[0]) for reason, names in counts.items()]
    return sorted(found, key=lambda entry: -entry[0])
