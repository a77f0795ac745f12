"""Recordings at a high rate on the rows that their band needs.

No equation is formed above `HIGHEST_CUTOFF_HZ`, and every column of force is computed on all rows
before its filter: beyond some rows a period, more of them cost time and add no information.
Positions, velocities and measured efforts pass one low-pass before rows are left out, so that
noise between the two rates does not fold into the band, and the noise of the positions in the band
does not change. Commands hold until the next one on any grid; their efforts are averaged over its
steps.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sgp_ros.batch.zero_phase import ZeroPhase
from sgp_ros.diagnosis.compare.several import SeveralDrives
from sgp_ros.diagnosis.compare.trajectory import HIGHEST_CUTOFF_HZ, RawTrajectory
from sgp_ros.physics.drive import Drive
from sgp_ros.physics.motion import RecordedCommands

PER_PERIOD = 8.0
"""Least rows that stay per period of the highest cut-off."""
_PASSED, _ORDER = 0.4, 6
"""Cut-off of the low-pass in rates of the rows that stay, and its order: at the highest cut-off
its gain is 1 but for a millionth."""


def every_row_needed(raw: RawTrajectory) -> int:
    """Return the distance of the rows that stay; 1 where all do.

    All do of settled points, which are not a motion, and of position targets: the effort that a
    drive makes of them depends on the rows between which it holds.
    """
    if raw.approach is not None or raw.gains is not None:
        return 1
    return max(1, int(1.0 / (raw.step * PER_PERIOD * HIGHEST_CUTOFF_HZ) + 1e-6))


def thinned(raw: RawTrajectory) -> RawTrajectory:
    """Return a trajectory on the rows that its band needs; one at a low rate as it is."""
    every = every_row_needed(raw)
    if every == 1:
        return raw
    low = ZeroPhase(1.0 / raw.step, _PASSED / (raw.step * every), _ORDER)
    parts = [np.arange(s.start, s.stop, every) for s in raw.segments]
    pick, ends = np.concatenate(parts), np.cumsum([len(part) for part in parts])

    def passed(x: np.ndarray | None) -> np.ndarray | None:
        if x is None:
            return None
        return np.concatenate([low.smooth(x[s])[::every] for s in raw.segments])

    position = passed(raw.position)
    assert position is not None
    return replace(
        raw, time=raw.time[pick], step=raw.step * every, position=position,
        velocity=passed(raw.velocity), effort=passed(raw.effort),
        drive=None if raw.drive is None else _on_fewer(raw.drive, every),
        segments=tuple(
            slice(int(end) - len(part), int(end)) for end, part in zip(ends, parts, strict=True)
        ),
        recording=None if raw.recording is None else raw.recording[pick],
        blur=raw.blur / every**2,
    )  # fmt: skip


def _on_fewer(drive: RecordedCommands, every: int) -> RecordedCommands:
    """Return commands whose efforts are wanted only on every n-th point of each grid."""
    if isinstance(drive, SeveralDrives):
        return SeveralDrives(tuple(_on_fewer(part, every) for part in drive.parts))
    assert isinstance(drive, Drive)
    grids = tuple((first, -(-n // every)) for first, n in drive.grids)
    return replace(drive, grids=grids, step=drive.step * every)
