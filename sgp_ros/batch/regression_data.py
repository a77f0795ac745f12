"""The equation of motion of a whole recording, both sides through one filter, thinned out.

Parallel filtering: the columns of f are computed at the full rate from lightly smoothed states;
then columns and target pass one and the same low-pass, and every `decimation`-th row is kept. A
linear equation stays an equation under a linear filter, whatever the columns are: a change of
direction is smeared equally in `sign(v)` and in the effort. Source: Swevers, Verdonck and De
Schutter 2007 for the filtering of both sides.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.batch.signals import Signals
from sgp_ros.batch.zero_phase import ZeroPhase
from sgp_ros.errors import ConfigError, RecordingError
from sgp_ros.physics.term import CHANNELS, INPUT_CHANNELS, Motion
from sgp_ros.robots.robot import Robot

CHUNK_BYTES = 40_000_000
"""Most that the columns of f at the full rate take at once; the filter holds a few copies."""


@dataclass(frozen=True, slots=True)
class FilterPlan:
    """How a recording is filtered.

    Attributes:
        cutoff: of the low-pass that every column and the target pass [Hz].
        state_cutoff: of the light smoothing of the states, well above `cutoff` [Hz].
        decimation: every how many samples a row is kept.
        velocity_source: `measured`, or `position` to differentiate.
    """

    cutoff: float
    state_cutoff: float
    decimation: int
    velocity_source: str = 'position'


@dataclass(frozen=True, slots=True, eq=False)
class FilteredData:
    """n rows of `y = F W + Z`, filtered and thinned out.

    Attributes:
        time: (n,) [s], on the clock of the signals.
        U: (n, 5 k) what Z could see, as `Robot.inputs` lays it out, filtered too: a direction
            fades in and out as it does in the columns and in the target.
        F: (n, k, p).
        y: (n, k) filtered target.
        rate: of the rows inside a block [Hz].
        block: (n,) int; rows of one number follow each other without a gap.
    """

    time: np.ndarray
    U: np.ndarray
    F: np.ndarray
    y: np.ndarray
    rate: float
    block: np.ndarray

    @property
    def motion(self) -> Motion:
        """Filtered states, accelerations and efforts, views of U."""
        return Motion(*np.split(self.U, len(INPUT_CHANNELS), axis=1)[: len(CHANNELS)])

    def rows(self, chosen: np.ndarray) -> FilteredData:
        """Return some rows, by increasing indices or a mask; a hole starts a new block."""
        index = np.arange(len(self.time))[chosen]
        breaks = (np.diff(index) > 1) | (np.diff(self.block[index]) != 0)
        block = np.concatenate([[0], np.cumsum(breaks)]).astype(np.int64)[: len(index)]
        return self._at(index, block, self.rate)

    def thinned(self, decimation: int) -> FilteredData:
        """Return every `decimation`-th row of each block."""
        if decimation == 1:
            return self
        starts = np.flatnonzero(np.concatenate([[True], np.diff(self.block) != 0]))
        lengths = np.diff([*starts, len(self.block)])
        place = np.arange(len(self.block)) - np.repeat(starts, lengths)
        index = np.flatnonzero(place % decimation == 0)
        return self._at(index, self.block[index], self.rate / decimation)

    def _at(self, index: np.ndarray, block: np.ndarray, rate: float) -> FilteredData:
        return FilteredData(
            self.time[index], self.U[index], self.F[index], self.y[index], rate, block
        )


def filtered_data(signals: Signals, robot: Robot, plan: FilterPlan) -> FilteredData:
    """Return the filtered equation of motion of a recording.

    Raises:
        ConfigError: cut-offs that the rate does not allow, or a velocity that was not measured.
        RecordingError: every segment is shorter than the transients of the filters.
    """
    if plan.velocity_source == 'measured' and signals.velocity is None:
        raise ConfigError('velocity source measured, but no velocity was recorded', 'position')
    light = ZeroPhase(signals.rate, plan.state_cutoff)
    lowpass = ZeroPhase(signals.rate, plan.cutoff)
    trim = light.trim + lowpass.trim
    parts = []
    for number, segment in enumerate(signals.segments):
        length = segment.stop - segment.start
        kept = np.arange(trim, length - trim, plan.decimation)
        if len(kept):
            part = _segment_data(signals, robot, plan, segment, kept, light, lowpass)
            parts.append(replace(part, block=np.full(len(kept), number)))
    if not parts:
        longest = max(s.stop - s.start for s in signals.segments) / signals.rate
        raise RecordingError(
            f'the longest segment lasts {longest:.3g} s',
            f'more than {2 * trim / signals.rate:.3g} s at a cut-off of {plan.cutoff:g} Hz',
            'use a longer recording or a higher cut-off',
        )
    return joined(parts)


def joined(parts: list[FilteredData]) -> FilteredData:
    """Put data of one rate one after the other, their blocks as they are."""
    return FilteredData(
        np.concatenate([part.time for part in parts]),
        np.concatenate([part.U for part in parts]),
        np.concatenate([part.F for part in parts]),
        np.concatenate([part.y for part in parts]),
        parts[0].rate,
        np.concatenate([part.block for part in parts]),
    )


def smoothed_motion(
    signals: Signals, segment: slice, velocity_source: str, light: ZeroPhase
) -> Motion:
    """Return the lightly smoothed motion of a segment at the full rate, n rows."""
    velocity = None
    if velocity_source == 'measured':
        assert signals.velocity is not None
        velocity = signals.velocity[segment]
    states = light.states(signals.position[segment], velocity)
    return Motion(*states, light.smooth(signals.effort[segment]))


def _segment_data(
    signals: Signals,
    robot: Robot,
    plan: FilterPlan,
    segment: slice,
    kept: np.ndarray,
    light: ZeroPhase,
    lowpass: ZeroPhase,
) -> FilteredData:
    motion = smoothed_motion(signals, segment, plan.velocity_source, light)
    U = lowpass.smooth(robot.inputs(motion))[kept]
    F = np.concatenate(list(_filtered_columns(robot, motion, lowpass, kept)))
    target = np.split(U, len(INPUT_CHANNELS), axis=1)[INPUT_CHANNELS.index(robot.target)]
    time = signals.time[segment][kept]
    rate = signals.rate / plan.decimation
    return FilteredData(time, U, F, target, rate, np.zeros(len(kept), dtype=np.int64))


def _filtered_columns(
    robot: Robot, motion: Motion, lowpass: ZeroPhase, kept: np.ndarray
) -> Iterator[np.ndarray]:
    """Yield the filtered columns at the rows `kept`, a chunk at a time.

    Chunks overlap by three times the trim of the filter, where its transient is below 1e-9.
    """
    n, k = motion.position.shape
    overlap = 3 * lowpass.trim
    row_bytes = 8 * k * max(len(robot.coefficients), 1)
    length = max(CHUNK_BYTES // row_bytes - 2 * overlap, overlap)
    for start in range(0, n, length):
        inside = kept[(kept >= start) & (kept < start + length)]
        if not len(inside):
            continue
        low, high = max(start - overlap, 0), min(start + length + overlap, n)
        columns = robot.regressor(Motion(*(x[low:high] for x in _channels(motion))))
        flat = columns.reshape(high - low, -1)
        used = flat.any(axis=0)
        result = np.zeros((len(inside), flat.shape[1]))
        result[:, used] = lowpass.smooth(flat[:, used])[inside - low]
        yield result.reshape(len(inside), *columns.shape[1:])


def _channels(motion: Motion) -> tuple[np.ndarray, ...]:
    return motion.position, motion.velocity, motion.acceleration, motion.effort
