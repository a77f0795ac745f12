"""Square-root information on W: a triangular system `R w = z` of unit noise that grows by rows.

The posterior is N(R^-1 z, (R^T R)^-1). A row of zeros in R is a direction nothing has determined
yet; until there is none, echelon form (`gp.echelon`) takes the place of the triangular solve for
what is determined beyond doubt, and an orthogonal decomposition with scaled columns elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import cached_property

import numpy as np
from scipy import linalg

from sgp_ros.gp.echelon import Echelon
from sgp_ros.gp.linear_algebra import symmetric_eigen
from sgp_ros.gp.model import CoefficientPrior
from sgp_ros.gp.posterior import NULL_TOLERANCE, RANK_TOLERANCE, ZERO_COLUMN
from sgp_ros.gp.rotations import (
    absorb_rows,
    absorbed_rows_numpy,
    has_safe_diagonal,
    predict_rows,
    solve_rows,
    solve_upper,
)

DIFFERENCE_TOLERANCE = 1e-10
"""Share of a precision below which a difference from it is rounding."""


class Information:
    """Square-root information on p coefficients.

    Args:
        R: (p, p) upper triangular.
        z: (p,).
    """

    def __init__(self, R: np.ndarray, z: np.ndarray) -> None:
        self.R = R
        self.z = z
        self._solved: _Solved | None = None

    @classmethod
    def nothing(cls, p: int) -> Information:
        """Return no information on p coefficients."""
        return cls(np.zeros((p, p)), np.zeros(p))

    @classmethod
    def of_prior(cls, prior: CoefficientPrior) -> Information:
        """Return the information that a prior holds."""
        p = prior.size
        return cls(*absorbed_rows_numpy(np.zeros((p, p)), np.zeros(p), prior.root, prior.target))

    def copy(self) -> Information:
        """Return an independent copy."""
        return Information(self.R.copy(), self.z.copy())

    def absorb(self, rows: np.ndarray) -> None:
        """Add equations of unit noise, their values in the last column of rows (r, p + 1).

        O(r p^2).
        """
        absorb_rows(self.R, self.z, rows.copy())
        self._solved = None

    def add(self, other: Information) -> None:
        """Add what another state tells, of independent samples. O(p^3)."""
        self.absorb(np.column_stack([other.R, other.z]))

    def fade(self, factor: float) -> None:
        """Let all equations count `factor` times as much as before, their noise still one."""
        self.R *= factor
        self.z *= factor
        self._solved = None

    def scaled(self, factor: float) -> Information:
        """Return this information as if its noise had had `1 / factor` times the deviation."""
        return Information(factor * self.R, factor * self.z)

    def with_rows(self, rows: np.ndarray, values: np.ndarray) -> Information:
        """Return this information with equations `rows (r, p) w = values (r,)` added."""
        return Information(*absorbed_rows_numpy(self.R, self.z, rows, values))

    def less(self, other: Information) -> Information:
        """Return what this holds beside `other`, of which it must hold all, up to rounding.

        The difference of the precisions `R^T R`, scaled to a diagonal of one, by its
        eigenvectors. Where it is lost in rounding nothing is returned, never less. O(p^3).
        """
        scale = np.sqrt((self.R * self.R).sum(axis=0))
        scale[scale == 0.0] = 1.0
        own, others = self.R / scale, other.R / scale
        values, vectors = symmetric_eigen(own.T @ own - others.T @ others)
        is_known = values > DIFFERENCE_TOLERANCE
        roots, rows = np.sqrt(values[is_known]), vectors[:, is_known].T
        z = rows @ (own.T @ self.z - others.T @ other.z) / roots
        return Information.nothing(len(scale)).with_rows(roots[:, None] * rows * scale, z)

    @property
    def coefficients(self) -> np.ndarray:
        """Posterior mean of W, (p,); undetermined directions at zero."""
        return self._solution().w

    @property
    def is_identifiable(self) -> np.ndarray:
        """Whether each coefficient is determined, (p,) of bool."""
        return np.linalg.norm(self._solution().null, axis=1) < NULL_TOLERANCE

    @property
    def covariance(self) -> np.ndarray:
        """Posterior covariance over the determined directions, (p, p)."""
        spread = self.spread(np.eye(len(self.z)))
        return spread @ spread.T

    def spread(self, rows: np.ndarray) -> np.ndarray:
        """Return S (k, r) such that `rows W` has covariance `S S^T`, for rows (k, p)."""
        solved = self._solution()
        if not solved.is_triangular:
            return rows @ solved.decomposition.spread
        solution = rows.copy()
        solve_rows(self.R, solution)
        return solution

    def is_determined(self, rows: np.ndarray) -> np.ndarray:
        """Whether `rows W` leaves out every undetermined direction, (k,) for rows (k, p)."""
        solved = self._solution()
        if solved.is_triangular:
            return np.ones(len(rows), dtype=bool)
        scaled = rows / solved.scale
        outside = np.linalg.norm(scaled @ solved.null, axis=1)
        return outside <= NULL_TOLERANCE * np.linalg.norm(scaled, axis=1)

    def predict(
        self, rows: np.ndarray, mean: np.ndarray, variance: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return mean (k,) and covariance (k, k) of `rows W + Z`. O(k p^2).

        Args:
            rows: (k, p).
            mean: of Z, (k,).
            variance: of Z, (k,), its components independent.

        Returns:
            Mean and covariance, the latter infinite on the diagonal where an undetermined
            direction of W enters.
        """
        solved = self._solution()
        if solved.is_triangular:
            covariance, mean = np.empty((len(rows), len(rows))), mean.copy()
            predict_rows(self.R, solved.w, rows.copy(), mean, covariance)
            covariance.reshape(-1)[:: len(rows) + 1] += variance
            return mean, covariance
        determined = solved.echelon.products(rows)
        values, spread = determined or (rows @ solved.w, self.spread(rows))  # (k,), (k, r)
        covariance = spread @ spread.T
        diagonal = covariance.reshape(-1)[:: len(rows) + 1]
        diagonal += variance
        if determined is None:
            diagonal[~self.is_determined(rows)] = np.inf
        return mean + values, covariance

    def products(self, rows: np.ndarray) -> np.ndarray:
        """Return the posterior mean of `rows W`, (...,) for rows (..., p). O(p^2) each."""
        solved = self._solution()
        if not solved.is_triangular:
            determined = solved.echelon.products(rows.reshape(-1, rows.shape[-1]))
            if determined is not None:
                return determined[0].reshape(rows.shape[:-1])
        return np.asarray(rows @ solved.w)

    def _solution(self) -> _Solved:
        if self._solved is None:
            self._solved = _Solved(self.R, self.z)
        return self._solved


