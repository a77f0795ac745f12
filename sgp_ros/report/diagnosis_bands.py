"""Where the process Z differs from zero: its mean over each variable, with its band."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sgp_ros.diagnosis.result import Band, Dependence, Diagnosis
from sgp_ros.report.figures import GREY, PREDICTED

VARIABLES = ('position', 'velocity', 'effort', 'time')
_DIRECTIONS = (('backward', '#CC79A7'), ('forward', PREDICTED))
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
                axes.set_xlabel(f'{variable} [{_units(unit)[variable]}]')
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
            sentences.append(f'{d.joint}: nowhere beyond chance.')
            continue
        best = max(own, key=lambda b: d.scores[b.variable])
        unit = _units(found.units[found.joints.index(d.joint)])[best.variable]
        parts = ' and '.join(f'{lo:.3g} to {hi:.3g} {unit}' for lo, hi in best.regions)
        share = f'{100.0 * best.rows:.0f} % of the rows'
        sentences.append(f'{d.joint}: at {best.variable} from {parts}, {share}.')
    return sentences


def _draw(axes: Axes, band: Band, dependence: Dependence) -> None:
    for i, (lo, hi) in enumerate(band.regions):
        label = None if i else 'not zero'
        axes.axvspan(lo, hi, color=_REGION, alpha=0.35, lw=0, zorder=0, label=label)
    for i, (direction, colour) in enumerate(_DIRECTIONS):
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


def _units(effort: str) -> dict[str, str]:
    length = 'm' if effort == 'N' else 'rad'
    return {'position': length, 'velocity': f'{length}/s', 'effort': effort, 'time': 's'}
