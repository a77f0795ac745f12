"""Figures of a diagnosis: times and law of each effect, its variables, the gain."""

from __future__ import annotations

from collections.abc import Container, Sequence
from textwrap import fill

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sgp_ros.diagnosis.result import Diagnosis, Finding, Proof
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
    draw_bands,
    draw_location,
    draw_others,
    important_joints,
    mark_regions,
    reach_of,
)
from sgp_ros.report.diagnosis_proof import recording_name
from sgp_ros.report.diagnosis_text import UNKNOWN, effect_name, is_calm
from sgp_ros.report.figures import BAND, GREY, MEASURED, PREDICTED
from sgp_ros.report.law_search import draw_searches
from sgp_ros.report.overlay_charts import draw_motion, overlaid

BEFORE, AFTER, BY_CHANCE = '#E69F00', PREDICTED, '#BBBBBB'
_VARIABLES, _SEEN = 7, 0.005


def draw_dependence(found: Diagnosis, joints: Container[str]) -> Figure:
    """Draw how much of the discrepancy each variable explains on stretches left out.

    Bars that chance could have made are pale.
    """
    tables = [d for d in found.dependences if d.joint in joints]
    rows = max(min(len(d.scores), _VARIABLES) for d in tables)
    figure = Figure(figsize=(10, 0.9 + 0.28 * rows), layout='constrained')
    for axes, d in zip(figure.subplots(1, len(tables), squeeze=False)[0], tables, strict=True):
        best = sorted(d.scores, key=lambda name: d.scores[name])[-_VARIABLES:]
        colours = [PREDICTED if d.is_significant(name) else BY_CHANCE for name in best]
        axes.barh(best, [100.0 * d.scores[name] for name in best], color=colours)
        if max(d.scores.values()) < _SEEN:
            axes.text(50.0, 0.5 * (len(best) - 1), 'none of these alone', ha='center', va='center')
        axes.set(xlim=(0, 100), xlabel='explained [%]')
        axes.set_title(d.joint, fontsize='medium')
        axes.tick_params(labelsize='small')
    return figure


def draw_proof(found: Diagnosis) -> Figure:
    """Draw the errors of effort and roll-outs of every joint before and after, by recording.

    Whiskers are 95 % intervals; all errors are on one scale.
    """
    kinds = [('nmse', 'nMSE of the effort')]
    if any(p.rollout_before for p in found.proofs.values()):
        kinds.append(('rollout_nmse', 'nMSE of roll-outs'))
    height = 0.6 + len(kinds) * (0.55 + 0.36 * len(found.joints))
    figure = Figure(figsize=(10, height), layout='constrained')
    grid = figure.subplots(len(kinds), len(found.proofs), squeeze=False, sharex=True, sharey=True)
    low, high = _reach(found)
    for row, (kind, label) in zip(grid, kinds, strict=True):
        for axes, proof in zip(row, found.proofs.values(), strict=True):
            _bars(axes, found.joints[::-1], proof, kind, (low, high))
            axes.set(xscale='log', xlabel=label, xlim=(low, high))
    for axes, stem in zip(grid[0], found.proofs, strict=True):
        axes.set_title(recording_name(stem), fontsize='medium')
    handles, labels = grid[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc='outside lower center', ncols=2, fontsize='small')
    return figure


def _reach(found: Diagnosis) -> tuple[float, float]:
    """Return the ends of a scale for all errors of a proof."""
    values = [
        x
        for proof in found.proofs.values()
        for name, table in proof.errors().items()
        for x in table.values()
        if not name.startswith('acceleration') and 0.0 < x < 1e6
    ] or [1.0]
    return 0.5 * max(min(values), 1e-9), max(1.0, 2.0 * max(values))


def _bars(
    axes: Axes, joints: Sequence[str], proof: Proof, kind: str, ends: tuple[float, float]
) -> None:
    y, low = np.arange(len(joints)), ends[0]
    for shift, when, colour, label in (
        (0.2, 'before', BEFORE, 'nominal robot'),
        (-0.2, 'after', AFTER, 'diagnosed robot'),
    ):
        table = proof.errors()[f'{kind}_{when}']
        shown = [float(np.clip(np.nan_to_num(table.get(name, 0.0)), *ends)) for name in joints]
        axes.barh(y + shift, np.subtract(shown, low), 0.38, left=low, color=colour, label=label)
        for i, name in enumerate(joints):
            interval = proof.intervals.get(f'{kind}_{when}', {}).get(name)
            if interval is not None:
                axes.plot(np.clip(interval, *ends), [i + shift] * 2, color='#1c1c1c', lw=1.0)
    axes.set_yticks(y, joints)


FORCES = (PREDICTED, '#009E73', '#CC79A7')
"""One colour for each finding on a joint (Okabe and Ito 2008)."""
_LARGE = 3


def draw_diagnosis(found: Diagnosis) -> dict[str, Figure]:
    """Return the figures of a diagnosis by file stem; those without content are left out."""
    figures = {'location': draw_location(found), 'time': draw_time(found)}
    if len(important_joints(found)) < len(found.joints):
        figures['others'] = draw_others(found)
    if found.bands:
        reach = {found.joints[j]: reach_of(found, j) for j in important_joints(found)}
        figures['bands'] = draw_bands(found, reach)
    if forces_of(found):
        figures['law'] = draw_laws(found)
    if found.findings:
        large = {found.joints[j] for j in important_joints(found)}
        figures['dependence'] = draw_dependence(found, large)
    if overlaid(found):
        figures['motion'] = draw_motion(found, important_joints(found))
    if found.law_searches:
        figures['search'] = draw_searches(found.law_searches)
    searched = {s.joint for s in found.law_searches}
    for f in found.findings:
        if f.effect == UNKNOWN and f.joint in found.joints and f.joint not in searched:
            figures['shape'] = draw_shape(found, f)
    figures['proof'] = draw_proof(found)
    return figures