class _Solved:
    """Solution of one state of the system.

    Attributes:
        is_triangular: whether R itself is invertible, so that it takes the place of `spread`.
    """

    def __init__(self, R: np.ndarray, z: np.ndarray) -> None:
        self.is_triangular = bool(has_safe_diagonal(R, ZERO_COLUMN, RANK_TOLERANCE))
        self._z = z.copy()
        if self.is_triangular:
            solve_upper(R, self._z)
            return
        self.scale = np.sqrt((R * R).sum(axis=0))
        is_zero = self.scale <= ZERO_COLUMN * self.scale.max(initial=0.0)
        self.scale[is_zero] = 1.0
        self._A = np.where(is_zero, 0.0, R / self.scale)

    @property
    def w(self) -> np.ndarray:
        """The shortest solution, (p,), of columns with norm one."""
        return self._z if self.is_triangular else self.decomposition.w

    @property
    def null(self) -> np.ndarray:
        """Basis of the undetermined directions, (p, r), of columns with norm one."""
        return np.zeros((len(self._z), 0)) if self.is_triangular else self.decomposition.null

    @cached_property
    def echelon(self) -> Echelon:
        """Echelon form, which separates determined rows where that is beyond doubt."""
        return Echelon(self._A, self._z, self.scale)

    @cached_property
    def decomposition(self) -> _Decomposition:
        """Pivoted decomposition, which separates them in every case."""
        return _Decomposition(self._A, self._z, self.scale)


