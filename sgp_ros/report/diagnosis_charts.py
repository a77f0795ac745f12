"""Charts of a diagnosis: what the discrepancy depends on, how much better the model is."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from sgp_ros.report.figures import PREDICTED

if TYPE_CHECKING:
    from collections.abc import Container

    from sgp_ros.diagnosis.result import Diagnosis

BEFORE, AFTER = '#E69F00', PREDICTED
_VARIABLES = 7


def draw_dependence(found: Diagnosis, joints: Container[str]) -> Figure:
    """Draw how much of the discrepancy each variable explains on stretches left out."""
    tables = [d for d in found.dependences if d.joint in joints]
    rows = max(min(len(d.scores), _VARIABLES) for d in tables)
    figure = Figure(figsize=(10, 0.9 + 0.28 * rows), layout='constrained')
    for axes, d in zip(figure.subplots(1, len(tables), squeeze=False)[0], tables, strict=True):
        best = sorted(d.scores, key=lambda name: d.scores[name])[-_VARIABLES:]
        axes.barh(best, [100.0 * d.scores[name] for name in best], color=PREDICTED)
        axes.set(xlim=(0, 100), xlabel='explained [%]')
        axes.set_title(d.joint, fontsize='medium')
        axes.tick_params(labelsize='small')
    return figure


def draw_proof(found: Diagnosis) -> Figure:
    """Draw the error of the effort of every joint before and after, for each recording."""
    names = found.joints[::-1]
    figure = Figure(figsize=(10, 1.0 + 0.42 * len(names)), layout='constrained')
    grid = figure.subplots(1, len(found.proofs), squeeze=False, sharex=True, sharey=True)[0]
    values = [
        x for p in found.proofs.values() for m in (p.nmse_before, p.nmse_after) for x in m.values()
    ]
    values = [x for x in values if 0.0 < x < 1e6] or [1.0]
    low, high = 0.5 * max(min(values), 1e-9), max(1.0, 2.0 * max(values))
    for axes, (stem, proof) in zip(grid, found.proofs.items(), strict=True):
        y = np.arange(len(names))
        for shift, table, colour, label in (
            (0.2, proof.nmse_before, BEFORE, 'nominal robot'),
            (-0.2, proof.nmse_after, AFTER, 'final model'),
        ):
            width = [float(np.clip(np.nan_to_num(table[name]), low, high)) - low for name in names]
            axes.barh(y + shift, width, 0.38, left=low, color=colour, label=label)
        axes.set_yticks(y, names)
        axes.set(xscale='log', xlabel='nMSE of the effort', xlim=(low, high))
        axes.set_title(f'{stem} (learned from)' if stem == 'train' else stem, fontsize='medium')
    handles, labels = grid[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc='outside lower center', ncols=2, fontsize='small')
    return figure
