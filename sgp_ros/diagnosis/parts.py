"""Parts of a recording that are left out in turn, each of stretches spread over all of it.

Source: cross-validation in blocks, for rows that are correlated in time (Burman, Chow and Nolan
1994).
"""

from __future__ import annotations

import numpy as np

PARTS = 6
"""Parts that are left out in turn."""
PIECES = 4
"""Stretches of each part."""


def parts_of(rows: int, pieces: int = PIECES) -> np.ndarray:
    """Return the part that each row belongs to, (rows,); each has so many stretches."""
    return np.asarray(np.arange(rows) * PARTS * pieces // rows % PARTS)
