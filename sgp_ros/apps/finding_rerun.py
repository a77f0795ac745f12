"""`finding.rrd`: a diagnosis for the viewer Rerun, the same that `finding.mcap` holds for others.

| entity | archetype | content |
|---|---|---|
| `residual/JOINT/nominal`, `residual/JOINT/final` | Scalars | what the models leave |
| `residual/JOINT/lower`, `residual/JOINT/upper` | Scalars | 95 % of what the final model leaves |
| `robot` | LineStrips3D | links, coloured by their joint's share of the mismatch |
| `events` | TextLog | where and when the motion enters a region that was found |
| `verdict` | TextLog | the verdict in one sentence |

The only timeline is `time`, with the stamps of the recording.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from sgp_ros.apps.finding_file import (
    WARN,
    colour_of,
    coloured_links,
    entries,
    half_band,
    marked_rows,
)
from sgp_ros.diagnosis.result import Diagnosis
from sgp_ros.optional import optional_package
from sgp_ros.report.files import write_bytes
from sgp_ros.report.verdict import verdict_sentence
from sgp_ros.rigid.tree import Tree

TIMELINE = 'time'


def rerun_package() -> Any:
    """Return the package that writes the file.

    Raises:
        ConfigError: it is not installed.
    """
    return optional_package('rerun', 'for --rerun', 'rerun')


def write_rerun(path: Path, found: Diagnosis, tree: Tree, start_ns: int) -> None:
    """Write a diagnosis as a Rerun file.

    Args:
        path: of the file.
        found: the diagnosis.
        tree: of the robot.
        start_ns: stamp of the first state of the recording [ns].
    """
    rerun = rerun_package()
    stamps = start_ns + np.round(1e9 * found.traces.time).astype(np.int64)
    with rerun.RecordingStream('sgp_ros', recording_id=f'sgp_ros_{start_ns}') as stream:
        content = stream.binary_stream()
        stream.disable_timeline('log_time')
        stream.disable_timeline('log_tick')
        _write_residuals(rerun, stream, found, stamps)
        for i in marked_rows(found.traces.time):
            stream.set_time(TIMELINE, timestamp=np.datetime64(int(stamps[i]), 'ns'))
            links = list(coloured_links(found, tree, found.traces.position[i]))
            stream.log('robot', rerun.LineStrips3D(
                [line for _, line, _ in links],
                colors=[colour_of(share) for *_, share in links],
                labels=[f'{name} {100.0 * share:.0f} %' for name, _, share in links],
            ))  # fmt: skip
        for i, level, name, text in entries(found):
            stream.set_time(TIMELINE, timestamp=np.datetime64(int(stamps[i]), 'ns'))
            said = 'WARN' if level == WARN else 'INFO'
            stream.log('events', rerun.TextLog(f'{name}: {text}', level=said))
        stream.log('verdict', rerun.TextLog(verdict_sentence(found)), static=True)
        write_bytes(path, content.read())


def _write_residuals(rerun: Any, stream: Any, found: Diagnosis, stamps: np.ndarray) -> None:
    """Write what the models leave, and the band of the final one, joint by joint."""
    times = [rerun.TimeColumn(TIMELINE, timestamp=stamps.astype('datetime64[ns]'))]
    half = np.broadcast_to(half_band(found), found.traces.after.shape)
    curves = {
        'nominal': found.traces.before, 'final': found.traces.after, 'lower': -half, 'upper': half,
    }  # fmt: skip
    for j, joint in enumerate(found.joints):
        for name, values in curves.items():
            column = rerun.Scalars.columns(scalars=values[:, j])
            stream.send_columns(f'residual/{joint}/{name}', times, column)
