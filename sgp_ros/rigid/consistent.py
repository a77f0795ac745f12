"""The physically consistent coefficients nearest to an estimate, by semidefinite programming.

Least squares may give a link a negative mass or a moment of inertia that no body has. Among the
coefficients that belong to real bodies, this finds those that the data contradict least:

    minimise  |R (w - mean)|^2 + pull |N^T (y(w) - y(reference))|^2
    subject to  J(w of each link) >= margin J0,  friction >= 0,

with `R^T R` the information on w, J the pseudo-inertia of a link (Wensing, Kim, Slotine 2018),
and N the directions that the data leave undetermined. `y` are the coefficients in natural size:
`y = L^-1 J L^-T` for a link whose reference body has `J0 = L L^T`. In them the distance of two
bodies is the same in any frame and unit (Lee, Wensing, Park 2020, Geometric robot dynamic
identification: a convex programming approach: the constant pullback of the affine-invariant
metric).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import clarabel
import numpy as np
from scipy import linalg, sparse

from sgp_ros.errors import NumericalError
from sgp_ros.rigid.base_parameters import RegressorFactor, base_parameters
from sgp_ros.rigid.pseudo_inertia import PSEUDO_BASIS, is_consistent, pseudo_inertia

MARGIN = 1e-6
"""Least eigenvalue of J beside that of the reference body: far above the solver's 1e-9, far below
what tells one real body from another."""
PULL = 1e-6
"""Weight of the reference in undetermined directions: a body twice as heavy as its reference costs
as much as an error of a thousandth standard deviation, so data come first wherever they speak."""
GAP_ABSOLUTE, GAP_RELATIVE = 1e-6, 1e-7
"""How far above the optimum the objective may stay. The objective is round in units of standard
deviations, so a gap g leaves the result within `sqrt(2 g)` of them from the optimum."""
_REGULARISATION = 1e-16
"""Addition to the diagonal of the solver's equations, relative to the largest entry. With its own
5e-32, 12 of 810 random problems, some with directions known a million times better than others,
ended short of the gap; with this, none."""
_LEAST_MASS, _LEAST_RADIUS = 1e-3, 1e-2
"""Size of the ball that stands in for a missing reference, where the estimate is smaller, as mass
and radius of gyration [kg, m]."""
_ROUNDING = 1e-12
"""Rounding of a coefficient that no datum shows, relative to the largest one."""
_UPPER = np.array([(i, j) for j in range(4) for i in range(j + 1)]).T
"""Entries of a symmetric 4 x 4 matrix, upper triangle column by column, as the solver wants it."""
_ROOT2 = np.where(_UPPER[0] == _UPPER[1], 1.0, np.sqrt(2.0))


@dataclass(frozen=True, slots=True, eq=False)
class ConsistentEstimate:
    """Coefficients of real bodies.

    Attributes:
        coefficients: (p,) w.
        distance: `|R (w - mean)|^2` from the estimate, in squared standard deviations; about the
            number of active constraints where the truth is consistent and the model right.
        was_consistent: whether the estimate already met the constraints, up to undetermined
            directions; then `distance` is zero.
    """

    coefficients: np.ndarray
    distance: float
    was_consistent: bool


def project(
    mean: np.ndarray,
    covariance: np.ndarray,
    blocks: Sequence[Sequence[int]],
    *,
    undetermined: np.ndarray | None = None,
    nonnegative: Sequence[int] = (),
    reference: np.ndarray | None = None,
    pull: float = PULL,
) -> ConsistentEstimate:
    """Return the consistent coefficients nearest to an estimate with a covariance.

    Args:
        mean: (p,) estimate of w.
        covariance: (p, p), positive definite but for the undetermined directions.
        blocks: the ten columns of each link, in the order of `pseudo_inertia`.
        undetermined: (p, q) changes of w that the data do not show, such as
            `BaseParameters.null`; what the covariance says of them is ignored.
        nonnegative: columns of friction and armature, which dissipate or store energy.
        reference: (p,) nominal w that fills in undetermined directions; None keeps the estimate.
        pull: weight of the reference there.

    Raises:
        NumericalError: the solver did not converge, or the covariance is singular in other
            directions too.
        ValueError: shapes that do not belong together.
    """
    N = np.zeros((len(mean), 0)) if undetermined is None else undetermined
    return project_information(
        mean,
        _information_root(covariance, N),
        blocks,
        nonnegative=nonnegative,
        reference=reference,
        pull=pull,
    )


def _information_root(covariance: np.ndarray, N: np.ndarray) -> np.ndarray:
    """Return R with `R^T R` the inverse of the covariance across N, and `R N = 0`."""
    longest = np.diag(covariance).max(initial=0.0)
    N = N * np.sqrt(longest / np.maximum((N**2).sum(axis=0), 1e-300))
    whole = covariance + N @ N.T
    size = np.sqrt(np.maximum(np.diag(whole), 0.0))
    size[size == 0.0] = 1.0
    try:
        lower = linalg.cholesky(whole / np.outer(size, size), lower=True)
    except linalg.LinAlgError as error:
        raise NumericalError(
            'consistent parameters: the covariance is singular',
            'a positive definite covariance in all determined directions',
            'name the undetermined directions, or pass the information',
        ) from error
    R = linalg.solve_triangular(lower, np.diag(1.0 / size), lower=True)
    Q = np.linalg.qr(R @ N)[0]
    return R - Q @ (Q.T @ R)


def project_information(
    mean: np.ndarray,
    R: np.ndarray,
    blocks: Sequence[Sequence[int]],
    *,
    nonnegative: Sequence[int] = (),
    reference: np.ndarray | None = None,
    pull: float = PULL,
) -> ConsistentEstimate:
    """Return the consistent coefficients nearest to an estimate with square-root information.

    As `project`, with R (r, p) such that `R^T R` is the inverse covariance, of any rank: the
    triangle of a weighted regressor keeps more digits than a covariance does. One semidefinite
    program with a 4 x 4 cone for each link, O(p^3) per iteration.
    """
    p = len(mean)
    if R.shape[1:] != (p,) or any(len(block) != 10 for block in blocks):
        raise ValueError(f'mean {mean.shape}, information {R.shape}, blocks {blocks}')
    nominal = mean if reference is None else reference
    Y = _natural_size(mean, nominal, blocks)  # y = Y w
    R_y = linalg.solve(Y.T, R.T).T
    base = base_parameters(RegressorFactor.nothing(p).with_rows(R_y).R, [''] * p)
    N = np.linalg.qr(base.null)[0]  # (p, p - r)
    y = Y @ mean
    y = y + N @ (N.T @ (Y @ nominal - y))
    if _is_feasible(y, blocks, nonnegative):
        return ConsistentEstimate(linalg.solve(Y, y), 0.0, was_consistent=True)
    C = RegressorFactor.nothing(p).with_rows(np.vstack([R_y, np.sqrt(pull) * N.T])).R
    y = _feasible(y + _solve(C, y, blocks, nonnegative), blocks, nonnegative)
    w = linalg.solve(Y, y)
    return ConsistentEstimate(w, float(np.sum((R @ (w - mean)) ** 2)), was_consistent=False)


def _natural_size(
    mean: np.ndarray, nominal: np.ndarray, blocks: Sequence[Sequence[int]]
) -> np.ndarray:
    """Return Y (p, p): a link's part of `Y w` is `L^-1 J L^-T` as the solver stacks it."""
    size = np.where(nominal != 0.0, np.abs(nominal), np.abs(mean))
    is_zero = size <= _ROUNDING * size.max(initial=0.0)
    Y = np.diag(1.0 / np.where(is_zero, 1.0, size))
    for block in blocks:
        columns = np.asarray(block)
        J0 = pseudo_inertia(nominal[columns])
        if not is_consistent(nominal[columns]):
            J0 = _stand_in(pseudo_inertia(mean[columns]))
        L = linalg.cholesky(J0, lower=True)
        half = np.linalg.solve(L, PSEUDO_BASIS.reshape(10, 4, 4))
        whole = np.linalg.solve(L, half.transpose(0, 2, 1))
        Y[np.ix_(columns, columns)] = (whole[:, _UPPER[0], _UPPER[1]] * _ROOT2).T
    return Y


