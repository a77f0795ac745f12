"""How well texts of formulas follow the data of a smooth force, and with which numbers.

A force that is linear between nodes of its variable has filtered columns like any other. Their
triangular factor says what any formula leaves of all rows from its values at the nodes alone.
Coefficients follow by least squares, all other parameters from a grid of starts that
Gauss-Newton steps improve, for all starts at once (variable projection, Golub and Pereyra 1973).
A thousand texts cost seconds so, and only the best are fitted jointly with everything else.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from types import MappingProxyType

import numpy as np

from sgp_ros.diagnosis.unlisted.sentences import COEFFICIENTS
from sgp_ros.physics.formula import Formula, read_formula

_STARTS, _WAVES, _KEPT, _STEPS = 5, 13, 8, 9
"""Starts between the ends of each parameter's range, and of a wave number, of which one that is a
third off says nothing; those that are improved, and their steps."""
_USEFUL, _VAIN = 0.999, 2
"""Part of what is left that a step leaves, and steps in vain that end a search."""
_RIDGE, _MOVE, _LONGEST, _GREATEST, _BLOCK = 1e-10, 1e-4, 0.25, 1e100, 16

Columns = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Curve:
    """Least-squares statistics of a force that is linear between nodes of its variable.

    A force with values f at the nodes leaves `|y - R f|^2` of the rows, plus `rest`, which no
    force of this variable explains.

    Attributes:
        x: (p,) nodes.
        R: (p, p) upper triangular.
        y: (p,).
        rest: sum of squares that is left in any case.
    """

    x: np.ndarray
    R: np.ndarray
    y: np.ndarray
    rest: float

    @classmethod
    def of(cls, x: np.ndarray, L: np.ndarray, force: np.ndarray) -> Curve:
        """Return the curve of a recording.

        Args:
            x: (p,) nodes, rising.
            L: (N, p), see `hats`.
            force: (N,) of the law, with what is left.
        """
        least = _RIDGE * np.sqrt((L * L).sum(axis=0).max()) * np.eye(len(x))
        both = np.column_stack([np.concatenate([L, least]), np.append(force, np.zeros(len(x)))])
        R = np.asarray(np.linalg.qr(both, mode='r'))
        return cls(x, R[:-1, :-1], R[:-1, -1], float(R[-1, -1] ** 2))

    @property
    def size(self) -> float:
        """Sum of squares that forces of the variable explain."""
        return float(self.y @ self.y)


def hats(x: np.ndarray, rows: Callable[[np.ndarray], np.ndarray], at: np.ndarray) -> np.ndarray:
    """Return the rows of forces that are 1 at one node, 0 at others, linear between, (N, p).

    Args:
        x: (p,) nodes, rising.
        rows: from forces (n, m) in time to the rows (N, m) of the regression.
        at: (n,) the variable in time.
    """
    columns = []
    for first in range(0, len(x), _BLOCK):
        block = [np.interp(at, x, np.eye(1, len(x), i)[0])
                 for i in range(first, min(first + _BLOCK, len(x)))]  # fmt: skip
        columns.append(rows(np.column_stack(block)))
    return np.concatenate(columns, axis=1)


def left_out(L: np.ndarray, r: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Return what a force between nodes leaves of parts that were left out of its fit, (N,).

    A node counts as if one more row had seen no force there: where nobody was, nothing is said.

    Args:
        L: (N, p), see `hats`.
        r: (N,) residual.
        part: (N,) that each row belongs to.
    """
    size = max(float((L.sum(axis=1) ** 2).mean()), 1e-300)
    left, least = r.copy(), size * np.eye(L.shape[1])
    for p in np.unique(part):
        here = part == p
        A, b = L[~here], r[~here]
        left[here] -= L[here] @ np.linalg.solve(A.T @ A + least, A.T @ b)
    return left


@dataclass(frozen=True, eq=False)
class Followed:
    """A text as it follows a curve best.

    Attributes:
        numbers: of its parameters but coefficients.
        left: sum of squares that it leaves beyond what any force of the variable does.
    """

    numbers: dict[str, float]
    left: float


