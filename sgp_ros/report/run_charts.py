"""The charts of a run and of an identification, as data for their pages."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from sgp_ros.batch.identification import Identification
from sgp_ros.engine.engine import Engine
from sgp_ros.gp.scores import INTERVAL_95
from sgp_ros.report.charts import Chart, Series, kept, spoken
from sgp_ros.report.figures import History, shares_inside

_VIEW_S = 4.0
_TONES = ('final', 'law1', 'law2', 'law3', 'nominal')


def run_charts(engine: Engine, history: History, truth: Mapping[str, float]) -> dict[str, Chart]:
    """Return the charts of a run by name: predictions, parameters, calibration."""
    charts, scores = {}, engine.scores()
    order = ('acceleration', 'effort')
    if engine.robot.target == 'effort':
        order = order[::-1]
    for channel in order:
        for j, joint in enumerate(engine.robot.joints):
            if channel in scores.get(joint.name, {}):
                charts[f'{channel} {joint.name}'] = _prediction(engine, history, channel, j)
    if history.parameter_values:
        time = history.parameter_seconds()
        values, std = np.array(history.parameter_values), np.array(history.parameter_std)
        for i, (p, c) in enumerate(zip(engine.parameters(), engine.robot.coefficients,
                                       strict=False)):  # fmt: skip
            name = f'{c.name}: {c.meaning}' if c.meaning else c.name
            charts[f'parameter {p.name}'] = _parameter(
                name, p.unit, time, values[:, i], INTERVAL_95 * std[:, i], truth.get(p.name)
            )
    if history.scored().any():
        charts['calibration'] = _calibration(engine, history)
    return charts


def _prediction(engine: Engine, history: History, channel: str, j: int) -> Chart:
    """Return the measurement and what was predicted before it, with and without Z."""
    joint, score = engine.robot.joints[j], engine.scores()
    unit, time = joint.unit(channel), history.seconds()
    measured, mean, variance = (values[:, j] for values in history.channel(channel))
    half = INTERVAL_95 * np.sqrt(np.where(history.scored(), variance, np.nan))
    found = [Series('measured', measured, 'measured', 'thick')]
    said = f'nMSE: SGP {score[joint.name][channel].nmse:.2g}'
    alone = engine.baseline_scores().get(joint.name, {}).get(channel)
    if alone is not None and channel == engine.robot.target:
        found.append(Series('physics alone', history.physics()[:, j], 'nominal', 'dashed'))
        said += f', physics alone {alone.nmse:.2g}'
    found.append(Series('SGP', mean, 'final', 'line', half))
    rows = kept([s.y for s in found])
    return Chart(
        f'{channel.capitalize()} of {joint.name}',
        f'{said}. The band should hold 95 % of the measurements.',
        'time [s]', f'{channel} [{unit}]', time[rows], [s.rows(rows) for s in found], group='run',
        view=(max(time[0], time[-1] - _VIEW_S), time[-1]), limit=_limits(measured),
    )  # fmt: skip


def _parameter(
    name: str, unit: str, time: np.ndarray, values: np.ndarray, half: np.ndarray,
    true: float | None,
) -> Chart:  # fmt: skip
    """Return a parameter with its 95 % interval over time, and its true value where known."""
    said = f'It ends at {values[-1]:.4g} {unit}'
    said += f' +- {half[-1]:.2g}' if np.isfinite(half[-1]) else ', not determined by this motion'
    series = [Series('estimate', values, 'final', 'line', half)]
    if true is not None:
        series.append(Series('true value', np.full(len(time), true), 'truth', 'dashed'))
        said += f'; the true value is {true:.4g}'
    rows = kept([values])
    settled = slice(len(time) // 4, None)
    sure = half[settled][np.isfinite(half[settled])]
    limit = _limits(
        np.append(values[settled], [] if true is None else [true]),
        float(np.median(sure)) if len(sure) else 0.0,
    )
    return Chart(
        name, f'{said}.', 'time [s]', f'[{unit}]', time[rows], [s.rows(rows) for s in series],
        limit=limit,
    )  # fmt: skip


def _limits(values: np.ndarray, beyond: float = 0.0) -> tuple[float, float] | None:
    """Return limits that show some values and a bit beyond; wild first guesses may leave them."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return None
    low, high = float(finite.min()), float(finite.max())
    pad = beyond + 0.15 * max(high - low, 1e-6 * max(abs(low), abs(high)))
    return (low - pad, high + pad) if pad > 0.0 else None


