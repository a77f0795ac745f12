"""Search of the shapes of candidates in small products.

Linear coefficients and inertial parameters are solved for at every shape (variable projection,
Golub and Pereyra 1973). Residuals, and their slopes by the shapes, are sums of target and columns;
so their squares follow from the products of these, and the N rows are gone through once for each
column.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sgp_ros.diagnosis.explain.frame import EXPLAINED, Frame
from sgp_ros.diagnosis.explain.regression import (
    Columns,
    Seen,
    shape_bounds,
    shape_scales,
    with_shapes,
)
from sgp_ros.physics.effect_at import EffectAt, in_series

UNSEEN = 1e-12
"""A column that is this much smaller than the largest acts on nothing; its coefficient is zero."""
_ROUNDING = 1e-14
"""Part of the target's square below which no residual is known."""
_REMEMBERED = 100
"""Columns that a search holds before it forgets them."""
_STEP = 2e-4
"""Step of differences by a shape, in its scales."""
_LARGEST = 0.2
"""Largest change of a shape in one step of the search, in its scales."""


@dataclass(frozen=True, eq=False)
class _Part:
    """Columns of one candidate with their products with the basis of the bodies.

    Attributes:
        seen: filtered columns.
        u: what the bodies explain of them, (p, m).
        is_given: whether they have no coefficient.
    """

    seen: Seen
    u: np.ndarray
    is_given: bool


