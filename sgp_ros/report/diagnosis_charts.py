"""The charts of a diagnosis: efforts, roll-outs, maps, bands and laws as data for its page."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from sgp_ros.diagnosis.result import Diagnosis, Finding
from sgp_ros.diagnosis.shown import Band, Rollouts
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
from sgp_ros.report.diagnosis_proof import recording_name
from sgp_ros.report.diagnosis_text import UNKNOWN, effect_name

NOMINAL, FINAL = 'nominal robot', 'diagnosed robot'
_TONES = ('law1', 'law2', 'law3')
_MOST_LAWS, _MOST_ROLLOUTS = 4, 8
_ROLLOUT_STEP_S = 0.015
"""Between two points of a roll-out on a page [s]."""


def diagnosis_charts(found: Diagnosis) -> dict[str, Chart]:
    """Return the charts of a diagnosis by name, in the order of its page."""
    charts: dict[str, Chart] = {}
    shown = shown_recording(found)
    motion = found.proofs[shown].motion
    for j in important_joints(found):
        name = found.joints[j]
        charts[f'effort {name}'] = _efforts(found, j)
        if motion is not None:
            charts[f'motion {name}'] = _motion(found, shown, motion, j)
        charts[f'left {name}'] = _left(found, j)
        charts |= {f'map {when} {name}': chart for when, chart in _maps(found, j)}
        own = [b for b in found.bands if b.joint == name]
        charts |= {f'band {b.variable} {name}': _band(found, b, j) for b in own}
    laws = sorted(forces_of(found), key=lambda pair: -pair[0].share)[:_MOST_LAWS]
    for i, (finding, force) in enumerate(laws):
        charts[f'law {found.findings.index(finding)}'] = _law(found, i, finding, force)
    for f in found.findings:
        if f.effect == UNKNOWN and f.joint in found.joints:
            charts[f'shape {f.joint}'] = _shape(found, found.joints.index(f.joint))
    return charts


def shown_recording(found: Diagnosis) -> str:
    """Return the held-out recording that is furthest from what was learned; else that itself."""
    held = [stem for stem in found.proofs if stem != 'train']
    return max(held, key=lambda stem: found.proofs[stem].distance) if held else 'train'


def _efforts(found: Diagnosis, j: int) -> Chart:
    """Return the effort that acted, and what the models need for the same motion."""
    traces, unit, name = found.traces, found.units[j], found.joints[j]
    acted, before, after = (
        broken(found, x[:, j])
        for x in (traces.effort, traces.effort + traces.before, traces.effort + traces.after)
    )
    series = [('acted', acted, 'measured', 'thick'), (NOMINAL, before, 'nominal', 'dashed')]
    if found.verdict != 'no_mismatch':
        series.append((FINAL, after, 'final', 'line'))
    rows = kept([y for _, y, *_ in series])
    low, high = np.nanmin(acted), np.nanmax(acted)
    return Chart(
        f'Effort on {name}: what acted, and what each model needs for this motion',
        f'Effort on {name} over {spoken(float(np.ptp(traces.time)))} s: what acted lies between '
        f'{spoken(low)} and {spoken(high)} {unit}.'
        + misses(found, 'train', 'nmse', j),
        'time [s]', f'effort [{unit}]', traces.time[rows],
        [Series(label, y[rows], tone, style) for label, y, tone, style in series],
        group='train', view=_busiest(found),
    )  # fmt: skip


def misses(found: Diagnosis, stem: str, kind: str, j: int) -> str:
    """Say by how much the models miss, in units, in a sentence after a blank; empty if unknown."""
    unit = position_unit(found, j) if kind.startswith('rollout') else found.units[j]
    proof, name = found.proofs[stem], found.joints[j]
    before, after = (proof.rms(f'{kind}_{when}').get(name) for when in ('before', 'after'))
    if before is None or after is None:
        return ''
    text = f' The {NOMINAL} misses it by {spoken(before)} {unit}'
    if found.verdict != 'no_mismatch':
        text += f', the {FINAL} by {spoken(after)} {unit}'
    return f'{text} (root mean square).'


def _motion(found: Diagnosis, stem: str, motion: Rollouts, j: int) -> Chart:
    """Return the roll-outs of both models over the position that was measured."""
    unit, name = position_unit(found, j), found.joints[j]
    step = float(motion.time[0, 1] - motion.time[0, 0])
    nodes = np.unique([*range(0, motion.time.shape[1], max(1, round(_ROLLOUT_STEP_S / step))),
                       motion.time.shape[1] - 1])  # fmt: skip
    time, curves = motion.time[:, nodes], []
    for x in (motion.measured, motion.before, motion.after):
        y = x[:, nodes, j]
        curves.append(np.hstack([y, np.full((len(y), 1), np.nan)]).ravel())
    gap = np.hstack([time, time[:, -1:] + 1e-4 * step]).ravel()  # each roll-out ends in a break
    order = np.argsort(gap, kind='stable')
    labels = (('measured', 'measured', 'thick'), (NOMINAL, 'nominal', 'dashed'),
              (FINAL, 'final', 'line'))  # fmt: skip
    series = [
        Series(label, y[order], tone, style)
        for (label, tone, style), y in zip(labels, curves, strict=True)
    ]
    if found.verdict == 'no_mismatch':
        series.pop()
    return Chart(
        f'Position of {name} on {recording_name(stem)}: measured, and simulated from there on',
        f'{len(time)} roll-outs, each from a measured state, under the recorded commands.'
        + misses(found, stem, 'rollout_nmse', j),
        'time [s]', f'position [{unit}]', gap[order], series, group='motion',
        view=_worst_stretch(motion, j),
    )  # fmt: skip


def _busiest(found: Diagnosis) -> tuple[float, float] | None:
    """Return the few seconds in which the nominal robot leaves most, of the first large joint."""
    rows = found.traces.time[zoomed(found, important_joints(found)[0])]
    return (float(rows[0]), float(rows[-1])) if rows[-1] > rows[0] else None


def _worst_stretch(motion: Rollouts, j: int) -> tuple[float, float]:
    """Return a stretch of a few roll-outs around that which the nominal robot misses most."""
    off = ((motion.before - motion.measured)[:, :, j] ** 2).sum(axis=1)
    middle = int(np.argmax(off))
    start = float(motion.time[max(0, middle - _MOST_ROLLOUTS // 2), 0])
    return start, start + _MOST_ROLLOUTS * float(np.ptp(motion.time[middle]))


def _left(found: Diagnosis, j: int) -> Chart:
    """Return what the models leave of the effort, the laws that were found, and the noise."""
    traces, unit, name = found.traces, found.units[j], found.joints[j]
    curves = [(f'{NOMINAL} leaves', traces.before[:, j], 'measured', 'thick')]
    for i, (finding, force) in enumerate(acting(found, j)):
        curves.append((effect_name(finding), force[:, j], _TONES[i % len(_TONES)], 'line'))
    if found.verdict != 'no_mismatch':
        curves.append((f'{FINAL} leaves', traces.after[:, j], 'final', 'line'))
    values = [broken(found, y) for _, y, *_ in curves]
    rows = kept(values)
    noise = 2.0 * float(traces.noise[j])
    shown = [(NOMINAL, traces.before[:, j]), (FINAL, traces.after[:, j])]
    shown = shown[: 1 if found.verdict == 'no_mismatch' else 2]
    return Chart(
        f'What is left of the effort on {name}',
        ', '.join(
            f'{"the" if i else "The"} {model} leaves up to {spoken(np.abs(left).max())} {unit}'
            for i, (model, left) in enumerate(shown)
        )
        + f'; two standard deviations of the noise of the encoder make {spoken(noise)} {unit}.',
        'time [s]', f'effort left [{unit}]', traces.time[rows],
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
    for when, model, values in shown[: 1 if found.verdict == 'no_mismatch' else 2]:
        x, y, mean = cells_of(found, j, values[:, j])
        a, b = np.unravel_index(np.nanargmax(np.abs(mean)), mean.shape)
        yield when, Chart(
            f'{name}: left by the {model}',
            f'Largest mean effort left: {spoken(mean[a, b])} {unit}, at position '
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
        f'Not zero from {where}.' if where else 'Nowhere different from zero beyond chance.',
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
        f'Measured and the law over {curve.label}: the law reaches '
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
    """Return what has no name over what it depends on most, in both directions."""
    name, unit = found.joints[j], found.units[j]
    depends = next(d for d in found.dependences if d.joint == name)
    unknown = next(f for f in found.findings if f.effect == UNKNOWN and f.joint == name)
    x, label = abscissa(found, unknown, j, leading(depends.scores))
    order = np.argsort(x, kind='stable')
    rows = order[spread_rows(len(order))]
    y, forward = found.traces.parameters[rows, j], found.traces.velocity[rows, j] > 0.0
    return Chart(
        f'What has no name on {name}',
        f'Effort left over {label}: up to {spoken(np.abs(y).max())} {unit}.',
        label, f'effort left [{unit}]', x[rows],
        [
            Series('forward', np.where(forward, y, np.nan), 'final', 'points'),
            Series('backward', np.where(forward, np.nan, y), 'law2', 'points'),
        ],
    )  # fmt: skip