def _calibration(engine: Engine, history: History) -> Chart:
    """Return the share of measurements inside central intervals over their stated level."""
    levels = np.linspace(0.0, 1.0, 101)
    shares = shares_inside(engine, history, levels)
    series = [Series('exact', levels, 'measured', 'dashed')]
    series += [
        Series(name, share, _TONES[j % len(_TONES)])
        for j, (name, share) in enumerate(shares.items())
    ]
    at = int(np.argmin(np.abs(levels - 0.95)))
    held = ', '.join(f'{100.0 * share[at]:.3g} % of {name}' for name, share in shares.items())
    return Chart(
        f'Calibration of the {engine.robot.target}',
        f'Intervals of 95 % hold {held}. Below the diagonal they are too narrow, above it too '
        'wide.',
        'stated level', 'share inside', levels, series,
    )  # fmt: skip


def identification_charts(found: Identification, method: str) -> dict[str, Chart]:
    """Return the target of every joint in what was held out, measured and predicted.

    Args:
        found: the identification.
        method: that speaks for it, beside physics alone.
    """
    charts, target = {}, found.robot.target
    for name, data in found.held.items():
        mean, variance = found.fits[method].predict(data)
        alone = found.fits['PR'].predict(data)[0] if 'PR' in found.fits else mean
        half = INTERVAL_95 * np.sqrt(np.where(np.isfinite(variance), variance, np.nan))
        ends = np.flatnonzero(np.diff(data.block, append=data.block[-1]))
        for j, joint in enumerate(found.robot.joints):
            unit = joint.unit(target)
            series = [Series('measured', _cut(data.y[:, j], ends), 'measured', 'thick')]
            if method != 'PR' and 'PR' in found.fits:
                series.append(
                    Series('physics alone', _cut(alone[:, j], ends), 'nominal', 'dashed')
                )
            own = Series(method, _cut(mean[:, j], ends), 'final', 'line', half[:, j])
            rows = kept([s.y for s in (*series, own)])
            misses = ' and '.join(
                f'{label} {spoken(_rms(x[:, j] - data.y[:, j]))} {unit}'
                for label, x in ((method, mean), ('physics alone', alone))
            )
            charts[f'held {name} {joint.name}'] = Chart(
                f'{target.capitalize()} of {joint.name}, held-out data',
                f'rms error: {misses}.', 'time [s]', f'{target} [{unit}]',
                data.time[rows], [s.rows(rows) for s in (*series, own)], group=f'held {name}',
            )  # fmt: skip
    return charts


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def _cut(values: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return values with NaN in the last row of each block, where a line is to break."""
    cut = values.copy()
    cut[ends] = np.nan
    return cut


def filter_chart(plan: Mapping[str, Any]) -> Chart:
    """Return the loss of every cut-off that was tried."""
    cutoffs = sorted({c['cutoff_hz'] for c in plan['candidates']})
    series = []
    for source, label, tone in (('position', 'velocity differentiated', 'final'),
                                ('measured', 'velocity measured', 'truth')):  # fmt: skip
        loss = {c['cutoff_hz']: c['regret'] for c in plan['candidates']
                if c['velocity_source'] == source}  # fmt: skip
        if loss:
            y = [1.0 + loss[x] if x in loss else math.nan for x in cutoffs]
            series.append(Series(label, np.array(y), tone))
    taken = plan['cutoff_hz']
    return Chart(
        'Loss of each cut-off on held-out stretches',
        f'The chosen cut-off is {taken:.3g} Hz, marked by the dashed line.',
        'cut-off [Hz]', '1 + loss [nat]', np.array(cutoffs), series,
        spans=[(taken, taken)], is_log=True,
    )  # fmt: skip
