"""`overlay.json` and `overlay.npz`: measured, nominal and diagnosed motion, for reports."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sgp_ros.diagnosis.shown import Overlay
from sgp_ros.report.files import write_bytes, write_text


def write_overlay(
    folder: Path, joints: Sequence[str], units: Sequence[str], found: Mapping[str, Overlay]
) -> None:
    """Write both files; nothing where no recording was replayed.

    Args:
        folder: of the results.
        joints: names, in the order of the arrays.
        units: of their efforts.
        found: motions by the name of the recording.
    """
    if not found:
        return
    arrays: dict[str, Any] = _series(found)
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    write_bytes(folder / 'overlay.npz', stream.getvalue())
    text = json.dumps(overlay_content(joints, units, found), indent=1, allow_nan=False)
    write_text(folder / 'overlay.json', text + '\n')


def overlay_content(
    joints: Sequence[str], units: Sequence[str], found: Mapping[str, Overlay]
) -> dict[str, Any]:
    """Return the errors of overlays by recording; arguments as those of `write_overlay`."""

    def by_joint(x: np.ndarray) -> dict[str, float] | None:
        return dict(zip(joints, map(float, x), strict=True)) if np.isfinite(x).all() else None

    return {
        'schema': 1,
        'series': 'overlay.npz',
        'recordings': {
            stem: {
                'joints': list(joints),
                'units': {
                    'position': ['m' if unit == 'N' else 'rad' for unit in units],
                    'effort': list(units),
                },
                'seconds': o.seconds,
                'effort_rms': {
                    name: by_joint(np.sqrt(((o.effort - x) ** 2).mean(axis=0)))
                    for name, x in o.efforts.items()
                },
                'modes': {
                    mode: {'position_rms': {n: by_joint(r.rms) for n, r in sides.items()}}
                    for mode, sides in o.replays.items()
                },
            }
            for stem, o in found.items()
        },
    }


def _series(found: Mapping[str, Overlay]) -> dict[str, np.ndarray]:
    series: dict[str, np.ndarray] = {}
    for stem, o in found.items():
        series |= {
            f'{stem}/time': o.time, f'{stem}/position': o.position, f'{stem}/effort': o.effort
        }  # fmt: skip
        series |= {f'{stem}/effort_{name}': x for name, x in o.efforts.items()}
        series |= {
            f'{stem}/{mode}_{name}': r.position
            for mode, sides in o.replays.items()
            for name, r in sides.items()
            if np.isfinite(r.rms).all()
        }
    return series


def write_series(path: Path, joints: Sequence[str], found: Overlay) -> None:
    """Write measured and replayed positions as a table, a row a time; nothing without replays."""
    columns = {'t': found.time}
    for j, joint in enumerate(joints):
        columns[f'{joint}_measured'] = found.position[:, j]
        for mode, sides in found.replays.items():
            columns |= {f'{joint}_{mode}_{n}': r.position[:, j] for n, r in sides.items()}
    rows = zip(*columns.values(), strict=True)
    lines = [','.join('' if math.isnan(x) else f'{x:.9g}' for x in row) for row in rows]
    write_text(path, '\n'.join([','.join(columns), *lines]) + '\n')
