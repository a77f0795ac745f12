"""Curves, points and maps as data of a page, which its script draws; thinned for display."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

MOST_POINTS = 5000
"""Points of a curve on a page."""
MOST_CLOUD = 1500
"""Points of a cloud."""
THINNED = (
    'Curves are thinned for display: of each stretch the largest and the smallest value are kept.'
)


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """One curve of a chart.

    Attributes:
        label: in the legend.
        y: (n,) values; NaN where the curve breaks.
        tone: its colour, a name in `report.css`.
        style: `line`, `thick`, `dashed` or `points`.
        half: (n,) half width of a band about it; None without.
    """

    label: str
    y: np.ndarray
    tone: str
    style: str = 'line'
    half: np.ndarray | None = None

    def rows(self, rows: np.ndarray) -> Series:
        """Return some of its points."""
        half = None if self.half is None else self.half[rows]
        return replace(self, y=self.y[rows], half=half)


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """Values over a grid of a x b cells.

    Attributes:
        x, y: (a + 1,) and (b + 1,) edges.
        values: (a, b); NaN where nothing was measured.
        reach: value of full colour.
    """

    x: np.ndarray
    y: np.ndarray
    values: np.ndarray
    reach: float


@dataclass(frozen=True, slots=True, eq=False)
class Chart:
    """Contents of one chart.

    Attributes:
        title: above it.
        said: what is seen, in a sentence, for those who do not see it.
        x_label, y_label: with units.
        x: (n,) ascending for curves; any order for points.
        series: over x.
        spans: regions of x that are marked.
        group: charts of one group share cursor and zoom; empty for none.
        cells: a map instead of curves.
        limit: ends of the vertical axis; None fits it to the data.
        view: ends of x at first; None shows all.
        is_log: whether both axes are logarithmic.
        option: label of the button that shows it, where one of several charts is seen at a time.
    """

    title: str
    said: str
    x_label: str
    y_label: str
    x: np.ndarray = field(default_factory=lambda: np.zeros(0))
    series: Sequence[Series] = ()
    spans: Sequence[tuple[float, float]] = ()
    group: str = ''
    cells: Cells | None = None
    limit: tuple[float, float] | None = None
    view: tuple[float, float] | None = None
    is_log: bool = False
    option: str = ''

    def content(self) -> dict[str, Any]:
        """Return what the script reads; NaN becomes null."""
        content: dict[str, Any] = {
            'x_label': _signs(self.x_label), 'y_label': _signs(self.y_label), 'group': self.group,
            'x': _plain(self.x, 7), 'spans': [_plain(ends) for ends in self.spans],
            'limit': self.limit, 'view': self.view, 'log': self.is_log,
            'series': [
                {'label': s.label, 'tone': s.tone, 'style': s.style, 'y': _plain(s.y),
                 **({} if s.half is None else
                    {'low': _plain(s.y - s.half), 'high': _plain(s.y + s.half)})}
                for s in self.series
            ],
        }  # fmt: skip
        if self.cells is not None:
            c = self.cells
            content['cells'] = {
                'x': _plain(c.x), 'y': _plain(c.y), 'reach': c.reach,
                'values': [_plain(row) for row in c.values],
            }  # fmt: skip
        return content


def embedded_data(charts: Mapping[str, Chart]) -> str:
    """Return charts as JSON that can stand within a page."""
    content = {name: chart.content() for name, chart in charts.items()}
    return json.dumps(content, allow_nan=False, separators=(',', ':')).replace('<', '\\u003c')


def kept(curves: Iterable[np.ndarray], most: int = MOST_POINTS) -> np.ndarray:
    """Return the rows that keep the looks of some curves (n,) with about `most` of them.

    Of every stretch of equal length the least and the greatest value of each curve are kept, and
    a row where a curve breaks. Nothing is averaged.
    """
    columns = list(curves)
    n = len(columns[0])
    if n <= most:
        return np.arange(n)
    parts = np.array_split(np.arange(n), max(1, most // (2 * len(columns))))
    rows = {0, n - 1}
    for part in parts:
        for y in columns:
            values = y[part]
            finite = np.isfinite(values)
            if finite.any():
                rows.add(int(part[np.argmin(np.where(finite, values, np.inf))]))
                rows.add(int(part[np.argmax(np.where(finite, values, -np.inf))]))
            rows.update(part[~finite][:1].tolist())
    return np.array(sorted(rows))


def spread_rows(n: int, most: int = MOST_CLOUD) -> np.ndarray:
    """Return at most `most` of n rows at equal distances, for clouds of points."""
    return np.arange(n) if n <= most else np.linspace(0, n - 1, most).astype(int)


def spoken(x: float) -> str:
    """Return a number as it is said: three digits."""
    return f'{x:.3g}'


def _signs(label: str) -> str:
    return label.replace('^2', '²').replace('^3', '³')


def _plain(values: Iterable[float], digits: int = 5) -> list[float | None]:
    return [
        float(f'{x:.{digits}g}') if math.isfinite(x) else None
        for x in np.asarray(values, dtype=float).tolist()
    ]
