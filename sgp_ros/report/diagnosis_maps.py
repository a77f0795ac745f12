"""Maps and bands of a diagnosis: what is left on a joint over its motion, where Z is not zero."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from sgp_ros.diagnosis.criteria import LEAST_SHARE
from sgp_ros.diagnosis.result import Diagnosis
from sgp_ros.diagnosis.shown import Band, Dependence
from sgp_ros.report.diagnosis_text import is_calm, scored_joints, worst_joint
from sgp_ros.report.figures import GREY, PREDICTED

_FEWEST_CELLS, _MOST_CELLS = 8, 24
_LARGE, _IMPORTANT = 3, 0.1
_SMALL_COLUMNS = 6
_SIGNED = LinearSegmentedColormap.from_list('signed', ['#0060a8', '#ffffff', '#c44900'], 257)
"""Below and above zero, in the colours of the page, whose words name them."""


def important_joints(found: Diagnosis) -> list[int]:
    """Return the joints that deserve large pictures, at most three, in order of the robot."""
    proof = found.proofs['train']
    worst = worst_joint(proof)
    if is_calm(found):
        return [found.joints.index(worst)]
    named = {f.joint for f in found.findings}
    least = max(_IMPORTANT * proof.nmse_before[worst], _IMPORTANT * LEAST_SHARE)
    rank = {
        j: (name in named) + min(proof.nmse_before[name] / max(least, 1e-300), 1e9) * 1e-9
        for j, name in enumerate(found.joints)
        if name in named or (name in scored_joints(proof) and proof.nmse_before[name] >= least)
    }
    best = sorted(rank, key=lambda j: -rank[j])[:_LARGE]
    return sorted(best) or [found.joints.index(worst)]


def draw_location(found: Diagnosis) -> Figure:
    """Draw what nominal robot and final model leave over position and velocity, on one scale."""
    joints = important_joints(found)
    left = [('residual of the nominal robot', found.traces.before)]
    if not is_calm(found):
        left.append(('residual of the diagnosed robot', found.traces.after))
    figure = Figure(figsize=(1.0 + 4.5 * len(left), 0.3 + 3.2 * len(joints)), layout='constrained')
    grid = figure.subplots(len(joints), len(left), squeeze=False, sharex='row', sharey='row')
    for row, j in zip(grid, joints, strict=True):
        reach = reach_of(found, j)
        for axes, (title, values) in zip(row, left, strict=True):
            mesh = _map(axes, found, j, values[:, j], reach)
            axes.set_title(f'{found.joints[j]}: {title}', fontsize='medium')
            axes.set_xlabel(f'position [{position_unit(found, j)}]')
            mark_regions(axes, found, j)
        row[0].set_ylabel(f'velocity [{position_unit(found, j)}/s]')
        figure.colorbar(mesh, ax=row, label=f'mean residual [{found.units[j]}]')
    return figure


def draw_others(found: Diagnosis) -> Figure:
    """Draw the maps of the other joints small, on the scale of the largest discrepancy.

    Each is relative to the effort of its joint.
    """
    large = important_joints(found)
    others = [j for j in range(len(found.joints)) if j not in large]
    scale = effort_scale(found)
    share = max(reach_of(found, j) / scale[j] for j in large)
    columns = min(len(others), _SMALL_COLUMNS)
    rows = -(-len(others) // columns)
    figure = Figure(figsize=(1.6 + 1.9 * columns, 0.8 + 1.7 * rows), layout='constrained')
    for i, j in enumerate(others):
        axes = figure.add_subplot(rows, columns, i + 1)
        mesh = _map(axes, found, j, found.traces.before[:, j] / scale[j], share)
        axes.set_title(found.joints[j], fontsize='small')
        axes.tick_params(labelsize='x-small')
    units = ' or '.join(dict.fromkeys(position_unit(found, j) for j in others))
    figure.supxlabel(f'position [{units}]', fontsize='small')
    figure.supylabel(f'velocity [{units} per s]', fontsize='small')
    bar = figure.colorbar(mesh, ax=figure.axes)
    bar.set_label('residual, relative\nto the effort', fontsize='small')
    return figure


def mark_regions(axes: Axes, found: Diagnosis, j: int) -> None:
    """Draw the limits of the region that a finding on this joint is confined to."""
    for f in found.findings:
        if f.joint == found.joints[j]:
            for lo, hi in f.location.intervals.get('position', []):
                axes.axvspan(lo, hi, fill=False, ec='black', ls='--', lw=1.2)
            for lo, hi in f.location.intervals.get('velocity', []):
                axes.axhspan(lo, hi, fill=False, ec='black', ls='--', lw=1.2)


def shown_position(found: Diagnosis, j: int) -> np.ndarray:
    """Return the position, wrapped where the joint made more than a turn [rad or m]."""
    q = found.traces.position[:, j]
    if position_unit(found, j) == 'rad' and np.ptp(q) > 2.2 * np.pi:
        return (q + np.pi) % (2 * np.pi) - np.pi
    return q


def position_unit(found: Diagnosis, j: int) -> str:
    """Return the unit of the position of a joint."""
    return 'm' if found.units[j] == 'N' else 'rad'


def effort_scale(found: Diagnosis) -> np.ndarray:
    """Return the effort that the errors of each joint are measured by, (k,) [N m or N]."""
    left = np.sqrt((found.traces.before**2).mean(axis=0))
    nmse = np.array([found.proofs['train'].nmse_before[name] for name in found.joints])
    return np.maximum(left, 1e-300) / np.sqrt(np.maximum(nmse, 1e-300))


def reach_of(found: Diagnosis, j: int) -> float:
    """Return where the colours end: never below the least that counts as physics [N m or N]."""
    largest = float(np.quantile(np.abs(found.traces.before[:, j]), 0.98))
    return max(largest, float(np.sqrt(LEAST_SHARE) * effort_scale(found)[j]))


def cells_of(
    found: Diagnosis, j: int, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return edges of position and velocity, (c + 1,) each, and the mean of values (c, c)."""
    q, v = shown_position(found, j), found.traces.velocity[:, j]
    cells = int(np.clip(2.0 * np.sqrt(len(q)), _FEWEST_CELLS, _MOST_CELLS))
    edges = [np.linspace(x.min(), x.max() + 1e-12, cells + 1) for x in (q, v)]
    count = np.histogram2d(q, v, edges)[0]
    total = np.histogram2d(q, v, edges, weights=values)[0]
    return edges[0], edges[1], np.where(count > 0, total / np.maximum(count, 1.0), np.nan)