class Bench:
    """Residuals of candidates beside one frame, as sums of target and columns.

    Args:
        frame: whose bodies are projected out.
        columns: of the recording.
        w: (p,) change of the bodies that columns start from; None for none.
    """

    def __init__(self, frame: Frame, columns: Columns, w: np.ndarray | None) -> None:
        self.frame, self._columns, self._w = frame, columns, w
        self._target = frame.equations.d / frame.sigma
        self._u = frame.explained(self._target[:, :, None])
        self._wanted = frame.wanted
        self._u[:, 0] += frame.S[-1].T @ self._wanted
        self._known: dict[object, _Part] = {}

    def cost(self, candidates: Sequence[EffectAt]) -> float:
        """Return the squares of the scaled residual; at least what rounding makes of them."""
        parts = self._parts(candidates)
        G = self._products(parts)
        weights = _weights(G, *_split(parts, _places(parts)))
        return max(float(weights @ G @ weights), _ROUNDING * float(G[0, 0]))

    def coefficients(self, candidates: Sequence[EffectAt]) -> np.ndarray:
        """Return the coefficients of all candidates that have some, one after the other."""
        parts = self._parts(candidates)
        free, given = _split(parts, _places(parts))
        return -_weights(self._products(parts), free, given)[free]

    def slopes(
        self, candidates: Sequence[EffectAt], moved: Sequence[tuple[Sequence[EffectAt], float]]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return products of the slopes of the residual with themselves (s, s), with it (s,).

        Args:
            candidates: as they are.
            moved: for each shape the candidates with the shape moved, and how far.
        """
        parts = self._parts([s for some in (candidates, *(m for m, _ in moved)) for s in some])
        unique = list(dict.fromkeys(parts))
        G, places = self._products(unique), dict(zip(unique, _places(unique), strict=True))
        all_ = [parts[i : i + len(candidates)] for i in range(0, len(parts), len(candidates))]
        r, *found = (_weights(G, *_split(some, [places[p] for p in some])) for some in all_)
        J = np.empty((len(G), len(moved)))
        for i, (x, (_, h)) in enumerate(zip(found, moved, strict=True)):
            J[:, i] = (x - r) / h
        return J.T @ G @ J, J.T @ G @ r

    def _parts(self, candidates: Sequence[EffectAt]) -> list[_Part]:
        """Return the columns of candidates; those asked for before are remembered."""
        if len(self._known) > _REMEMBERED:
            self._known.clear()
        return [self._part(s) for s in candidates]

    def _part(self, s: EffectAt) -> _Part:
        key = s.form
        if key not in self._known:
            frame = self.frame
            motion = self._columns.corrected(self._w if s.effect.uses_bodies else None)
            seen = self._columns.seen(s, frame.equations, motion)
            u = np.zeros((frame.R.shape[1], seen.x.shape[-1]))
            if len(u):
                for j, explained in seen.explained.items():
                    u += frame.S[j].T @ explained / frame.sigma[j]
            self._known[key] = _Part(seen, u, s.effect.is_given)
        return self._known[key]

    def _products(self, parts: Sequence[_Part]) -> np.ndarray:
        """Return the products of the target and all columns with one another, (1 + m, 1 + m)."""
        frame = self.frame
        u = np.concatenate([self._u, *(part.u for part in parts)], axis=1)
        G = np.zeros((u.shape[1], u.shape[1]))
        places = _places(parts)
        for j in range(self._target.shape[1]):
            here = [(part.seen.rows[j], at) for part, at in zip(parts, places, strict=True)
                    if j in part.seen.rows]  # fmt: skip
            at = np.concatenate([[0], *(at for _, at in here)])
            scaled = (rows / frame.sigma[j] for rows, _ in here)
            x = np.concatenate([self._target[:, j : j + 1], *scaled], axis=1)
            G[np.ix_(at, at)] += x.T @ x
        G[0, 0] += float(self._wanted @ self._wanted)
        left = G - u.T @ u
        explained = np.flatnonzero(np.diag(left) <= EXPLAINED * np.diag(G))
        left[explained, explained] = 0.0
        return left


def _weights(G: np.ndarray, free: np.ndarray, given: np.ndarray) -> np.ndarray:
    """Return the residual as weights of target and columns, (1 + m,), from their products.

    Args:
        G: products, (1 + m, 1 + m).
        free: indices of columns with a coefficient.
        given: those of columns without.
    """
    weights = np.zeros(len(G))
    weights[0] = 1.0
    weights[given] = -1.0
    if len(free):
        size = np.sqrt(np.maximum(G[free, free], 0.0))
        size[size <= UNSEEN * size.max()] = np.inf
        b = (G[free] @ weights) / size
        values, V = np.linalg.eigh(G[np.ix_(free, free)] / np.outer(size, size))
        used = values > EXPLAINED * max(values[-1], 1e-300)
        weights[free] = -(V[:, used] @ (V[:, used].T @ b / values[used])) / size
    return weights


def _places(parts: Sequence[_Part]) -> list[np.ndarray]:
    """Return the indices of the columns of each part, after the target."""
    ends = np.cumsum([1, *(part.u.shape[1] for part in parts)])
    return [np.arange(a, b) for a, b in pairwise(ends)]


def _split(parts: Sequence[_Part], places: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return the indices of all free columns, and of all given ones."""
    free = [at for part, at in zip(parts, places, strict=True) if not part.is_given]
    given = [at for part, at in zip(parts, places, strict=True) if part.is_given]
    none = [np.zeros(0, dtype=int)]
    return np.concatenate(free or none), np.concatenate(given or none)


def searched(
    bench: Bench, candidates: tuple[EffectAt, ...], steps: int, still: int
) -> tuple[EffectAt, ...]:
    """Return candidates with better shapes, by Levenberg-Marquardt in bounds.

    A law that has a second start beside its shape, see `SmallEffect`, is searched from both.

    Args:
        bench: of the recording.
        candidates: with the shapes to start from.
        steps: of the search.
        still: so many of the first candidates keep their shapes.
    """
    if not sum(len(s.shape) for s in candidates[still:]):
        return candidates
    starts = [candidates]
    for i, s in enumerate(candidates[still:], start=still):
        turned = None if s.effect.small is None else s.effect.small.turned(s)
        if turned is not None:
            starts.append((*candidates[:i], s.with_shape(turned), *candidates[i + 1 :]))
    found = [_descended(bench, start, steps, still) for start in starts]
    return min(found, key=lambda x: x[0])[1]


def _descended(
    bench: Bench, candidates: tuple[EffectAt, ...], steps: int, still: int
) -> tuple[float, tuple[EffectAt, ...]]:
    """Return the cost and the candidates to which a search leads from their shapes."""
    fixed, free = candidates[:still], candidates[still:]
    known = bench.frame.equations.motion.known

    def at(x: np.ndarray) -> tuple[EffectAt, ...]:
        return in_series((*fixed, *with_shapes(free, x)), known)

    equations = bench.frame.equations
    low, high = shape_bounds(equations, free)
    x = np.clip(np.concatenate([s.shape for s in free]), low, high)
    span = np.maximum(shape_scales(equations, free), 1e-12)
    candidates = at(x)
    cost, damping = bench.cost(candidates), 1e-2
    for _ in range(steps):
        moved = []
        for i in range(len(x)):
            h = _STEP if x[i] + _STEP * span[i] <= high[i] else -_STEP
            moved.append((at(x + h * span * (np.arange(len(x)) == i)), h))
        H, g = bench.slopes(candidates, moved)
        improved = False
        for _ in range(6):
            step = -np.linalg.solve(
                H + damping * (np.diag(np.diag(H)) + 1e-12 * np.eye(len(x))), g
            )
            trial = np.clip(x + np.clip(step, -_LARGEST, _LARGEST) * span, low, high)
            tried = at(trial)
            after = bench.cost(tried)
            if after < cost:
                gain = (cost - after) / cost
                x, candidates, cost, improved = trial, tried, after, True
                damping = max(damping / 5.0, 1e-8)
                break
            damping *= 6.0
        if not improved or gain < 1e-4:
            break
    return cost, candidates
