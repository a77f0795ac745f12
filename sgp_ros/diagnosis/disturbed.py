"""Stretches of time in which something else acts on the robot: a hand, a contact, a tool.

What a law makes comes back where its joint comes back. A force that is many times what the usual
laws leave at all other times, in states that its joint passes at other times without it, is none.
Where the rest of a recording is explained without such stretches, they are left out and said.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.connected import Connected
from sgp_ros.diagnosis.connecting import connect
from sgp_ros.diagnosis.criteria import DISTURBED, MOST_DISTURBED
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.fitted_model import first_scale, floors
from sgp_ros.diagnosis.explain.joint_search import usual
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.gathered import Recordings
from sgp_ros.diagnosis.prove.held_out import part_of
from sgp_ros.errors import RecordingError
from sgp_ros.rigid.tree import Tree

_BLOCKS = 100
_ROUNDS = 12
_NORMAL = 1.4826
"""Standard deviation of a normal variable over the median of its size."""
_HUBER = 1.345
"""Deviations from which a row counts for less: 95 % efficient without such rows (Huber 1964)."""
_NEAR = 0.25
"""Distance of states of a joint that are the same, in standard deviations."""
_REVISITED = 0.5
"""Share of a stretch whose states a joint passes at other times."""
_UNLIKE = 0.25
"""Mean square, over that of the rest, by which what comes back may differ."""


def undisturbed(
    recordings: Recordings, tree: Tree, progress: Callable[[float], None]
) -> Connected:
    """Return what `connect` does, without the time in which something else acts, if that helps."""
    connected = connect(recordings, tree, progress)
    raw, decision = recordings.learned, connected.several.decision
    is_one = raw.recording is None and raw.approach is None
    if not is_one or not decision.unknown or connected.correction is not None:
        return connected
    spans = disturbance(connected.equations)
    if not spans:
        return connected
    is_out = np.zeros(len(raw.time), dtype=bool)
    for start, end in spans:
        is_out |= (raw.time >= start) & (raw.time <= end)
    try:
        calm = replace(recordings, learned=part_of(raw, ~is_out))
        again = connect(calm, tree, lambda _: None)
    except (RecordingError, ValueError):  # too little is left to decide
        return connected
    if again.several.decision.unknown:
        return connected
    times = ', '.join(f'{start:.1f} to {end:.1f} s' for start, end in spans)
    said = (
        f'Something else acted on the robot from {times}, such as a hand or a contact: the same '
        'states come at other times without its force. This time was left out.'
    )
    return replace(again, remarks=(said, *again.remarks))


def disturbance(equations: Equations) -> tuple[tuple[float, float], ...]:
    """Return times between which something else acts [s]; none if it acts for too long."""
    rows = equations.filter.rows
    time, blocks = equations.motion.time[rows], np.array_split(np.arange(len(rows)), _BLOCKS)
    rest = _unusual(equations)
    square = rest**2
    found = np.array([len(b) and square[b].max(axis=1).mean() > DISTURBED for b in blocks])
    found = np.convolve(found, np.ones(3), 'same') > 0  # it begins and ends within a block
    inside = np.logical_or.accumulate(~found) & np.logical_or.accumulate(~found[::-1])[::-1]
    found &= inside  # how a recording starts and ends is no contact
    is_out = np.concatenate([np.full(len(b), x) for b, x in zip(blocks, found, strict=True)])
    if not 0.0 < is_out.mean() < MOST_DISTURBED:
        return ()
    joints = np.flatnonzero(square[is_out].mean(axis=0) > DISTURBED)
    if not all(_is_revisited(equations, int(j), is_out) for j in joints):
        return ()
    if any(_is_of_load(equations, int(j), rest[:, j], is_out) for j in joints):
        return ()
    edges = np.flatnonzero(np.diff(np.concatenate([[False], is_out, [False]]).astype(int)))
    return tuple(
        (float(time[a]), float(time[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)
    )


def _unusual(equations: Equations) -> np.ndarray:
    """Return what usual laws and bodies leave of each row, in deviations of the most, (N, k).

    Rows that leave much count for less (Huber 1964), so that the laws are those of the others.
    """
    columns = Columns(equations)
    start = first_scale(equations)
    model = usual(columns, fit(columns, (), start, is_free=True))
    equations = model.frame.equations
    N, k = equations.d.shape
    laws = [columns.of(s, equations, model.w) for s in model.effects]
    X = np.concatenate([equations.base, *laws], axis=2)
    scale, weight, r = model.sigma, np.ones((N, k)), model.residual
    prior = np.eye(equations.size, X.shape[2])
    for _ in range(_ROUNDS):
        scale = np.maximum(_NORMAL * np.median(np.abs(r), axis=0), np.sqrt(floors(equations)))
        weight = np.sqrt(np.minimum(1.0, _HUBER * scale / np.maximum(np.abs(r), 1e-300))) / scale
        A = np.concatenate([(X * weight[:, :, None]).reshape(N * k, -1), prior])
        y = np.concatenate([(equations.d * weight).ravel(), np.zeros(len(prior))])
        r = equations.d - X @ np.linalg.lstsq(A, y, rcond=None)[0]
    return np.asarray(r / scale)


def _is_revisited(equations: Equations, j: int, is_out: np.ndarray) -> bool:
    """Return whether most states of a joint in some rows (N,) are those of other rows, too."""
    motion, rows = equations.motion, equations.filter.rows
    x = _scaled(motion.wrapped[rows, j], motion.velocity[rows, j])
    distance = cKDTree(x[~is_out]).query(x[is_out])[0]
    return bool(np.mean(distance < _NEAR) > _REVISITED)


def _is_of_load(equations: Equations, j: int, r: np.ndarray, is_out: np.ndarray) -> bool:
    """Return whether the rest r (N,) of a joint is the same under the same load in all stretches.

    That of a motor which fails under a large load is, and that of a hand is not.
    """
    load = _scaled(equations.motion.nominal_effort[equations.filter.rows, j])[is_out]
    r, stretch = r[is_out], np.cumsum(np.diff(is_out.astype(int), prepend=0) > 0)[is_out]
    other = np.full(len(r), np.nan)
    for i in np.unique(stretch):
        elsewhere = stretch != i
        if elsewhere.any():
            distance, at = cKDTree(load[elsewhere]).query(load[~elsewhere])
            other[~elsewhere] = np.where(distance < _NEAR, r[elsewhere][at], np.nan)
    is_near = np.isfinite(other)
    unlike = ((r - other)[is_near] ** 2).sum() > _UNLIKE * (r[is_near] ** 2).sum()
    return bool(is_near.mean() > _REVISITED and not unlike)


def _scaled(*signals: np.ndarray) -> np.ndarray:
    """Return signals (N,) in their standard deviations, (N, signals)."""
    x = np.column_stack(signals)
    return x / np.maximum(x.std(axis=0), 1e-300)