def _map(axes: Axes, found: Diagnosis, j: int, values: np.ndarray, reach: float) -> QuadMesh:
    x, y, mean = cells_of(found, j, values)
    axes.set_facecolor('#D4D4D4')
    return axes.pcolormesh(x, y, mean.T, cmap=_SIGNED, vmin=-reach, vmax=reach, rasterized=True)


VARIABLES = ('position', 'velocity', 'effort', 'time')
DIRECTIONS = (('backward', '#CC79A7'), ('forward', PREDICTED))
_REGION = '#F0E442'


def draw_bands(found: Diagnosis, reach: Mapping[str, float]) -> Figure:
    """Draw Z of each joint over position, velocity, effort and time, for both directions.

    Args:
        found: the diagnosis; it has bands.
        reach: where the axes of each joint end, by name [N m or N].
    """
    shown = {b.variable for b in found.bands if b.joint in reach}
    variables = [v for v in VARIABLES if v in shown]
    size = 0.6 + 2.6 * len(variables), 0.5 + 2.3 * len(reach)
    figure = Figure(figsize=size, layout='constrained')
    grid = figure.subplots(len(reach), len(variables), squeeze=False, sharey='row')
    depends = {d.joint: d for d in found.dependences}
    for row, joint in zip(grid, reach, strict=True):
        unit = found.units[found.joints.index(joint)]
        own = {b.variable: b for b in found.bands if b.joint == joint}
        for axes, variable in zip(row, variables, strict=True):
            axes.set_visible(variable in own)
            if variable in own:
                _draw(axes, own[variable], depends[joint])
                _mark(axes, found, joint, variable)
                axes.set_xlabel(f'{variable} [{variable_units(unit)[variable]}]')
        row[0].set(ylabel=f'Z on {joint} [{unit}]', ylim=(-reach[joint], reach[joint]))
    parts = [axes.get_legend_handles_labels() for axes in grid.flat]
    by_label = {label: h for hs, labels in parts for h, label in zip(hs, labels, strict=True)}
    figure.legend(
        by_label.values(), by_label, loc='outside lower center', ncols=3, fontsize='small'
    )
    return figure


def band_sentences(found: Diagnosis, joints: list[str]) -> list[str]:
    """Say for each joint over which variable Z explains most, and where it is not zero."""
    sentences = []
    for d in found.dependences:
        own = [b for b in found.bands if b.joint == d.joint and b.regions]
        if d.joint not in joints or not found.bands:
            continue
        if not own:
            sentences.append(f'{d.joint}: nowhere significant.')
            continue
        best = max(own, key=lambda b: d.scores[b.variable])
        unit = variable_units(found.units[found.joints.index(d.joint)])[best.variable]
        parts = ' and '.join(f'{lo:.3g} to {hi:.3g} {unit}' for lo, hi in best.regions)
        share = f'{100.0 * best.rows:.0f} % of the rows'
        sentences.append(f'{d.joint}: at {best.variable} from {parts}, {share}.')
    return sentences


def _draw(axes: Axes, band: Band, dependence: Dependence) -> None:
    for i, (lo, hi) in enumerate(band.regions):
        label = None if i else 'significant'
        axes.axvspan(lo, hi, color=_REGION, alpha=0.35, lw=0, zorder=0, label=label)
    for i, (direction, colour) in enumerate(DIRECTIONS):
        mean, half = band.mean[:, i], band.half[:, i]
        axes.fill_between(band.x, mean - half, mean + half, color=colour, alpha=0.25, lw=0)
        axes.plot(band.x, mean, '.-', ms=3, lw=1.2, color=colour, label=direction)
    axes.axhline(0.0, color=GREY, lw=0.6)
    p = dependence.p_values[band.variable]
    word = 'significant' if dependence.is_significant(band.variable) else 'not significant'
    axes.set_title(f'{word} (p {p:.2g})', fontsize='small')
    axes.tick_params(labelsize='small')


def _mark(axes: Axes, found: Diagnosis, joint: str, variable: str) -> None:
    """Draw the limits of the region that a finding on this joint is confined to."""
    for f in found.findings:
        if f.joint == joint:
            near = f.location.time if variable == 'time' else ()
            for lo, hi in [*near, *f.location.intervals.get(variable, [])]:
                axes.axvspan(lo, hi, fill=False, ec='black', ls='--', lw=1.2)


def variable_units(effort: str) -> dict[str, str]:
    """Return the units of position, velocity, effort and time of a joint with such an effort."""
    length = 'm' if effort == 'N' else 'rad'
    return {'position': length, 'velocity': f'{length}/s', 'effort': effort, 'time': 's'}
