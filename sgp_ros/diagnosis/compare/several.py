"""Several recordings of one robot as one trajectory, each with its own clock, rate and drive.

The rows of all recordings stand one after the other, and no filter crosses from one to the next.
They are brought to the grid of the slowest recording. Time counts from the beginning of each
recording, as laws of the clock such as warm-up do.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.diagnosis.compare.trajectory import RawTrajectory
from sgp_ros.physics.motion import RecordedCommands

_NO_COMMANDS = (
    'Only some of the recordings have usable commands: the measured efforts are used instead, so '
    'nothing can be said about delay, dead zone, saturation and lag of the drive.'
)


@dataclass(frozen=True, slots=True, eq=False)
class SeveralDrives:
    """Commands to the drives in recordings one after the other.

    Attributes:
        parts: of each recording.
    """

    parts: tuple[RecordedCommands, ...]

    @property
    def values(self) -> np.ndarray:
        """Commands of all recordings, (c, k) [N m or N]."""
        return np.concatenate([part.values for part in self.parts])

    def effort(
        self, joint: int, *, delay: float = 0.0, time_constant: float = 0.0,
        characteristic: Callable[[np.ndarray], np.ndarray] | None = None,
    ) -> np.ndarray:  # fmt: skip
        """Return the effort of a joint behind delay, characteristic and lag, (n,) [N m or N]."""
        return np.concatenate(
            [
                part.effort(joint, delay=delay, time_constant=time_constant,
                            characteristic=characteristic)
                for part in self.parts
            ]
        )  # fmt: skip

    def changed(self, change: Callable[[np.ndarray], np.ndarray], later: float) -> SeveralDrives:
        """Return other commands, some time later [s]."""
        return SeveralDrives(tuple(part.changed(change, later) for part in self.parts))

    @property
    def rows(self) -> int:
        """Number n of rows of all recordings."""
        return sum(part.rows for part in self.parts)

    def on(self, stretches: Sequence[slice]) -> SeveralDrives:
        """Return the commands of some stretches of the rows, each of one recording."""
        found, first = [], 0
        for part in self.parts:
            end = first + part.rows
            own = [
                slice(s.start - first, s.stop - first) for s in stretches if first <= s.start < end
            ]
            found += [part.on(own)] * bool(own)
            first = end
        return SeveralDrives(tuple(found))


def join(raws: Sequence[RawTrajectory]) -> RawTrajectory:
    """Return recordings as one trajectory; of one recording, that.

    Args:
        raws: on grids of one step.

    Raises:
        ValueError: grids of different steps.
    """
    first = raws[0]
    if len(raws) == 1:
        return first
    if any(raw.step != first.step for raw in raws):
        raise ValueError(f'grids of {sorted({raw.step for raw in raws})} s, expected one step')
    starts = np.cumsum([0, *(len(raw.time) for raw in raws)])
    segments = tuple(
        slice(s.start + int(start), s.stop + int(start))
        for raw, start in zip(raws, starts, strict=False)
        for s in raw.segments
    )
    drives = tuple(raw.drive for raw in raws if raw.drive is not None)
    is_driven = len(drives) == len(raws)
    refused: Counter[str] = Counter()
    for raw in raws:
        refused.update(raw.refused)
    remarks = [remark for raw in raws for remark in raw.remarks]
    remarks += [_NO_COMMANDS] if drives and not is_driven else []
    return RawTrajectory(
        np.concatenate([raw.time for raw in raws]), first.step,
        np.concatenate([raw.position for raw in raws]),
        _joined([raw.velocity for raw in raws]),
        _joined([_efforts(raw) for raw in raws]),
        SeveralDrives(drives) if is_driven else None,
        segments, dict(refused), np.max([raw.noise_density for raw in raws], axis=0),
        first.start_ns, first.stated, tuple(dict.fromkeys(remarks)),
        recording=np.repeat(np.arange(len(raws)), np.diff(starts)),
        approach=_joined([raw.approach for raw in raws]),
        gains=first.gains if is_driven else None, blur=float(np.mean([raw.blur for raw in raws])),
    )  # fmt: skip


def alone(raw: RawTrajectory, recording: int) -> RawTrajectory:
    """Return one of several recordings that were joined.

    Args:
        raw: the joined ones.
        recording: index.
    """
    assert raw.recording is not None
    rows = np.flatnonzero(raw.recording == recording)
    first, end = int(rows[0]), int(rows[-1]) + 1

    def own(x: np.ndarray | None) -> np.ndarray | None:
        return None if x is None else x[first:end]

    return replace(
        raw, time=raw.time[first:end], position=raw.position[first:end],
        velocity=own(raw.velocity), effort=own(raw.effort), approach=own(raw.approach),
        drive=raw.drive.parts[recording] if isinstance(raw.drive, SeveralDrives) else None,
        segments=tuple(
            slice(s.start - first, s.stop - first) for s in raw.segments if first <= s.start < end
        ),
        recording=None,
    )  # fmt: skip


def _efforts(raw: RawTrajectory) -> np.ndarray | None:
    """Return the efforts that act, (n, k); None without any."""
    if raw.drive is None or raw.effort is not None or raw.gains is not None:
        return raw.effort
    k = raw.position.shape[1]
    return np.column_stack([raw.drive.effort(j) for j in range(k)])


def _joined(parts: Sequence[np.ndarray | None]) -> np.ndarray | None:
    """Return arrays one after the other; None where a recording has none."""
    arrays = [part for part in parts if part is not None]
    return np.concatenate(arrays) if len(arrays) == len(parts) else None