def draw_time(found: Diagnosis) -> Figure:
    """Draw the discrepancy over time, the noise, the forces of the findings, what is left."""
    joints = important_joints(found)
    figure = Figure(figsize=(10, 0.5 + 2.6 * len(joints)), layout='constrained')
    grid = figure.subplots(len(joints), 2, squeeze=False, width_ratios=(3, 2))
    for row, j in zip(grid, joints, strict=True):
        for axes, shown in zip(row, (slice(None), zoomed(found, j)), strict=True):
            alike = _trace(axes, found, j, shown)
        row[0].set_ylabel(f'effort on {found.joints[j]} [{found.units[j]}]')
        row[1].locator_params(axis='x', nbins=6)
        if acting(found, j):
            row[0].legend(loc='lower left', bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2, ncols=2,
                          fontsize='small', frameon=False)  # fmt: skip
    for axes, part in zip(grid[-1], ('whole recording', 'where most is left'), strict=True):
        axes.set_xlabel(f'time [s], {part}')
    figure.legend(
        list(alike.values()), list(alike), loc='outside lower center', ncols=3, fontsize='small'
    )
    return figure


def draw_laws(found: Diagnosis) -> Figure:
    """Draw the forces of the largest findings over their variables, beside the data."""
    shown = sorted(forces_of(found), key=lambda pair: -pair[0].share)[:_LARGE]
    figure = Figure(figsize=(10 if len(shown) > 1 else 6.5, 3.6), layout='constrained')
    for i, (finding, force) in enumerate(shown):
        axes = figure.add_subplot(1, len(shown), i + 1)
        curve = law_curve(found, finding, force)
        j, style = curve.joint, '-' if curve.is_line else '.'
        colour = next((c for f, _, c in _coloured(found, j) if f is finding), FORCES[0])
        axes.plot(curve.x, curve.measured, style, ms=6, lw=3.5, color=MEASURED, label='measured',
                  rasterized=not curve.is_line)  # fmt: skip
        axes.plot(curve.x, curve.law, style, ms=1.8, lw=1.2, color=colour, label='the law',
                  rasterized=not curve.is_line)  # fmt: skip
        axes.axhline(0.0, color=GREY, lw=0.6)
        axes.set(xlabel=curve.label, ylabel=f'effort on {found.joints[j]} [{found.units[j]}]')
        axes.set_title(fill(effect_name(finding), 26), fontsize='medium')
        if 'position' in curve.label:
            mark_regions(axes, found, j)
        axes.legend(fontsize='small', markerscale=2)
    return figure


def _coloured(found: Diagnosis, j: int) -> list[tuple[Finding, np.ndarray, str]]:
    """Return the findings that exert a force on a joint, with these and their colours."""
    return [(*pair, FORCES[i % len(FORCES)]) for i, pair in enumerate(acting(found, j))]


def draw_shape(found: Diagnosis, unknown: Finding) -> Figure:
    """Draw an unexplained discrepancy over what it depends on most, for both directions."""
    j = found.joints.index(unknown.joint)
    scores = next(d.scores for d in found.dependences if d.joint == unknown.joint)
    x, label = abscissa(found, unknown, j, leading(scores))
    figure = Figure(figsize=(6.5, 3.6), layout='constrained')
    axes = figure.add_subplot()
    forward = found.traces.velocity[:, j] > 0.0
    for rows, colour, text in ((forward, FORCES[0], 'forward'), (~forward, FORCES[2], 'backward')):
        axes.plot(x[rows], found.traces.parameters[rows, j], '.', ms=3, color=colour, label=text)
    axes.axhline(0.0, color=GREY, lw=0.6)
    axes.set(xlabel=label, ylabel=f'residual on {unknown.joint} [{found.units[j]}]')
    axes.legend(fontsize='small', markerscale=3)
    return figure


def _trace(axes: Axes, found: Diagnosis, j: int, shown: slice) -> dict[str, Artist]:
    """Draw one joint over some rows and return, by name, what looks alike on all joints."""
    traces, time = found.traces, found.traces.time[shown]
    half = 2.0 * float(traces.noise[j])
    before = broken(found, traces.before[:, j])[shown]
    alike: dict[str, Artist] = {}
    (alike['nominal robot'],) = axes.plot(time, before, color=MEASURED, lw=3.5)
    for finding, force, colour in _coloured(found, j):
        axes.plot(time, broken(found, force[:, j])[shown], color=colour, lw=1.1,
                  label=effect_name(finding))  # fmt: skip
    if not is_calm(found):
        left = broken(found, traces.after[:, j])[shown]
        (alike['diagnosed robot'],) = axes.plot(time, left, color='#D55E00', lw=0.9)
    alike['noise (2 std)'] = axes.axhspan(-half, half, color=BAND, lw=0, zorder=0)
    axes.margins(x=0.01)
    return alike
