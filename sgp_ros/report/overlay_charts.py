"""Measured, nominal and diagnosed motion over each other: charts, a figure and their errors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure

from sgp_ros.diagnosis.result import Diagnosis
from sgp_ros.diagnosis.shown import Replay
from sgp_ros.report.charts import Chart, Series, kept, spoken
from sgp_ros.report.diagnosis_curves import with_gaps
from sgp_ros.report.diagnosis_maps import position_unit
from sgp_ros.report.diagnosis_proof import recording_name
from sgp_ros.report.diagnosis_text import is_calm, worst_joint
from sgp_ros.report.figures import MEASURED, PREDICTED

NOMINAL, FINAL = 'nominal robot', 'diagnosed robot'
_SIDES = (('nominal', NOMINAL, 'nominal', 'dashed'), ('diagnosed', FINAL, 'final', 'line'))
_MODES = {
    'closed_whole': ('closed loop', 'in closed loop: PD drives follow the recorded targets'),
    'open_0.5': ('0.5 s', 'open loop, restarted from the measured state every 0.5 s'),
    'open_2': ('2 s', 'open loop, restarted from the measured state every 2 s'),
    'open_whole': ('whole', 'open loop from the first state on'),
}  # fmt: skip
"""Label and words of each replay, in the order in which they are preferred."""
_VIEW_S = 8.0
_COLOURS = {'nominal': '#E69F00', 'final': PREDICTED}
_LINES = {'dashed': '--', 'line': '-'}


def overlaid(found: Diagnosis) -> str:
    """Return the recording to show: the held-out one furthest from the training data.

    Empty where no recording was replayed.
    """
    held = [stem for stem in found.overlays if stem in found.proofs and stem != 'train']
    if held:
        return max(held, key=lambda stem: found.proofs[stem].distance)
    return next(iter(found.overlays), '')


def motion_charts(found: Diagnosis, j: int) -> dict[str, Chart]:
    """Return the position of a joint in every replay, and its effort; charts by name."""
    stem, name = overlaid(found), found.joints[j]
    charts = {
        f'motion {name} {mode}': _positions(found, stem, j, mode)
        for mode in _preferred(found, stem)
    }  # fmt: skip
    for mode in _preferred(found, stem)[:1]:
        charts[f'motion {name} error'] = _errors(found, stem, j, mode)
    charts[f'effort {name}'] = _efforts(found, stem, j)
    return charts


def _preferred(found: Diagnosis, stem: str) -> list[str]:
    """Return the replays of a recording, those first in which the models that are shown stay."""
    replays = found.overlays[stem].replays
    modes = [mode for mode in _MODES if mode in replays]
    return sorted(
        modes, key=lambda m: not all(is_stable(replays[m][side]) for side, *_ in _sides(found))
    )


def _positions(found: Diagnosis, stem: str, j: int, mode: str) -> Chart:
    o, unit, name = found.overlays[stem], position_unit(found, j), found.joints[j]
    label, words = _MODES[mode]
    replays = {side: o.replays[mode][side] for side, *_ in _sides(found)}
    series = [Series('measured', o.position[:, j], 'measured', 'thick')]
    series += [
        Series(text, replays[side].position[:, j], tone, style)
        for side, text, tone, style in _sides(found)
    ]
    missed = [(text, replays[side].rms[j]) for side, text, *_ in _sides(found)]
    series = [replace(s, y=with_gaps(o.time, s.y, found.rate_hz)) for s in series]
    rows = kept([s.y for s in series])
    return Chart(
        f'Position of {name} on {recording_name(stem)}: measured and simulated',
        f'Simulated {words}. {_sentence(missed, unit)}',
        'time [s]', f'position [{unit}]', o.time[rows], [s.rows(rows) for s in series],
        group='motion', view=_view(found, stem), limit=_reach(series), option=label,
    )  # fmt: skip


def _errors(found: Diagnosis, stem: str, j: int, mode: str) -> Chart:
    """Return by how much a replay of each model is off."""
    o, unit, name = found.overlays[stem], position_unit(found, j), found.joints[j]
    label, words = _MODES[mode]
    series = [
        Series(text, with_gaps(o.time, o.replays[mode][side].position[:, j] - o.position[:, j],
                               found.rate_hz), tone, style)
        for side, text, tone, style in _sides(found)
    ]  # fmt: skip
    missed = [(text, o.replays[mode][side].rms[j]) for side, text, *_ in _sides(found)]
    rows = kept([s.y for s in series])
    return Chart(
        f'Position of {name} on {recording_name(stem)}: simulated minus measured',
        f'Simulated {words}. {_sentence(missed, unit)}',
        'time [s]', f'error [{unit}]', o.time[rows], [s.rows(rows) for s in series],
        group='motion', view=_view(found, stem), option=f'error, {label}',
    )  # fmt: skip


def _efforts(found: Diagnosis, stem: str, j: int) -> Chart:
    """Return the effort that acted, and what the models need for the same motion."""
    o, unit, name = found.overlays[stem], found.units[j], found.joints[j]
    series = [Series('measured', o.effort[:, j], 'measured', 'thick')]
    series += [
        Series(text, o.efforts[side][:, j], tone, style)
        for side, text, tone, style in _sides(found)
    ]
    missed = [(s.label, _rms(s.y - o.effort[:, j])) for s in series[1:]]
    series = [replace(s, y=with_gaps(o.time, s.y, found.rate_hz)) for s in series]
    rows = kept([s.y for s in series])
    return Chart(
        f'Effort on {name}, {recording_name(stem)}: measured and computed',
        f'What acted, and what each model needs for the measured motion. '
        f'{_sentence(missed, unit)}',
        'time [s]', f'effort [{unit}]', o.time[rows], [s.rows(rows) for s in series],
        group='motion', view=_view(found, stem),
    )  # fmt: skip


def _sides(found: Diagnosis) -> Sequence[tuple[str, str, str, str]]:
    """Return the models that are shown; nothing was diagnosed where nothing is missing."""
    return _SIDES[:1] if is_calm(found) else _SIDES


def _sentence(missed: Sequence[tuple[str, float]], unit: str) -> str:
    """Return the errors of models in a sentence."""
    parts = [
        f'{"the" if i else "The"} {model} is off by {in_degrees(x, unit)} rms'
        if math.isfinite(x) else f'{"the" if i else "The"} {model} diverges'
        for i, (model, x) in enumerate(missed)
    ]  # fmt: skip
    return f'{", ".join(parts)}.'


def in_degrees(x: float, unit: str) -> str:
    """Return an error with its unit, angles in degrees too."""
    plain = f'{spoken(x)} {unit}'
    return f'{plain} ({_short(math.degrees(x))}°)' if unit == 'rad' else plain


def is_stable(replay: Replay) -> bool:
    """Return whether a replay stayed near the measured motion."""
    return bool(np.isfinite(replay.rms).all())


def _view(found: Diagnosis, stem: str) -> tuple[float, float]:
    """Return the replayed seconds in which the efforts of the nominal robot are most wrong.

    Of all joints together, each relative to its effort.
    """
    o = found.overlays[stem]
    error = (o.efforts['nominal'] - o.effort) ** 2
    error = (error / np.maximum((o.effort**2).mean(axis=0), 1e-300)).sum(axis=1)
    for mode in _preferred(found, stem)[:1]:
        shown = [o.replays[mode][side].position for side, *_ in _sides(found)]
        error = np.where(np.isfinite(shown).all(axis=2).any(axis=0), error, 0.0)
    ends = np.searchsorted(o.time, o.time + _VIEW_S, side='right')
    until = np.append(0.0, np.cumsum(error))
    first = int(np.argmax(until[ends] - until[:-1]))
    return float(o.time[first]), float(o.time[ends[first] - 1])


def _reach(series: Sequence[Series]) -> tuple[float, float]:
    """Return limits that show what was measured and a bit beyond; models may leave them."""
    low, high = float(np.nanmin(series[0].y)), float(np.nanmax(series[0].y))
    pad = 0.4 * max(high - low, 1e-6)
    found = [s.y[np.isfinite(s.y)] for s in series]
    return (
        max(low - pad, min(y.min() for y in found if len(y)) - 0.1 * pad),
        min(high + pad, max(y.max() for y in found if len(y)) + 0.1 * pad),
    )


def draw_motion(found: Diagnosis, joints: Sequence[int]) -> Figure:
    """Draw position and effort of some joints where the nominal robot is furthest off."""
    stem = overlaid(found)
    o, (start, end) = found.overlays[stem], _view(found, stem)
    rows = (o.time >= start) & (o.time <= end)
    figure = Figure(figsize=(10, 0.7 + 2.1 * len(joints)), layout='constrained')
    grid = figure.subplots(len(joints), 2, squeeze=False, sharex=True)
    modes = _preferred(found, stem)[:1]
    for (left, right), j in zip(grid, joints, strict=True):
        moved = {side: o.replays[m][side].position for m in modes for side, *_ in _sides(found)}
        for axes, measured, models, label in (
            (left, o.position, moved, f'position [{position_unit(found, j)}]'),
            (right, o.effort, o.efforts, f'effort [{found.units[j]}]'),
        ):
            axes.plot(o.time[rows], measured[rows, j], color=MEASURED, lw=3.5, label='measured')
            low, high = axes.get_ylim()
            for side, text, tone, style in _sides(found):
                if side in models:
                    axes.plot(o.time[rows], models[side][rows, j], _LINES[style], lw=1.2,
                              color=_COLOURS[tone], label=text)  # fmt: skip
            pad = high - low
            ends = axes.get_ylim()
            axes.set_ylim(max(ends[0], low - pad), min(ends[1], high + pad))
            axes.set_ylabel(f'{found.joints[j]}\n{label}', fontsize='small')
    for mode in modes:
        grid[0][0].set_title(f'simulated {_MODES[mode][1].partition(":")[0]}', fontsize='small')
    grid[0][1].set_title('effort that acted, and that each model needs', fontsize='small')
    for axes in grid[-1]:
        axes.set_xlabel('time [s]')
    handles, labels = grid[0][1].get_legend_handles_labels()
    figure.legend(handles, labels, loc='outside lower center', ncols=3, fontsize='small')
    return figure


def motion_columns(found: Diagnosis) -> list[str]:
    """Return the labels of the replays that some recording has."""
    return [_MODES[mode][0] for mode in _all_modes(found)]


def _all_modes(found: Diagnosis) -> list[str]:
    had = {mode for o in found.overlays.values() for mode in o.replays}
    return [mode for mode in sorted(_MODES) if mode in had]


def motion_rows(found: Diagnosis) -> list[dict[str, object]]:
    """Return the errors of the position by recording and joint, two cells for each replay."""
    modes = _all_modes(found)
    return [
        {
            'stem': recording_name(stem),
            'joint': f'{name} [{position_unit(found, j)}]',
            'cells': [
                _cell(o.replays[mode][side].rms[j], position_unit(found, j))
                if mode in o.replays else {'value': '', 'degrees': ''}
                for mode in modes for side, *_ in _SIDES
            ],
        }
        for stem, o in found.overlays.items() for j, name in enumerate(found.joints)
    ]  # fmt: skip


def _cell(x: float, unit: str) -> dict[str, str]:
    if not math.isfinite(x):
        return {'value': 'diverges', 'degrees': ''}
    return {
        'value': spoken(x), 'degrees': f'{_short(math.degrees(x))}°' if unit == 'rad' else ''
    }  # fmt: skip


def _short(x: float) -> str:
    return f'{x:.2g}' if abs(x) < 100.0 else f'{x:.0f}'


def _rms(x: np.ndarray) -> float:
    return float(np.sqrt((x**2).mean()))


def motion_card(found: Diagnosis) -> dict[str, str]:
    """Return the errors of the models in a replay, for the top of a page; empty without one."""
    stem = overlaid(found)
    if not stem:
        return {}
    name = worst_joint(found.proofs[stem])
    j, o = found.joints.index(name), found.overlays[stem]
    for mode in _preferred(found, stem)[:1]:
        sides, words = [o.replays[mode][side] for side, *_ in _sides(found)], _MODES[mode][1]
        if all(map(is_stable, sides)):
            errors = [float(s.rms[j]) for s in sides]
            return {
                'value': _change(errors, position_unit(found, j)),
                'label': f'rms error of the position of {name} on {recording_name(stem)}, '
                         f'simulated {words}',
            }  # fmt: skip
    return {}


def _change(errors: Sequence[float], unit: str) -> str:
    """Return errors before and after, angles in degrees."""
    if unit == 'rad':
        return f'{" -> ".join(_short(math.degrees(x)) for x in errors)}°'
    return f'{" -> ".join(map(spoken, errors))} {unit}'
