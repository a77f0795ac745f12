"""What bodies explain of the rows of one joint, as an orthonormal basis that no scale changes.

Frames of least squares scale the rows of each joint by another number in every iteration. With the
base of each joint as `Q_j R_j` only the small triangles are scaled and factored again: of
`[R_1 / s_1; ...; R_k / s_k; I] = S R` follows the basis `diag(Q_1, ..., Q_k, I) S` of all rows,
orthonormal to rounding. O(p^3 k) a frame instead of O(N k p^2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Factor:
    """Base of one joint (N, p) as `Q @ R`.

    Attributes:
        Q: (N, r) orthonormal, of the columns that are not zero.
        R: (r, p).
    """

    Q: np.ndarray
    R: np.ndarray

    @classmethod
    def of(cls, base: np.ndarray) -> Factor:
        """Return the factor of a base (N, p)."""
        seen = np.flatnonzero(base.any(axis=0))
        Q, own = np.linalg.qr(base[:, seen])
        R = np.zeros((len(own), base.shape[1]))
        R[:, seen] = own
        return cls(Q, R)