class _Decomposition:
    """Shortest solution of `A x = z` for A (p, p) with columns of norm one, or zero.

    Complete orthogonal decomposition `A P = Q [T 0; 0 0] Z`: a QR with column pivoting tells
    the rank, an RZ of what it leaves the null space (Golub and Van Loan, section 5.4.7).
    """

    def __init__(self, A: np.ndarray, z: np.ndarray, scale: np.ndarray) -> None:
        p = len(z)
        factored, order, tau, _, _ = linalg.lapack.dgeqp3(A)
        diagonal = np.abs(factored.diagonal())
        rank = int((RANK_TOLERANCE * max(diagonal[0], 1e-300) < diagonal).sum())
        if not rank:
            self.spread, self.null, self.w = np.zeros((p, 0)), np.eye(p), np.zeros(p)
            return
        folded, folds, _ = linalg.lapack.dtzrzf(np.triu(factored[:rank]))  # [T 0] Z
        roots = np.eye(p)
        roots[:rank, :rank] = linalg.lapack.dtrtri(folded[:, :rank])[0]  # T^-1
        found = np.empty((p, p))
        found[order - 1] = linalg.lapack.dormrz(folded, folds, roots, trans='T', lwork=64 * p)[0]
        self.spread = found[:, :rank] / scale[:, None]
        self.null = found[:, rank:]
        turned = linalg.lapack.dormqr('L', 'T', factored, tau, z[:, None], 64 * p)[0][:rank, 0]
        self.w = self.spread @ turned


def marginal_equations(rows: np.ndarray, kept: Sequence[int]) -> np.ndarray:
    """Return the information of equations of unit noise on some unknowns, for any others, (r, c).

    What is orthogonal to all columns of the others is free of them, which a QR with pivoting finds
    also where they depend on each other (Golub and Van Loan, section 5.4.2). O(m p^2).

    Args:
        rows: (m, p); their values are a column too.
        kept: (c,) columns.
    """
    rows = np.asarray(np.linalg.qr(rows, mode='r'))
    A = np.delete(rows, kept, axis=1)
    if not A.size:
        return rows[:, kept]
    size = np.linalg.norm(A, axis=0)
    factored, _, tau, _, _ = linalg.lapack.dgeqp3(A / np.where(size > 0.0, size, 1.0))
    rank = int((np.abs(factored.diagonal()) > RANK_TOLERANCE).sum())
    turned = linalg.lapack.dormqr('L', 'T', factored, tau, rows[:, kept], 64 * len(kept))[0]
    return np.asarray(np.linalg.qr(turned[rank:], mode='r'))


class Forgetting:
    """Fades information, sample by sample.

    Attributes:
        factor: `sqrt(lambda)`, by which equations of unit noise shrink at each sample.
        turn: samples so far, which says whose turn among the equations of the prior it is.

    Args:
        samples: N, after which information counts 1/e; 0 never forgets.
        prior: of W.
    """

    def __init__(self, samples: float, prior: Information) -> None:
        self.factor = math.exp(-0.5 / samples) if samples > 0.0 else 1.0
        self.turn = 0
        self._prior = prior

    def fade(self, total: Information, parts: Iterable[Information]) -> None:
        """Fade `total`, which holds the prior, and parts, which do not. O(p^2)."""
        if self.factor == 1.0:
            return
        for information in (total, *parts):
            information.fade(self.factor)
        p = len(self._prior.z)
        if p:
            share, i = self.lost(p), self.turn % p
            total.absorb(share * np.append(self._prior.R[i], self._prior.z[i])[None])
        self.turn += 1

    def lost(self, samples: int) -> float:
        """Return the root of the share of information that so many samples fade away."""
        return math.sqrt(1.0 - self.factor ** (2 * samples))
