"""Charts of a diagnosis: what the discrepancy depends on, how much better the model is."""

from __future__ import annotations

from collections.abc import Container, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sgp_ros.diagnosis.result import Diagnosis, Proof
from sgp_ros.report.diagnosis_proof import recording_name, tables
from sgp_ros.report.figures import PREDICTED

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
        for name, table in tables(proof).items()
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
        (-0.2, 'after', AFTER, 'final model'),
    ):
        table = tables(proof)[f'{kind}_{when}']
        shown = [float(np.clip(np.nan_to_num(table.get(name, 0.0)), *ends)) for name in joints]
        axes.barh(y + shift, np.subtract(shown, low), 0.38, left=low, color=colour, label=label)
        for i, name in enumerate(joints):
            interval = proof.intervals.get(f'{kind}_{when}', {}).get(name)
            if interval is not None:
                axes.plot(np.clip(interval, *ends), [i + shift] * 2, color='#1c1c1c', lw=1.0)
    axes.set_yticks(y, joints)
