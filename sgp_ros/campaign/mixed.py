"""A linear mixed model of estimates that carry their own intervals.

    y_i = x_i beta + sum_g u_g(i) + e_i,    u_g ~ N(0, theta_g),    e_i ~ N(0, s_i^2 + theta_0)

An estimate with a wide interval counts less (s_i is its standard deviation), recordings scatter
beyond their intervals (theta_0), and what is alike within a session or within a robot is one draw,
not one a recording (random intercepts theta_g). The variances theta maximise the restricted
likelihood (Patterson and Thompson 1971), beta is the generalised least-squares estimate under
them. The scale of its covariance is estimated from the residuals and its intervals are those of
Student's t (Knapp and Hartung 2003, for regressions of estimates).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy import linalg, optimize

_GRID = (-7.0, -3.5, -1.5, 0.0)
"""Log variances relative to that of y among which the search begins: the likelihood may have
several maxima, and where a variance is nearly nothing it is flat and no slope leads away."""
_PRECISION = {'xatol': 1e-4, 'fatol': 1e-7}
_BOUNDS = (-16.0, 3.0)
_NEW = 1e-9
"""Share of a column that those before it must leave."""
_LEAST = 1e-12
"""Least relative scale of the residuals: copies of one recording leave no residual."""


@dataclass(frozen=True, slots=True, eq=False)
class Spread:
    """The covariance V = diag(d) + Z diag(theta) Z^T of n estimates, never formed.

    Z (n, q) has a 1 for each group that an estimate is in.

    Attributes:
        d: (n,) s_i^2 + theta_0.
        groups: (n,) column of Z for each kind of group.
        root: (q,) square root of the variance of each column of Z.
        factor: (q, q) lower triangle of I + root Z^T D^-1 Z root.
    """

    d: np.ndarray
    groups: Sequence[np.ndarray]
    root: np.ndarray
    factor: np.ndarray

    @classmethod
    def of(cls, d: np.ndarray, groups: Sequence[np.ndarray], theta: np.ndarray) -> Spread:
        """Factor the covariance of groups with variances theta (q,); O(n + q^3)."""
        q, root = len(theta), np.sqrt(theta)
        inner = np.zeros(q * q)
        for a in groups:
            for b in groups:
                inner += np.bincount(a * q + b, 1.0 / d, q * q)
        scaled = inner.reshape(q, q) * np.outer(root, root)
        return cls(d, groups, root, np.linalg.cholesky(scaled + np.eye(q)))

    def solve(self, A: np.ndarray) -> np.ndarray:
        """Return V^-1 A, (n, m), by the identity of Woodbury; O(n m + q^2 m)."""
        scaled, q = A / self.d[:, None], len(self.root)
        inner = np.zeros((q, A.shape[1]))
        for codes in self.groups:
            inner += np.array([np.bincount(codes, column, q) for column in scaled.T]).T
        if not q:
            return scaled
        root = self.root[:, None]
        inner = root * linalg.cho_solve((self.factor, True), root * inner, check_finite=False)
        return scaled - sum(inner[codes] for codes in self.groups) / self.d[:, None]

    @property
    def log_determinant(self) -> float:
        """Return log det V."""
        return float(np.log(self.d).sum() + 2.0 * np.log(np.diag(self.factor)).sum())


@dataclass(frozen=True, slots=True, eq=False)
class MixedFit:
    """A fitted model.

    Attributes:
        X: (n, p) columns.
        beta: (p,) coefficients.
        covariance: (p, p) of them, scaled by the residuals.
        dof: degrees of freedom of their t distribution.
        residual: (n,) y - X beta.
        spread: V.
        theta: variance of e beyond the intervals, then of each group.
    """

    X: np.ndarray
    beta: np.ndarray
    covariance: np.ndarray
    dof: int
    residual: np.ndarray
    spread: Spread
    theta: np.ndarray

    @property
    def t(self) -> np.ndarray:
        """Return (p,) each coefficient in its standard deviations."""
        return self.beta / np.sqrt(np.diag(self.covariance))

    def gains(self, S: np.ndarray) -> np.ndarray:
        """Return (m,) twice the log likelihood that each of the columns S (n, m) alone would add.

        The variances stay as they are. A column that X has already adds nothing.
        """
        VX, VS = self.spread.solve(self.X), self.spread.solve(S)
        cross = self.X.T @ VS  # (p, m)
        own = np.einsum('im,im->m', S, VS)
        left = own - np.einsum('pm,pm->m', cross, np.linalg.solve(self.X.T @ VX, cross))
        score = VS.T @ self.residual
        return np.divide(score**2, left, out=np.zeros_like(left), where=left > _NEW * own)


def fit_mixed(
    y: np.ndarray, std: np.ndarray, X: np.ndarray, groups: Sequence[np.ndarray], levels: int
) -> MixedFit:
    """Fit the model.

    Args:
        y: (n,) estimates.
        std: (n,) their standard deviations.
        X: (n, p) columns of full rank.
        groups: (n,) number of the group that each is in, for each kind of group.
        levels: numbers that the coefficients are known from. What differs between sessions is
            known from as many as there are sessions, however many recordings each has.
    """
    counts = [int(codes.max()) + 1 for codes in groups]
    offsets = np.cumsum([0, *counts])
    places = [codes + start for codes, start in zip(groups, offsets[:-1], strict=True)]
    residual = y - X @ np.linalg.lstsq(X, y, rcond=None)[0]
    scale = max(float(residual.var()), float(np.median(std**2)), 1e-300)

    def spread_of(logs: np.ndarray) -> Spread:
        theta = scale * np.exp(logs)
        return Spread.of(std**2 + theta[0], places, np.repeat(theta[1:], counts))

    both = np.column_stack([X, y])

    def loss(logs: Sequence[float]) -> float:
        spread = spread_of(np.asarray(logs))
        inner = both.T @ spread.solve(both)  # (p + 1, p + 1)
        known = inner[:-1, :-1]
        squares = inner[-1, -1] - inner[-1, :-1] @ np.linalg.solve(known, inner[:-1, -1])
        return float(0.5 * (spread.log_determinant + np.linalg.slogdet(known)[1] + squares))

    start = min(product(_GRID, repeat=1 + len(groups)), key=loss)
    found = optimize.minimize(loss, start, method='Nelder-Mead', options=_PRECISION,
                              bounds=[_BOUNDS] * len(start))  # fmt: skip
    theta = scale * np.exp(found.x)
    return fit_given(y, X, spread_of(found.x), theta, levels)


def fit_given(
    y: np.ndarray, X: np.ndarray, spread: Spread, theta: np.ndarray, levels: int
) -> MixedFit:
    """Return the generalised least-squares fit under known variances.

    Args:
        y: (n,) estimates.
        X: (n, p) columns.
        spread: V.
        theta: that V was made from.
        levels: as of `fit_mixed`.
    """
    VX = spread.solve(X)
    inverse = np.linalg.inv(X.T @ VX)
    beta = inverse @ (VX.T @ y)
    residual = y - X @ beta
    n, p = X.shape
    factor = float(residual @ spread.solve(residual[:, None])[:, 0]) / max(n - p, 1)
    factor = max(factor, _LEAST)
    return MixedFit(X, beta, factor * inverse, max(levels - p, 1), residual, spread, theta)