def _stand_in(J: np.ndarray) -> np.ndarray:
    """Return the pseudo-inertia of a ball of about the size of an inconsistent body."""
    mass = max(abs(J[3, 3]), _LEAST_MASS)
    second_moment = max(float(np.abs(np.diag(J)[:3]).max()), mass * _LEAST_RADIUS**2)
    return np.diag([second_moment, second_moment, second_moment, mass])


def _matrix(y: np.ndarray) -> np.ndarray:
    """Return the symmetric matrix that the solver stacks as y (10,)."""
    matrix = np.zeros((4, 4))
    matrix[_UPPER[0], _UPPER[1]] = matrix[_UPPER[1], _UPPER[0]] = y / _ROOT2
    return matrix


def _is_feasible(
    y: np.ndarray, blocks: Sequence[Sequence[int]], nonnegative: Sequence[int]
) -> bool:
    return bool(np.all(y[list(nonnegative)] >= 0.0)) and all(
        np.linalg.eigvalsh(_matrix(y[list(block)]))[0] >= MARGIN for block in blocks
    )


def _solve(
    C: np.ndarray, y: np.ndarray, blocks: Sequence[Sequence[int]], nonnegative: Sequence[int]
) -> np.ndarray:
    """Return the least `|C dy|` for which `y + dy` meets the constraints, (p,).

    The solver sees `x = C dy`, in which the objective is round. It stays a `MARGIN` inside the
    bounds, so that its tolerance does not lead across them.
    """
    rows = np.array([*nonnegative, *(i for block in blocks for i in block)], dtype=int)
    floor = np.tile(2.0 * MARGIN * (_UPPER[0] == _UPPER[1]), len(blocks))
    bound = y[rows] - np.concatenate([np.full(len(nonnegative), MARGIN), floor])
    inverse = linalg.solve_triangular(C, np.eye(len(y)))  # dy = inverse x
    cones = [clarabel.PSDTriangleConeT(4)] * len(blocks)
    if len(nonnegative):
        cones = [clarabel.NonnegativeConeT(len(nonnegative)), *cones]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.equilibrate_enable = False  # objective and bodies are in natural size already
    settings.static_regularization_proportional = _REGULARISATION
    settings.tol_gap_abs, settings.tol_gap_rel = GAP_ABSOLUTE, GAP_RELATIVE
    solver = clarabel.DefaultSolver(
        sparse.csc_matrix(np.eye(len(y))),
        np.zeros(len(y)),
        sparse.csc_matrix(-inverse[rows]),
        bound,
        cones,
        settings,
    )
    solution = solver.solve()
    # Almost solved is within the solver's wider tolerances, which cost digits of the distance; the
    # constraints are met all the same, by `_feasible`.
    almost = clarabel.SolverStatus.AlmostSolved
    if solution.status not in {clarabel.SolverStatus.Solved, almost}:
        raise NumericalError(
            f'consistent parameters: the conic solver ended with {solution.status}'
            f' after {solution.iterations} iterations',
            'Solved',
            'check the size of the reference and of the estimate, or record more motion',
        )
    return inverse @ np.array(solution.x)


def _feasible(
    y: np.ndarray, blocks: Sequence[Sequence[int]], nonnegative: Sequence[int]
) -> np.ndarray:
    """Return y with what the solver's tolerance left below the bounds lifted onto them."""
    y = y.copy()
    columns = list(nonnegative)
    y[columns] = np.maximum(y[columns], 0.0)
    for block in blocks:
        values, vectors = np.linalg.eigh(_matrix(y[list(block)]))
        lifted = (vectors * np.maximum(values, MARGIN)) @ vectors.T
        y[list(block)] = lifted[_UPPER[0], _UPPER[1]] * _ROOT2
    return y