@cache
def in_position(text: str) -> Formula:
    """Return a text in X as a formula of a position; the same hundreds are tried at each joint."""
    return read_formula(text.replace('X', 'q[X]'), is_law=True)


def follow(
    formula: Formula, curve: Curve, ranges: Mapping[str, tuple[float, float]],
    near: Mapping[str, float] = MappingProxyType({}),
) -> Followed | None:  # fmt: skip
    """Return how a formula in `q[X]` follows a curve best; None if nowhere finite.

    Args:
        formula: text with the variable as `q[X]`.
        curve: to follow.
        ranges: ends of its parameters but coefficients, equal where one is known.
        near: numbers of some of them, where the search starts.
    """
    free = [n for n in sorted(formula.parameters) if n not in COEFFICIENTS]
    axes = _Axes(*np.array([ranges[n] for n in free]).reshape(-1, 2).T)
    columns = _columns(formula, curve.x, free)

    def left(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return _left(columns(axes.at(u)), curve)

    known = axes.high <= axes.low
    u = _starts(free, axes, near)
    r, cost = left(u)
    kept = np.argsort(cost)[: min(_KEPT, int(np.isfinite(cost).sum()))]
    if not len(kept):
        return None
    u, r, cost = u[kept], r[kept], cost[kept]
    if len(free) > known.sum():
        u, cost = _improved(u, r, cost, left, ~known)
    best = int(np.argmin(cost))
    return Followed(dict(zip(free, axes.at(u)[best].tolist(), strict=True)), float(cost[best]))


@dataclass(frozen=True, eq=False)
class _Axes:
    """Ends (k,) of parameters; those that are positive are searched by their logarithm."""

    low: np.ndarray
    high: np.ndarray

    def at(self, u: np.ndarray) -> np.ndarray:
        """Return the parameters at parts u (..., k) of the ways between their ends."""
        is_ratio, safe, ratio = self._ratios
        even = self.low + u * (self.high - self.low)
        return np.where(is_ratio, safe * ratio**u, even)

    def parts(self, x: np.ndarray) -> np.ndarray:
        """Return where parameters (..., k) lie between their ends, 0 to 1; at them beyond."""
        is_ratio, safe, ratio = self._ratios
        x = np.clip(x, self.low, self.high)
        even = (x - self.low) / np.maximum(self.high - self.low, 1e-300)
        log = np.log(np.where(is_ratio, x, 1.0) / safe) / np.maximum(np.log(ratio), 1e-300)
        return np.where(is_ratio, log, even)

    @cached_property
    def _ratios(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        is_ratio = self.low > 0.0
        safe = np.where(is_ratio, self.low, 1.0)
        return is_ratio, safe, np.where(is_ratio, self.high, 1.0) / safe


def _starts(free: Sequence[str], axes: _Axes, near: Mapping[str, float]) -> np.ndarray:
    """Return the starts of a search, (s, k) parts of the ways between the ends.

    A place that belongs to a wave starts within one of its turns around the middle.
    """
    known = axes.high <= axes.low
    waves = {f'x{n[1:]}': i for i, n in enumerate(free) if n[0] == 'n'}
    counts = [
        1 if is_known or n in near else _WAVES if n[0] == 'n' else _STARTS
        for n, is_known in zip(free, known, strict=True)
    ]
    grid = list(itertools.product(*((np.arange(m) + 0.5) / m for m in counts)))
    u = np.array(grid, dtype=np.float64).reshape(len(grid), len(free))
    at = axes.at(u)
    for i, name in enumerate(free):
        if name in waves:
            middle, turn = 0.5 * (axes.low[i] + axes.high[i]), 2.0 * np.pi / at[:, waves[name]]
            at[:, i] = middle + (u[:, i] - 0.5) * turn
        at[:, i] = near.get(name, at[:, i])
    return axes.parts(at)


def _columns(formula: Formula, x: np.ndarray, free: Sequence[str]) -> Callable[..., np.ndarray]:
    """Return what gives the columns (s, p, m) for parameters (s, len(free))."""
    linear = [n for n in COEFFICIENTS if n in formula.parameters]
    force: Callable[[Mapping[str, object]], object] = formula.compiled(
        lambda name: lambda at: at[name], lambda _kind, _joint: lambda _at: x[None, :]
    )

    def columns(numbers: np.ndarray) -> np.ndarray:
        at = {name: numbers[:, i, None] for i, name in enumerate(free)}
        found = np.empty((len(numbers), len(x), len(linear)))
        with np.errstate(all='ignore'):
            for i, chosen in enumerate(linear):
                chosen_alone = {name: float(name == chosen) for name in linear}
                found[:, :, i] = np.asarray(force({**at, **chosen_alone}))
        return found

    return columns


def _left(values: np.ndarray, curve: Curve) -> tuple[np.ndarray, np.ndarray]:
    """Return residuals (s, p) and their sums of squares (s,), infinite if not finite."""
    bad = ~np.isfinite(values).all(axis=(1, 2))
    size = np.abs(values).max(axis=1, initial=0.0)
    bad |= (size > _GREATEST).any(axis=1)
    values = np.where(bad[:, None, None], 0.0, values)
    values /= np.where(bad[:, None] | (size <= 0.0), 1.0, size)[:, None, :]
    X = curve.R @ values
    norm = np.sqrt((X * X).sum(axis=1))
    X /= np.where(norm > 0.0, norm, 1.0)[:, None, :]
    G = X.transpose(0, 2, 1) @ X + _RIDGE * np.eye(X.shape[2])
    g = (X.transpose(0, 2, 1) @ curve.y)[:, :, None]
    c = g / G if G.shape[1] == 1 else np.linalg.solve(G, g)
    r = curve.y - (X @ c)[:, :, 0]
    return r, np.where(bad, np.inf, (r * r).sum(axis=1))


def _improved(
    u: np.ndarray, r: np.ndarray, cost: np.ndarray,
    left: Callable[..., tuple[np.ndarray, np.ndarray]], free: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Return places u (s, m) in the unit box after Levenberg-Marquardt steps, each its own.

    With the sums of squares there, (s,). They end where two steps improve none by a thousandth.
    Residuals r (s, p) and their sums of squares are those at the start.
    """
    damping, index, vain = np.full(len(u), 1e-2), np.flatnonzero(free), 0
    s, m = len(u), len(index)
    for _ in range(_STEPS):
        h = np.where(u[:, index] + _MOVE <= 1.0, _MOVE, -_MOVE)
        moved = np.repeat(u[None], m, axis=0)
        moved[np.arange(m), :, index] += h.T
        beside = left(moved.reshape(m * s, -1))[0].reshape(m, s, -1)
        J = ((beside - r) / h.T[:, :, None]).transpose(1, 2, 0)
        J = np.nan_to_num(J, posinf=0.0, neginf=0.0)
        G = np.einsum('spi,spj->sij', J, J)
        scale = np.einsum('sii->si', G) + 1e-12 * (cost[:, None] + 1e-300)
        G += damping[:, None, None] * scale[:, :, None] * np.eye(len(index))
        step = np.linalg.solve(G, np.einsum('spi,sp->si', J, r)[:, :, None])[:, :, 0]
        trial = u.copy()
        trial[:, index] = np.clip(u[:, index] - np.clip(step, -_LONGEST, _LONGEST), 0.0, 1.0)
        r_trial, cost_trial = left(trial)
        better = cost_trial < cost
        vain = 0 if (cost_trial < _USEFUL * cost).any() else vain + 1
        u = np.where(better[:, None], trial, u)
        r = np.where(better[:, None], r_trial, r)
        cost = np.where(better, cost_trial, cost)
        damping = np.where(better, damping / 5.0, damping * 5.0)
        if vain == _VAIN:
            break
    return u, cost
