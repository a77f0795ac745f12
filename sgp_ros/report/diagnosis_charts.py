"""The charts of a diagnosis: efforts, roll-outs, maps, bands and laws as data for its page."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from sgp_ros.diagnosis.result import Diagnosis, Finding
from sgp_ros.diagnosis.shown import Band
from sgp_ros.report.charts import Cells, Chart, Series, kept, spoken, spread_rows
from sgp_ros.report.diagnosis_curves import (
    abscissa,
    acting,
    broken,
    forces_of,
    law_curve,
    leading,
    zoomed,
)
from sgp_ros.report.diagnosis_maps import (
    DIRECTIONS,
    cells_of,
    important_joints,
    position_unit,
    reach_of,
    variable_units,
)
from sgp_ros.report.diagnosis_text import UNKNOWN, effect_name, is_calm
from sgp_ros.report.law_search import search_chart
from sgp_ros.report.overlay_charts import FINAL, NOMINAL, motion_charts, overlaid

_TONES = ('law1', 'law2', 'law3')
_MOST_LAWS = 4


def diagnosis_charts(found: Diagnosis) -> dict[str, Chart]:
    """Return the charts of a diagnosis by name, in the order of its page."""
    charts: dict[str, Chart] = {}
    for j in important_joints(found):
        name = found.joints[j]
        charts |= (
            motion_charts(found, j) if overlaid(found) else {f'effort {name}': _efforts(found, j)}
        )
        charts[f'left {name}'] = _left(found, j)
        charts |= {f'map {when} {name}': chart for when, chart in _maps(found, j)}
        own = [b for b in found.bands if b.joint == name]
        charts |= {f'band {b.variable} {name}': _band(found, b, j) for b in own}
    laws = sorted(forces_of(found), key=lambda pair: -pair[0].share)[:_MOST_LAWS]
    for i, (finding, force) in enumerate(laws):
        charts[f'law {found.findings.index(finding)}'] = _law(found, i, finding, force)
    charts |= {f'search {s.joint}': search_chart(s) for s in found.law_searches}
    for f in found.findings:
        is_searched = f'search {f.joint}' in charts
        if f.effect == UNKNOWN and f.joint in found.joints and not is_searched:
            charts[f'shape {f.joint}'] = _shape(found, found.joints.index(f.joint))
    return charts


def _efforts(found: Diagnosis, j: int) -> Chart:
    """Return the effort that acted, and what the models need for the same motion."""
    traces, unit, name = found.traces, found.units[j], found.joints[j]
    acted, before, after = (
        broken(found, x[:, j])
        for x in (traces.effort, traces.effort + traces.before, traces.effort + traces.after)
    )
    series = [('acted', acted, 'measured', 'thick'), (NOMINAL, before, 'nominal', 'dashed')]
    if not is_calm(found):
        series.append((FINAL, after, 'final', 'line'))
    rows = kept([y for _, y, *_ in series])
    low, high = np.nanmin(acted), np.nanmax(acted)
    return Chart(
        f'Effort on {name}: what acted, and what each model needs for this motion',
        f'Effort on {name} over {spoken(float(np.ptp(traces.time)))} s: what acted lies between '
        f'{spoken(low)} and {spoken(high)} {unit}.'
        + _misses(found, j),
        'time [s]', f'effort [{unit}]', traces.time[rows],
        [Series(label, y[rows], tone, style) for label, y, tone, style in series],
        group='train', view=_busiest(found),
    )  # fmt: skip


def _misses(found: Diagnosis, j: int) -> str:
    """Return the errors of the effort as a sentence after a blank; empty where unknown."""
    proof, name, unit = found.proofs['train'], found.joints[j], found.units[j]
    before, after = (proof.rms(f'nmse_{when}').get(name) for when in ('before', 'after'))
    if before is None or after is None:
        return ''
    text = f' The {NOMINAL} is off by {spoken(before)} {unit} rms'
    return text + ('.' if is_calm(found) else f', the {FINAL} by {spoken(after)} {unit}.')


def _busiest(found: Diagnosis) -> tuple[float, float] | None:
    """Return the few seconds in which the nominal robot leaves most, of the first large joint."""
    rows = found.traces.time[zoomed(found, important_joints(found)[0])]
    return (float(rows[0]), float(rows[-1])) if rows[-1] > rows[0] else None


def _left(found: Diagnosis, j: int) -> Chart:
    """Return what the models leave of the effort, the laws that were found, and the noise."""
    traces, unit, name = found.traces, found.units[j], found.joints[j]
    curves = [(NOMINAL, traces.before[:, j], 'measured', 'thick')]
    for i, (finding, force) in enumerate(acting(found, j)):
        curves.append((effect_name(finding), force[:, j], _TONES[i % len(_TONES)], 'line'))
    if not is_calm(found):
        curves.append((FINAL, traces.after[:, j], 'final', 'line'))
    values = [broken(found, y) for _, y, *_ in curves]
    rows = kept(values)
    noise = 2.0 * float(traces.noise[j])
    shown = [(NOMINAL, traces.before[:, j]), (FINAL, traces.after[:, j])]
    shown = shown[: 1 if is_calm(found) else 2]
    return Chart(
        f'Residual of the effort on {name}',
        ', '.join(
            f'{"the" if i else "The"} {model} leaves up to {spoken(np.abs(left).max())} {unit}'
            for i, (model, left) in enumerate(shown)
        )
        + f'; two standard deviations of the encoder noise are {spoken(noise)} {unit}.',
        'time [s]', f'residual [{unit}]', traces.time[rows],
        [
            Series(label, y[rows], tone, style)
            for (label, _, tone, style), y in zip(curves, values, strict=True)
        ],
        group='train', view=_busiest(found),
    )  # fmt: skip


def _maps(found: Diagnosis, j: int) -> Iterator[tuple[str, Chart]]:
    """Yield the mean effort left over position and velocity, before and after, on one scale."""
    unit, name, reach = found.units[j], found.joints[j], reach_of(found, j)
    length = position_unit(found, j)
    shown = [('before', NOMINAL, found.traces.before), ('after', FINAL, found.traces.after)]
    for when, model, values in shown[: 1 if is_calm(found) else 2]:
        x, y, mean = cells_of(found, j, values[:, j])
        a, b = np.unravel_index(np.nanargmax(np.abs(mean)), mean.shape)
        yield when, Chart(
            f'{name}: residual of the {model}',
            f'Largest mean residual: {spoken(mean[a, b])} {unit}, at position '
            f'{spoken(0.5 * (x[a] + x[a + 1]))} {length} and velocity '
            f'{spoken(0.5 * (y[b] + y[b + 1]))} {length}/s.',
            f'position [{length}]', f'velocity [{length}/s]', cells=Cells(x, y, mean, reach),
            spans=_regions(found, name, 'position'),
        )  # fmt: skip


def _regions(found: Diagnosis, joint: str, variable: str) -> list[tuple[float, float]]:
    """Return where the findings on a joint are confined to."""
    regions: list[tuple[float, float]] = []
    for f in found.findings:
        if f.joint == joint:
            regions += [(lo, hi) for lo, hi in f.location.intervals.get(variable, [])]
            regions += f.location.time if variable == 'time' else ()
    return regions


def _band(found: Diagnosis, band: Band, j: int) -> Chart:
    """Return Z over one variable in both directions, and where it is not zero."""
    unit = variable_units(found.units[j])[band.variable]
    depends = next(d for d in found.dependences if d.joint == band.joint)
    word = 'significant' if depends.is_significant(band.variable) else 'not significant'
    where = ' and '.join(f'{spoken(lo)} to {spoken(hi)} {unit}' for lo, hi in band.regions)
    return Chart(
        f'{band.joint} over {band.variable}: {word} (p {depends.p_values[band.variable]:.2g})',
        f'Significant from {where}.' if where else 'Nowhere significantly different from zero.',
        f'{band.variable} [{unit}]', f'Z [{found.units[j]}]', band.x,
        [
            Series(label, band.mean[:, i], tone, 'line', band.half[:, i])
            for i, ((label, _), tone) in enumerate(zip(DIRECTIONS, ('law2', 'final'), strict=True))
        ],
        spans=band.regions, limit=(-reach_of(found, j), reach_of(found, j)),
    )  # fmt: skip


def _law(found: Diagnosis, i: int, finding: Finding, force: np.ndarray) -> Chart:
    """Return the force of a finding over what it depends on, and the data."""
    curve = law_curve(found, finding, force)
    unit, name = found.units[curve.joint], found.joints[curve.joint]
    order = np.argsort(curve.x, kind='stable')
    rows = order if curve.is_line else order[spread_rows(len(order))]
    style = 'line' if curve.is_line else 'points'
    off = float(np.sqrt(np.nanmean((curve.measured - curve.law) ** 2)))
    return Chart(
        f'{effect_name(finding)} on {name}',
        f'Data and law over {curve.label}: the law reaches '
        f'{spoken(np.nanmax(np.abs(curve.law)))} {unit} and misses the data by {spoken(off)} '
        f'{unit} (root mean square).',
        curve.label, f'effort [{unit}]', curve.x[rows],
        [
            Series('measured', curve.measured[rows], 'measured', style),
            Series('the law', curve.law[rows], _TONES[i % len(_TONES)], style),
        ],
        spans=_regions(found, name, 'position') if 'position' in curve.label else (),
    )  # fmt: skip


def _shape(found: Diagnosis, j: int) -> Chart:
    """Return the unnamed force over its most important variable, in both directions."""
    name, unit = found.joints[j], found.units[j]
    depends = next(d for d in found.dependences if d.joint == name)
    unknown = next(f for f in found.findings if f.effect == UNKNOWN and f.joint == name)
    x, label = abscissa(found, unknown, j, leading(depends.scores))
    order = np.argsort(x, kind='stable')
    rows = order[spread_rows(len(order))]
    y, forward = found.traces.parameters[rows, j], found.traces.velocity[rows, j] > 0.0
    return Chart(
        f'Unexplained residual on {name}',
        f'Residual over {label}: up to {spoken(np.abs(y).max())} {unit}.',
        label, f'residual [{unit}]', x[rows],
        [
            Series('forward', np.where(forward, y, np.nan), 'final', 'points'),
            Series('backward', np.where(forward, np.nan, y), 'law2', 'points'),
        ],
    )  # fmt: skip
