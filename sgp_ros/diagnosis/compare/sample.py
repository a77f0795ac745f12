"""Few rows of a long recording, on which candidates are looked at before they are fitted.

Rows are correlated and effects remember, so rows stay together in blocks. Half of the blocks lie
evenly over the recording. What is rare must be among them too, such as an end stop that is hit
twice: the others are those in which the discrepancy, position, effort, velocity or acceleration of
some joint is largest or smallest.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.compare.parallel_filter import ParallelFilter

SCREENED_ROWS = 2000
"""Rows on which candidates are looked at: half a minute at the highest cut-off has as many."""
BLOCK = 64
"""Rows that stay together: about a second at the highest cut-off."""
LEAD_S = 0.3
"""Time before each block that effects with memory see [s]."""


def sampled(equations: Equations) -> Equations:
    """Return the equations of at most `SCREENED_ROWS` rows; all of a short recording.

    Rows, columns and target are those of the whole; only memories restart in each block.
    """
    motion, low = equations.motion, equations.filter
    if len(equations.d) <= SCREENED_ROWS or motion.is_static:
        return equations
    chosen = _joined(_chosen(equations, _blocks(low), SCREENED_ROWS // BLOCK), low)
    rows, lead = low.rows, round(LEAD_S / motion.step)
    stretches, segments, at = [], [], 0
    for block in chosen:
        first, last = int(rows[block.start]), int(rows[block.stop - 1])
        stop = last + low.margin + 1
        start = max(first - low.margin - lead, _start_of(low, first))
        stretches.append(slice(start, stop))
        segments.append(slice(at + first - low.margin - start, at + stop - start))
        at += stop - start
    pick = np.concatenate([np.arange(s.start, s.stop) for s in stretches])
    kept = np.concatenate([np.arange(b.start, b.stop) for b in chosen])
    return replace(
        equations, motion=motion.on(stretches),
        filter=ParallelFilter(low.rate, low.cutoff, tuple(segments)),
        time=equations.time[kept], d=equations.d[kept],
        bases=tuple(base[kept] for base in equations.bases),
        moving=equations.moving[pick], rests=equations.rests[pick], free=None,
    )  # fmt: skip


def _start_of(low: ParallelFilter, row: int) -> int:
    """Return where the stretch without a pause begins that a row lies in."""
    return max(s.start for s in low.segments if s.start <= row)


def _blocks(low: ParallelFilter) -> list[slice]:
    """Return all rows out in blocks, none across a pause."""
    blocks, first = [], 0
    for kept in low.kept:
        end = first + len(kept)
        blocks += [slice(a, min(a + BLOCK, end)) for a in range(first, end, BLOCK)]
        first = end
    return blocks


def _chosen(equations: Equations, blocks: list[slice], count: int) -> list[slice]:
    """Return at most `count` blocks in their order."""
    taken = set(np.linspace(0, len(blocks) - 1, count // 2).astype(int).tolist())
    for block in _extreme(equations, [block.start for block in blocks]):
        if len(taken) == count:
            break
        taken.add(block)
    return [blocks[i] for i in sorted(taken)]


def _extreme(equations: Equations, starts: list[int]) -> Iterator[int]:
    """Yield the numbers of the blocks in which something of a joint is largest or smallest."""
    motion, rows = equations.motion, equations.filter.rows
    for signal in (
        equations.d, motion.wrapped[rows], motion.effort[rows], motion.velocity[rows],
        motion.acceleration[rows],
    ):  # fmt: skip
        yield from np.maximum.reduceat(signal, starts, axis=0).argmax(axis=0).tolist()
        yield from np.minimum.reduceat(signal, starts, axis=0).argmin(axis=0).tolist()


def _joined(blocks: list[slice], low: ParallelFilter) -> list[slice]:
    """Return blocks with neighbours joined, unless a pause lies between them."""
    rows, found = low.rows, blocks[:1]
    for block in blocks[1:]:
        if block.start == found[-1].stop and rows[block.start] - rows[block.start - 1] == (
            low.decimation
        ):
            found[-1] = slice(found[-1].start, block.stop)
        else:
            found.append(block)
    return found
