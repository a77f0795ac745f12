"""Rows in the order in which they came, contiguous, with room to lose the first without a copy."""

from __future__ import annotations

import numpy as np

ROOM = 64
"""Least number of rows that a window may slide before everything moves to the front."""


def length_for(capacity: int) -> int:
    """Return how many rows to hold so that a move of `capacity` rows is rare.

    A quarter more: the factor of n samples then moves once in n / 4 samples, which adds a
    hundredth to what each of them costs at n = 250 and less above.
    """
    return capacity + max(ROOM, capacity // 4)


class SlidingRows:
    """A growing list of rows in one block of memory.

    Attributes:
        start: first live row in the block.
        size: rows held.

    Args:
        capacity: most rows held at once.
        shape: of a row.
    """

    def __init__(self, capacity: int, shape: tuple[int, ...]) -> None:
        self._block = np.zeros((length_for(capacity), *shape))
        self.start = 0
        self.size = 0

    @property
    def rows(self) -> np.ndarray:
        """The rows in order, a view (size, ...)."""
        return self._block[self.start : self.start + self.size]

    @property
    def is_at_end(self) -> bool:
        """Whether the next row would move everything to the front."""
        return self.start + self.size == len(self._block)

    def append(self, row: np.ndarray) -> None:
        """Add a row at the end."""
        if self.is_at_end:
            self.replace(self.rows)
        self._block[self.start + self.size] = row
        self.size += 1

    def drop(self, m: int) -> None:
        """Remove row m; those before it move up. O(m), nothing is copied for m = 0."""
        self.size -= 1
        if m == self.size:
            return
        if m:
            live = slice(self.start, self.start + m)
            self._block[self.start + 1 : self.start + 1 + m] = self._block[live]
        self.start += 1

    def replace(self, rows: np.ndarray) -> None:
        """Hold these rows instead."""
        self._block[: len(rows)] = rows
        self.start, self.size = 0, len(rows)
