"""Figures of a run, and what is kept of it for them.

Prediction over measurement, parameters over time, calibration.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from sgp_ros.engine.engine import Engine
from sgp_ros.engine.results import Estimate, Step
from sgp_ros.gp.scores import INTERVAL_95, pit
from sgp_ros.report.files import write_bytes

# Okabe and Ito 2008: told apart with every kind of colour vision.
MEASURED, PREDICTED, TRUE, GREY = '#B8B8B8', '#0072B2', '#D55E00', '#555555'
BAND = '#9CC9E5'
_POINTS = 2500
_DPI = 110
_ZOOM_S = 4.0
_COLUMNS = 3


def draw_all(
    engine: Engine, history: History, truth: Mapping[str, float] | None
) -> dict[str, Figure]:
    """Return the figures of a run by file stem; those without content are left out."""
    figures = {}
    for channel in ('acceleration', 'effort'):
        for j, joint in enumerate(engine.robot.joints):
            if channel in engine.scores().get(joint.name, {}):
                figures[f'{channel}_{joint.name}'] = draw_prediction(engine, history, channel, j)
    if history.parameter_values:
        figures['parameters'] = draw_parameters(engine, history, truth or {})
    if history.scored().any():
        figures['calibration'] = draw_calibration(engine, history)
    return figures


def png(figure: Figure) -> bytes:
    """Lay a figure out and return it as PNG; `savefig` would draw all of it twice."""
    buffer = io.BytesIO()
    figure.dpi = _DPI
    canvas = FigureCanvasAgg(figure)
    canvas.print_png(buffer)  # type: ignore[no-untyped-call] # matplotlib leaves it without types
    return buffer.getvalue()


def svg(figure: Figure) -> bytes:
    """Return a figure as SVG, its letters as text; the same figure gives the same bytes."""
    buffer = io.BytesIO()
    canvas = FigureCanvasSVG(figure)
    with rc_context({'svg.fonttype': 'none', 'svg.hashsalt': 'sgp'}):
        canvas.print_svg(buffer, metadata={'Date': None})  # type: ignore[no-untyped-call] # as above
    return buffer.getvalue()


def write_figures(out: Path, figures: Mapping[str, Figure]) -> dict[str, bytes]:
    """Write figures as PNG and SVG into a folder by their stems; return the PNG."""
    drawn = {}
    for stem, figure in figures.items():
        drawn[stem] = png(figure)
        write_bytes(out / f'{stem}.png', drawn[stem])
        figure.set_layout_engine('none')  # it is laid out; once more would only cost time
        write_bytes(out / f'{stem}.svg', svg(figure))
    return drawn


def draw_prediction(engine: Engine, history: History, channel: str, j: int) -> Figure:
    """Draw the measurement, the prediction made before it with its 95 % band, and the error."""
    joint = engine.robot.joints[j]
    time = history.seconds()
    measured, mean, variance = (values[:, j] for values in history.channel(channel))
    half = INTERVAL_95 * np.sqrt(np.where(history.scored(), variance, np.nan))
    figure = Figure(figsize=(10, 5.6), layout='constrained')
    grid = figure.add_gridspec(2, 2, height_ratios=(2, 1))
    whole, zoom, error = (
        figure.add_subplot(grid[0, 0]),
        figure.add_subplot(grid[0, 1]),
        figure.add_subplot(grid[1, :]),
    )
    shown = _thinned(len(time))
    _curves(whole, time[shown], measured[shown], mean[shown], half[shown])
    last = time > time[-1] - _ZOOM_S
    _curves(zoom, time[last], measured[last], mean[last], half[last])
    label = f'{channel} of {joint.name} [{joint.unit(channel)}]'
    whole.set(title='whole run', xlabel='time [s]', ylabel=label)
    zoom.set(title=f'last {min(_ZOOM_S, time[-1]):.0f} s', xlabel='time [s]')
    whole.legend(loc='upper right', fontsize='small')
    residual = (measured - mean)[shown]
    error.fill_between(time[shown], -half[shown], half[shown], color=BAND, lw=0)
    error.plot(time[shown], residual, color=GREY, lw=0.8)
    _limit(error, residual, half[shown])
    error.set(xlabel='time [s]', ylabel='measured - predicted')
    return figure


def draw_parameters(engine: Engine, history: History, truth: Mapping[str, float]) -> Figure:
    """Draw every parameter with its 95 % interval over time, and its true value where known."""
    parameters = engine.parameters()
    values, std = np.array(history.parameter_values), np.array(history.parameter_std)
    time = history.parameter_seconds()
    columns = min(_COLUMNS, len(parameters))
    rows = -(-len(parameters) // columns)
    figure = Figure(figsize=(10, 1.2 + 2.0 * rows), layout='constrained')
    for i, parameter in enumerate(parameters):
        axes = figure.add_subplot(rows, columns, i + 1)
        half = INTERVAL_95 * std[:, i]
        axes.fill_between(time, values[:, i] - half, values[:, i] + half, color=BAND, lw=0)
        axes.plot(time, values[:, i], color=PREDICTED, lw=1.4)
        if parameter.name in truth:
            axes.axhline(truth[parameter.name], color=TRUE, ls='--', lw=1.4)
        settled = slice(len(time) // 4, None)
        _limit(axes, values[settled, i] - values[-1, i], half[settled], about=values[-1, i])
        unit = f' [{parameter.unit}]'
        axes.set_title(f'{parameter.name}{unit}', fontsize='medium')
        if i >= len(parameters) - columns:
            axes.set_xlabel('time [s]')
    text = 'line: estimate, band: 95 % interval'
    figure.suptitle(text + (', dashed: true value' if truth else ''), fontsize='medium')
    return figure


def draw_calibration(engine: Engine, history: History) -> Figure:
    """Draw the share of measurements inside central intervals against their stated level."""
    channel = engine.robot.target
    levels = np.linspace(0.0, 1.0, 101)
    figure = Figure(figsize=(5.2, 4.6), layout='constrained')
    axes = figure.add_subplot()
    axes.plot(levels, levels, color=GREY, lw=1, ls='--', label='exact')
    styles = ('-', '--', ':', '-.')
    for j, (name, share) in enumerate(shares_inside(engine, history, levels).items()):
        axes.plot(levels, share, lw=1.8, ls=styles[j % 4], label=name)
    axes.set(
        xlabel='stated level of the interval',
        ylabel='share of measurements inside',
        title=f'calibration of {channel}',
        aspect='equal',
    )
    axes.legend(loc='upper left', fontsize='small')
    return figure


def shares_inside(engine: Engine, history: History, levels: np.ndarray) -> dict[str, np.ndarray]:
    """Return the share of measurements inside central intervals of these levels, by joint."""
    keep = history.scored()
    measured, mean, variance = (x[keep] for x in history.channel(engine.robot.target))
    shares = {}
    for j, name in enumerate(engine.robot.joint_names):
        central = np.abs(2.0 * pit(measured[:, j], mean[:, j], variance[:, j]) - 1.0)
        shares[name] = (central[:, None] <= levels).mean(axis=0)
    return shares


def _curves(
    axes: Axes, time: np.ndarray, measured: np.ndarray, mean: np.ndarray, half: np.ndarray
) -> None:
    axes.fill_between(time, mean - half, mean + half, color=BAND, lw=0, label='95 % interval')
    axes.plot(time, measured, color=MEASURED, lw=3.5, label='measured')
    axes.plot(time, mean, color=PREDICTED, lw=1.2, label='predicted')
    centre = float(np.nanmedian(measured))
    _limit(axes, measured - centre, np.zeros(1), about=centre)


def _limit(axes: Axes, values: np.ndarray, half: np.ndarray, about: float = 0.0) -> None:
    """Fit the vertical axis to the bulk of the curve; the first wild guesses may leave it."""
    finite = np.concatenate([np.abs(values), half])
    finite = finite[np.isfinite(finite)]
    if len(finite) and finite.max() > 0.0:
        reach = 1.15 * min(float(finite.max()), 4.0 * float(np.quantile(finite, 0.9)) + 1e-300)
        axes.set_ylim(about - reach, about + reach)


def _thinned(n: int) -> slice:
    return slice(None, None, max(n // _POINTS, 1))


PARAMETER_PERIOD = 5
"""Estimates between two looks at the parameters."""


@dataclass(slots=True)
class History:
    """Estimates and parameters in the order of time.

    Attributes:
        estimates: every estimate of the run.
        parameter_stamps: times of the looks at the parameters [ns].
        parameter_values: (p,) per look.
        parameter_std: (p,) per look, NaN where not identifiable.
    """

    estimates: list[Estimate] = field(default_factory=list)
    parameter_stamps: list[int] = field(default_factory=list)
    parameter_values: list[np.ndarray] = field(default_factory=list)
    parameter_std: list[np.ndarray] = field(default_factory=list)

    def take(self, engine: Engine, step: Step) -> None:
        """Keep what one push gave."""
        for estimate in step.estimates:
            self.estimates.append(estimate)
            if len(self.estimates) % PARAMETER_PERIOD == 0:
                self._look(engine, estimate.stamp_ns)

    def seconds(self) -> np.ndarray:
        """Times of the estimates since the first one [s], (n,)."""
        if not self.estimates:
            return np.zeros(0)
        first = self.estimates[0].stamp_ns
        return np.array([(e.stamp_ns - first) * 1e-9 for e in self.estimates])

    def parameter_seconds(self) -> np.ndarray:
        """Times of the looks at the parameters since the first estimate [s]."""
        if not self.parameter_stamps:
            return np.zeros(0)
        first = self.estimates[0].stamp_ns
        return np.array([(stamp - first) * 1e-9 for stamp in self.parameter_stamps])

    def channel(self, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return measured, mean and variance of `acceleration` or `effort`, each (n, k)."""
        values = [getattr(e, name) for e in self.estimates]
        return (
            np.array([v.measured for v in values]),
            np.array([v.mean for v in values]),
            np.array([v.variance for v in values]),
        )

    def physics(self) -> np.ndarray:
        """Return the target as the physics alone predicts it, (n, k); NaN where it does not."""
        nothing = np.full(len(self.estimates[0].names), np.nan)
        return np.array([nothing if e.physics is None else e.physics for e in self.estimates])

    def scored(self) -> np.ndarray:
        """Which estimates entered the scores, (n,) of bool."""
        return np.array([e.is_scored for e in self.estimates], dtype=bool)

    def _look(self, engine: Engine, stamp_ns: int) -> None:
        parameters = engine.parameters()
        if not parameters:
            return
        self.parameter_stamps.append(stamp_ns)
        self.parameter_values.append(np.array([p.value for p in parameters]))
        self.parameter_std.append(
            np.array([np.nan if p.std is None else p.std for p in parameters])
        )
