"""Held-out blocks of time, which prove a diagnosis where there is no other recording.

The recording is cut into equal parts, and the last quarter of each is held out. So what is held
out shows every phase of the recording, and its last block lies behind everything that was
learned, where a slow drift shows. States are smoothed and filters run within each block alone:
both sides share no sample.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sgp_ros.diagnosis.compare.grid import noise_density
from sgp_ros.diagnosis.compare.settled import HELD_BACK, every_fourth
from sgp_ros.diagnosis.compare.trajectory import (
    SHORTEST_ROWS,
    RawTrajectory,
)
from sgp_ros.physics.drive import Drive

HELD_OUT = 'held_out'
"""Name of the blocks among the recordings of a proof."""
SHARE = 0.25
MOST_BLOCKS = 4
_POSES_SAID = (
    f'Without --test, one pose in {HELD_BACK} was held out: the model was chosen and '
    'fitted on the others. Dry friction is assumed to be at its limit, against the direction of '
    'approach.'
)
LEAST_BLOCK_S = 2.4
"""Eight roll-outs; twice the longest filter and what it loses at both ends."""


def block_count(raw: RawTrajectory) -> int:
    """Return how many blocks are held out; 0 of a recording too short for one."""
    return min(MOST_BLOCKS, int(SHARE * len(raw.time) * raw.step / LEAST_BLOCK_S))


def split_sentence(raw: RawTrajectory) -> str:
    """Say what is held out of a recording that comes without others."""
    whole, blocks = len(raw.time) * raw.step, block_count(raw)
    if not blocks:
        least = LEAST_BLOCK_S / SHARE
        return (
            f'Nothing was held out: there is no --test, and {whole:.3g} s are too '
            f'short (a quarter is held out of {least:.3g} s or more).'
        )
    where = 'the last quarter' if blocks == 1 else f'the last quarter of each of {blocks} parts'
    return (
        f'Without --test, {where} of the recording was held out ({SHARE * whole:.3g} of '
        f'{whole:.3g} s): the model was chosen and fitted on the rest alone, and '
        'is written as it was tested.'
    )


def keep_back(
    raw: RawTrajectory,
) -> tuple[RawTrajectory, dict[str, RawTrajectory], tuple[str, ...]]:
    """Return the training data, the held-out blocks by name, and remarks."""
    if raw.approach is not None:
        learned, held = every_fourth(raw)
        return learned, {HELD_OUT: held}, (_POSES_SAID,)
    said = (split_sentence(raw),)
    if not block_count(raw):
        return raw, {}, said
    learned, held = split(raw)
    return learned, {HELD_OUT: held}, said


def split(raw: RawTrajectory) -> tuple[RawTrajectory, RawTrajectory]:
    """Return what to learn from, and what is held out.

    Args:
        raw: n rows; long enough for a block.

    Raises:
        ValueError: no block can be held out.
    """
    n, blocks = len(raw.time), block_count(raw)
    if not blocks:
        raise ValueError(f'{n * raw.step:g} s are too short to hold out a block')
    place = np.arange(n) * blocks / n  # (n,) in parts
    is_held = place % 1.0 >= 1.0 - SHARE
    return part_of(raw, ~is_held), part_of(raw, is_held)


def part_of(raw: RawTrajectory, is_kept: np.ndarray) -> RawTrajectory:
    """Return the stretches of some rows (n,) that are long enough, on the clock of the whole.

    Raises:
        ValueError: none is.
    """
    n = len(raw.time)
    segment = np.zeros(n, dtype=int)
    for i, s in enumerate(raw.segments):
        segment[s] = i
    edges = np.flatnonzero((np.diff(segment) != 0) | np.diff(is_kept)) + 1
    long = [run for run in np.split(np.arange(n), edges) if len(run) >= SHORTEST_ROWS]
    runs = [run for run in long if is_kept[run[0]]]
    if not runs:
        raise ValueError(f'no {SHORTEST_ROWS} rows in a row are kept')
    rows = np.concatenate(runs)
    ends = np.cumsum([len(run) for run in runs])
    segments = tuple(slice(end - len(run), end) for run, end in zip(runs, ends, strict=True))
    grids = tuple((float(raw.time[run[0]]), len(run)) for run in runs)
    position = raw.position[rows]
    drive = raw.drive
    if drive is not None:
        assert isinstance(drive, Drive)  # recordings are cut before they are joined
        drive = replace(drive, grids=grids)
    return replace(
        raw,
        time=raw.time[rows],
        position=position,
        velocity=None if raw.velocity is None else raw.velocity[rows],
        effort=None if raw.effort is None else raw.effort[rows],
        drive=drive,
        segments=segments,
        noise_density=noise_density(position, segments, raw.step),
    )
