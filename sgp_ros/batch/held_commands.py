"""Exact averages over a uniform grid of commands that hold until the next one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True, eq=False)
class HeldCommands:
    """c commands to the robot's k joints, each of which holds until the next one.

    Attributes:
        stamps_ns: (c,) int64, from which each holds, strictly increasing [ns].
        effort: (c, k) [unit of the commands].
    """

    stamps_ns: np.ndarray
    effort: np.ndarray

    def age(self, stamps_ns: np.ndarray) -> np.ndarray:
        """Return how old the command in force is at each stamp, (n,) [s]; infinite without."""
        index = np.searchsorted(self.stamps_ns, stamps_ns, side='right') - 1
        age = (stamps_ns - self.stamps_ns[np.maximum(index, 0)]) * 1e-9
        return np.where(index >= 0, age, np.inf)

    def averages(self, start_ns: int, step: float, n: int) -> tuple[np.ndarray, np.ndarray]:
        """Average the commands over a grid of n points, exactly for any times of change.

        Args:
            start_ns: stamp of the first point [ns].
            step: between two points [s].
            n: number of points.

        Returns:
            centred (n, k), averaged about each point with the hat that reaches one step to either
            side, and following (n, k), the mean from each point to the next. Before the first
            command the first one holds.
        """
        changes = (self.stamps_ns - start_ns) * 1e-9 / step  # in steps after the first point
        edges = np.arange(-1.0, n + 1.0)
        inside = changes[(changes > edges[0]) & (changes < edges[-1])]
        bounds = np.union1d(edges, inside)
        left, right = bounds[:-1], bounds[1:]
        cell = np.searchsorted(edges, left, side='right') - 1  # cell i ends at point i
        index = np.searchsorted(changes, left, side='right') - 1
        value = self.effort[np.maximum(index, 0)]  # (pieces, k)
        a, b = left - edges[cell], right - edges[cell]
        rising = 0.5 * (b * b - a * a)
        width = b - a
        mean = _sums(cell, width[:, None] * value, n + 1)
        before = _sums(cell, rising[:, None] * value, n + 1)
        after = mean - before
        return before[:n] + after[1:], mean[1:]


def _sums(cell: np.ndarray, x: np.ndarray, cells: int) -> np.ndarray:
    """Add the rows of x (m, k) that fall into the same cell, (cells, k)."""
    columns = [np.bincount(cell, weights=column, minlength=cells) for column in x.T]
    return np.column_stack(columns)
