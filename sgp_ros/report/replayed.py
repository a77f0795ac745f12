"""The page of recorded commands that were replayed through a robot, and what it prints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sgp_ros.diagnosis.shown import Overlay
from sgp_ros.report.charts import Chart, Series, kept, spoken
from sgp_ros.report.metrics import versions
from sgp_ros.report.page import render_page

_TONES = {'nominal': 'nominal', 'simulated': 'final'}
_MODES = {
    'open_0.5': 'restarted from the measured state every 0.5 s, driven by the recorded efforts',
    'open_2': 'restarted from the measured state every 2 s, driven by the recorded efforts',
    'open_whole': 'from the first state on, driven by the recorded efforts',
    'closed_whole': 'from the first state on, driven by the recorded targets through the drives',
}


def render_replayed(
    robot: str, recording: str, joints: Sequence[str], units: Sequence[str], found: Overlay,
    remarks: Sequence[str],
) -> str:  # fmt: skip
    """Return the page as HTML; every text in it is escaped.

    Args:
        robot: name of the robot.
        recording: whose commands were replayed.
        joints: names, in the order of the arrays.
        units: of their efforts.
        found: measured and replayed motion.
        remarks: for the user.
    """
    charts = replay_charts(joints, units, found)
    lines = [
        (mode, _MODES[mode], [(name, _each(joints, r.rms)) for name, r in sides.items()])
        for mode, sides in found.replays.items()
    ]
    return render_page(
        'replayed.html', charts, {}, title=f'{recording} replayed through {robot}',
        lines=lines, shown=list(charts), remarks=list(remarks), versions=list(versions().items()),
    )  # fmt: skip


def replay_charts(joints: Sequence[str], units: Sequence[str], found: Overlay) -> dict[str, Chart]:
    """Return measured and replayed positions over time, by mode and joint."""
    charts = {}
    for mode, sides in found.replays.items():
        for j, joint in enumerate(joints):
            shown = {n: r.position[:, j] for n, r in sides.items() if np.isfinite(r.rms).all()}
            if not shown:
                continue
            rows = kept([found.position[:, j], *shown.values()])
            unit = 'm' if units[j] == 'N' else 'rad'
            series = [Series('measured', found.position[rows, j], 'measured', 'thick')]
            series += [Series(n, x[rows], _TONES[n]) for n, x in shown.items()]
            said = ', '.join(f'{n} {spoken(float(sides[n].rms[j]))} {unit}' for n in shown)
            charts[f'{mode} {joint}'] = Chart(
                f'{joint}, {mode}', f'Rms error: {said}.', 'time [s]', f'position [{unit}]',
                found.time[rows], series, group=mode,
            )  # fmt: skip
    return charts


def _each(joints: Sequence[str], rms: np.ndarray) -> str:
    if not np.isfinite(rms).all():
        return 'not stable'
    return ', '.join(f'{joint} {spoken(float(x))}' for joint, x in zip(joints, rms, strict=True))


def errors_text(joints: Sequence[str], found: Overlay) -> str:
    """Return the errors of all replays as lines of a terminal."""
    return '\n'.join(
        f'  {mode:13s} {name:10s} {_each(joints, r.rms)}'
        for mode, sides in found.replays.items()
        for name, r in sides.items()
    )
