"""Which combinations of the coefficients W a regressor determines: the base parameters.

Torques show only some combinations of a robot's parameters. The columns of the regressor are
brought to unit length, because kilograms and kilogram square metres have no common size. A
pivoted QR then picks independent columns, and each other column is a combination of these: its
parameter joins theirs (Gautier 1991). A parameter is identifiable by itself where no direction
of the null space touches it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from sgp_ros.gp.linear_algebra import singular_values, svd

_EPS = float(np.finfo(np.float64).eps)
_OPERATIONS = 4096.0
"""Rounding errors that one entry of a regressor may carry, in units of eps times the length of
its column: some hundred operations along a chain, and an order of magnitude for cancellation."""
ANGLE_TOLERANCE = 1e-6
"""Share of a combination that may lie in the null space before it counts as undetermined. The
computed null space is off by the rank tolerance over the least non-zero singular value, so this
is met where that one is above 1e-5; what is truly mixed has shares far larger."""


def rank_tolerance(rows: int, columns: int, relative_error: float = 0.0) -> float:
    """Return the singular value below which a scaled regressor's direction is zero.

    With columns of unit length, an error E moves a singular value by at most its norm (Weyl), and
    the norm of E is at most `sqrt(p)` times the error of one column. That error is made of the
    rounding in the entries, of the rounding in the factorisation, which grows like `sqrt(n)`,
    and of the noise in the motion from which the regressor was computed:
    `sqrt(p) (4096 eps + eps sqrt(n) + relative_error)`.

    Args:
        rows: n of the regressor, over all chunks.
        columns: p.
        relative_error: of a column against the true one, in the 2-norm; 0 for an exact motion.
    """
    return float(np.sqrt(columns) * (_EPS * (_OPERATIONS + np.sqrt(rows)) + relative_error))


@dataclass(frozen=True, slots=True, eq=False)
class RegressorFactor:
    """Triangle R with `R^T R = F^T F` of a regressor that came in chunks.

    It has the singular values and the null space of F, with all digits of F; a Gram matrix would
    have kept half of them.

    Attributes:
        R: (p, p) upper triangular.
        rows: number n of rows of F.
    """

    R: np.ndarray
    rows: int

    @classmethod
    def nothing(cls, columns: int) -> RegressorFactor:
        """Return the factor of a regressor of p columns without rows."""
        return cls(np.zeros((columns, columns)), 0)

    def with_rows(self, F: np.ndarray) -> RegressorFactor:
        """Return the factor with a chunk F (..., p) below what came before. O(n p^2).

        Raises:
            ValueError: another number of columns.
        """
        p = len(self.R)
        if F.shape[-1] != p:
            raise ValueError(f'chunk {F.shape} for a factor of {p} columns')
        chunk = F.reshape(math.prod(F.shape[:-1]), p)
        triangle = np.zeros((p, p))
        if p:
            upper = np.linalg.qr(np.vstack([self.R, chunk]), mode='r')
            triangle[: len(upper)] = upper
        return RegressorFactor(triangle, self.rows + len(chunk))

    def base_parameters(
        self, names: Sequence[str], *, tolerance: float | None = None
    ) -> BaseParameters:
        """Return the base parameters of all rows so far; see `base_parameters`."""
        if tolerance is None:
            tolerance = rank_tolerance(self.rows, len(self.R))
        return base_parameters(self.R, names, tolerance=tolerance)


@dataclass(frozen=True, slots=True, eq=False)
class BaseParameters:
    """Identifiability of the parameters from a regressor of p columns and rank r.

    Attributes:
        names: p names of the parameters.
        independent: r columns, ascending, that span all others.
        combinations: (r, p); `combinations @ w` are the base parameters. Row i has 1 at
            `independent[i]` and 0 at the other independent columns.
        scale: (p,) length of each column, 1 for a column that is zero.
        singular_values: (p,) of the scaled regressor, descending.
        directions: (p, p) its right singular vectors as rows, in scaled coefficients `scale * w`.
        tolerance: singular values up to this are zero.
        condition: ratio of the singular values of the scaled independent columns; 1 for none.
    """

    names: tuple[str, ...]
    independent: tuple[int, ...]
    combinations: np.ndarray
    scale: np.ndarray
    singular_values: np.ndarray
    directions: np.ndarray
    tolerance: float
    condition: float

    @property
    def rank(self) -> int:
        """Number r of base parameters."""
        return len(self.independent)

    @property
    def null(self) -> np.ndarray:
        """Changes of w that no row shows, (p, p - r), orthonormal when scaled."""
        return self.directions[self.rank :].T / self.scale[:, None]

    @property
    def identifiable(self) -> np.ndarray:
        """Whether each parameter is determined by itself, (p,) of bool."""
        return self.determines(np.eye(len(self.names)))

    @property
    def texts(self) -> tuple[str, ...]:
        """The r base parameters in words, such as `link2.mx + 0.3 * link2.mass`."""
        return tuple(
            self._text(row, column)
            for row, column in zip(self.combinations, self.independent, strict=True)
        )

    def determines(self, combinations: np.ndarray) -> np.ndarray:
        """Whether each of q combinations (q, p) of w is orthogonal to the null space, (q,)."""
        scaled = combinations / self.scale
        hidden = np.linalg.norm(scaled @ self.directions[self.rank :].T, axis=1)
        return hidden <= ANGLE_TOLERANCE * np.linalg.norm(scaled, axis=1)

    def _text(self, row: np.ndarray, column: int) -> str:
        share = np.abs(row) * self.scale[column] / self.scale
        share[column] = 0.0
        text = self.names[column]
        for j in np.flatnonzero(share > ANGLE_TOLERANCE):
            sign = '-' if row[j] < 0.0 else '+'
            factor = f'{abs(row[j]):.6g}'
            text += f' {sign} ' + ('' if factor == '1' else f'{factor} * ') + self.names[j]
        return text


def base_parameters(
    F: np.ndarray, names: Sequence[str], *, tolerance: float | None = None
) -> BaseParameters:
    """Return the base parameters of a regressor.

    `F[:, dependent] = F[:, independent] K` gives `F w = F[:, independent] beta` with
    `beta = w[independent] + K w[dependent]` (Gautier 1991, by a QR with column pivoting). A column
    shorter than rounding allows beside the longest one counts as zero. O(n p^2).

    Args:
        F: (..., p) regressor, or the triangle of its QR (`RegressorFactor`). Rows may be weighted
            by the noise of their joint.
        names: of the p parameters.
        tolerance: for singular values of the scaled regressor; None takes `rank_tolerance` for
            an exact motion.

    Raises:
        ValueError: the number of names is not p, or F is not finite.
    """
    p = F.shape[-1]
    rows = F.reshape(math.prod(F.shape[:-1]), p)
    if len(names) != p or not np.all(np.isfinite(F)):
        raise ValueError(f'{len(names)} names for a regressor {F.shape}, all finite expected')
    if tolerance is None:
        tolerance = rank_tolerance(len(rows), p)
    R = RegressorFactor.nothing(p).with_rows(rows).R
    scale = np.linalg.norm(R, axis=0)
    is_zero = scale <= _OPERATIONS * _EPS * scale.max(initial=0.0)
    scale[is_zero] = 1.0
    scaled = np.where(is_zero, 0.0, R / scale)  # (p, p)
    _, values, directions = svd(scaled, is_full=True)
    rank = int((values > tolerance).sum())
    independent, K = _combinations(scaled, rank)
    combinations = K * (scale / scale[independent][:, None])  # (r, p), of w again
    combinations[np.arange(rank), independent] = 1.0
    base = singular_values(scaled[:, independent])
    return BaseParameters(
        tuple(names),
        tuple(int(i) for i in independent),
        combinations,
        scale,
        values,
        directions,
        tolerance,
        float(base[0] / base[-1]) if rank else 1.0,
    )


def _combinations(scaled: np.ndarray, rank: int) -> tuple[np.ndarray, np.ndarray]:
    """Return r independent columns, ascending, and all p as combinations of them, (r, p)."""
    p = scaled.shape[1]
    if not p:
        return np.zeros(0, dtype=int), np.zeros((0, 0))
    _, R, pivots = linalg.qr(scaled, mode='economic', pivoting=True)
    K = np.zeros((rank, p))
    K[np.arange(rank), pivots[:rank]] = 1.0
    if 0 < rank < p:
        K[:, pivots[rank:]] = linalg.solve_triangular(R[:rank, :rank], R[:rank, rank:])
    order = np.argsort(pivots[:rank])
    return pivots[:rank][order], K[order]
