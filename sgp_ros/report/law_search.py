"""Result of a search for an unlisted law: its shape beside the data, formulas, words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from sgp_ros.diagnosis.result import Diagnosis
from sgp_ros.diagnosis.shown import LawSearch, TriedFormula
from sgp_ros.diagnosis.unlisted.formulas import NAMELESS
from sgp_ros.report.charts import Chart, Series, spoken
from sgp_ros.report.diagnosis_text import percent
from sgp_ros.report.figures import BAND, GREY, MEASURED, PREDICTED

_TONES = ('law1', 'law2', 'law3')
_COLOURS = ('#009E73', '#CC79A7', '#6A51A3')
_APART = 0.05
"""Formulas part where they differ by this part of what the shape spans."""
_SHAPE = 'shape without a formula'


def search_chart(search: LawSearch) -> Chart:
    """Return the shape with its 95 % band, the data, and the formulas of the same variable."""
    x, order = _with_beyond(search)
    mean, half = (np.interp(x, search.x, y, np.nan, np.nan) for y in (search.mean, search.half))
    seen = np.concatenate([search.seen, np.full(len(x) - len(search.seen), np.nan)])[order]
    series = [
        Series('measured', seen, 'measured', 'points'),
        Series(_SHAPE, mean, 'final', 'line', half),
    ]
    series += [
        Series(f'formula {i + 1}', _curve(search, t)[order], tone, 'dashed')
        for i, (t, tone) in enumerate(zip(search.formulas, _TONES, strict=False))
        if np.isfinite(t.curve).any()
    ]
    return Chart(
        f'Force on {search.joint} over {search.variable}',
        f'The shape lies between {spoken(search.mean.min())} and {spoken(search.mean.max())} '
        f'{search.force_unit}, its 95 % band is at most +- {spoken(search.half.max())} '
        f'{search.force_unit} wide.',
        f'{search.variable} [{search.unit}]', _label(search), x, series, limit=_limits(search),
    )  # fmt: skip


def _outside(search: LawSearch) -> np.ndarray:
    """Return which places of `beyond_x` were not seen, (b,)."""
    return np.asarray((search.beyond_x < search.x[0]) | (search.beyond_x > search.x[-1]))


def _with_beyond(search: LawSearch) -> tuple[np.ndarray, np.ndarray]:
    """Return the variable where it was seen and beyond, ascending, and the order for that."""
    x = np.concatenate([search.seen_x, search.beyond_x[_outside(search)]])
    order = np.argsort(x, kind='stable')
    return x[order], order


def _curve(search: LawSearch, tried: TriedFormula) -> np.ndarray:
    """Return a formula where the variable was seen, then beyond."""
    return np.concatenate([tried.curve, tried.beyond[_outside(search)]])


def beyond_sentence(search: LawSearch) -> str:
    """Return the predictions, beyond the data, of formulas that the recording hardly separates."""
    alike = [t.beyond for t in search.formulas if t.is_alike and np.isfinite(t.beyond).all()]
    if not alike:
        return ''
    ends = []
    for at in (0, -1):
        low, high = min(t[at] for t in alike), max(t[at] for t in alike)
        apart = high - low > _APART * max(np.ptp(search.mean), 1e-300)
        said = f'{low:.2g} to {high:.2g}' if apart else f'{0.5 * (low + high):.2g}'
        ends.append(f'{said} {search.force_unit} at {search.beyond_x[at]:.2g} {search.unit}')
    which = 'this formula gives' if len(alike) == 1 else 'formulas that fit as well give'
    return (
        f'Beyond what was seen ({search.x[0]:.2g} to {search.x[-1]:.2g} {search.unit}) {which} '
        f'{ends[0]} and {ends[1]}; no data support that.'
    )


def _label(search: LawSearch) -> str:
    over = f' / ({search.factor})' if search.factor else ''
    return f'force{over} [{search.force_unit}]'


def _limits(search: LawSearch) -> tuple[float, float]:
    """Return ends of the vertical axis: the bulk of the data, and the shape."""
    low, high = np.quantile(search.seen, (0.01, 0.99))
    low, high = min(low, search.mean.min()), max(high, search.mean.max())
    pad = 0.08 * max(high - low, 1e-12)
    return float(low - pad), float(high + pad)


def draw_searches(searches: Sequence[LawSearch]) -> Figure:
    """Draw the same for print, one panel for each joint."""
    figure = Figure(figsize=(6.5 if len(searches) == 1 else 10, 3.8), layout='constrained')
    for i, search in enumerate(searches):
        axes = figure.add_subplot(1, len(searches), i + 1)
        axes.plot(search.seen_x, search.seen, '.', ms=4, color=MEASURED, label='measured',
                  rasterized=True)  # fmt: skip
        x, order = _with_beyond(search)
        for low, high in ((x[0], search.x[0]), (search.x[-1], x[-1])):
            axes.axvspan(low, high, color=GREY, alpha=0.12, lw=0)
        axes.fill_between(search.x, search.mean - search.half, search.mean + search.half,
                          color=BAND, lw=0, alpha=0.7)  # fmt: skip
        axes.plot(search.x, search.mean, color=PREDICTED, lw=1.6, label=_SHAPE)
        for n, (t, colour) in enumerate(zip(search.formulas, _COLOURS, strict=False)):
            if np.isfinite(t.curve).any():
                axes.plot(x, _curve(search, t)[order], '--', lw=1.2, color=colour,
                          label=f'formula {n + 1}')  # fmt: skip
        axes.axhline(0.0, color=GREY, lw=0.6)
        axes.set(xlabel=f'{search.variable} [{search.unit}]', ylabel=_label(search),
                 ylim=_limits(search))  # fmt: skip
        axes.set_title(search.joint, fontsize='medium')
        axes.legend(fontsize='x-small')
    return figure


def search_rows(found: Diagnosis) -> list[dict[str, Any]]:
    """Return the content of a page for each search."""
    return [
        {
            'joint': s.joint,
            'chart': f'search {s.joint}',
            'words': f'What is missing on {s.joint} {s.words}.',
            'left': f'This shape leaves {percent(s.left)} of the mean squared effort of '
                    f'{s.joint}; the best listed effects leave {percent(s.left_listed)}.',
            'conclusion': _conclusion(s),
            'beyond': beyond_sentence(s),
            'has_nearest': any(t.words != NAMELESS for t in s.formulas),
            'formulas': [
                {
                    'formula': t.formula, 'left': percent(t.left),
                    'nearest': '' if t.words == NAMELESS else t.words,
                    'parameters': _parameters(t.parameters),
                }
                for t in s.formulas
            ],
        }
        for s in found.law_searches
    ]  # fmt: skip


def _conclusion(search: LawSearch) -> str:
    if search.why_not:
        return f'No formula is asserted: {search.why_not}.'
    return 'Formula 1 is asserted: it is the finding above.'


def _parameters(values: Mapping[str, tuple[float, str]]) -> str:
    return ', '.join(
        f'{name} = {x:.4g}{"" if unit in {"", "1"} else f" {unit}"}'
        for name, (x, unit) in values.items()
    )
