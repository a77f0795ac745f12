"""Standard deviations of the parameters of a model.

The covariance is that of least squares, `(J^T J)^-1` with J the derivatives of the scaled
residual by coefficients and shapes after the inertial parameters are projected out, widened by
the correlation of the residual in time, joint by joint where something is left unknown: as
`A^-1 J^T F J A^-1` with `A = J^T J` and F by how much (White 1980). Where bodies are those of the
robot file, errors that such files have are added, as far as the rows do not exclude them. Reported
values follow by the delta method.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from sgp_ros.batch.least_squares import correlation_factor
from sgp_ros.diagnosis.criteria import STATED_ERROR
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.explain.frame import Frame
from sgp_ros.diagnosis.explain.regression import Columns, shape_bounds, shape_scales, with_shapes
from sgp_ros.diagnosis.explain.shape_search import UNSEEN
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.motor_beside import tied
from sgp_ros.robots.observed_motion import ObservedMotion


def _force(
    columns: Columns,
    frame: Frame,
    candidates: tuple[EffectAt, ...],
    w: np.ndarray,
) -> np.ndarray:
    total = np.zeros_like(frame.equations.d)
    for s in candidates:
        total = total + columns.of(s, frame.equations, w) @ s.coefficients
    return total


def covariance(model: Model, columns: Columns, unknown: Collection[int] = ()) -> np.ndarray:
    """Return the covariance of all free coefficients, then all shapes, (c + s, c + s).

    A shape may lie anywhere within its bounds, if the rows do not tell. `unknown` are joints that
    the model does not describe: what is left there says nothing of the others.
    """
    frame = Frame.of(model.frame.equations, model.sigma, is_free=model.is_free, weight=1.0)
    free = [
        frame.projected(columns.of(s, frame.equations, model.w))
        for s in model.effects if not s.effect.is_given
    ]  # fmt: skip
    parts = list(free)
    low, high = shape_bounds(frame.equations, model.effects)
    if len(low):
        x = np.concatenate([s.shape for s in model.effects if len(s.shape)])
        slopes = []
        steps = 1e-3 * shape_scales(frame.equations, model.effects)
        for i, h in enumerate(steps):
            moved = []
            for sign in (1.0, -1.0):
                y = x.copy()
                y[i] = np.clip(y[i] + sign * h, low[i], high[i])
                force = _force(columns, frame, with_shapes(model.effects, y), model.w)
                moved.append((y[i], force))
            (a, fa), (b, fb) = moved
            slopes.append(((fa - fb) / max(a - b, 1e-300))[:, :, None])
        parts.append(frame.projected(np.concatenate(slopes, axis=2)))
    J = np.concatenate(parts, axis=1) if parts else np.zeros((model.residual.size, 0))
    ties = _ties(model.effects)
    J = J @ ties
    scale = np.sqrt((J * J).sum(axis=0))
    is_seen = scale > UNSEEN * scale.max(initial=0.0)
    scale[~is_seen] = np.inf
    J = J / scale
    n = len(ties) - len(low)  # coefficients
    spans = np.concatenate([np.zeros(n), high - low])
    spans = (ties * spans[:, None]).max(axis=0, initial=0.0)
    width = np.where(is_seen, spans, 0.0) * np.where(is_seen, scale, 1.0)
    width[:n] = 0.0
    wider = _inflation(model, unknown, len(J))
    known = np.diag(np.divide(12.0, width**2, out=np.zeros_like(width), where=width > 0.0))
    known *= wider.max(initial=1.0)  # against rows that count as fewer
    inverse = np.linalg.pinv(J.T @ J + known, rcond=1e-10)
    C = np.zeros_like(inverse) if model.is_free else _of_stated_bodies(model, J, inverse)
    J *= np.sqrt(wider)[:, None]
    known *= wider.max(initial=1.0)
    C = (C + inverse @ (J.T @ J + known) @ inverse) / scale / scale[:, None]
    return np.asarray(ties @ (C + np.diag(np.where(is_seen, 0.0, spans**2 / 12.0))) @ ties.T)


def _ties(effects: Sequence[EffectAt]) -> np.ndarray:
    """Return what each independent number moves, (c + s, at most that): a rotor its spring's J."""
    coefficients = [0 if s.effect.is_given else len(s.coefficients) for s in effects]
    shapes = [len(s.shape) for s in effects]
    found = np.eye(sum(coefficients) + sum(shapes))
    springs = []
    for spring, rotor in tied(effects):
        springs.append(sum(coefficients) + sum(shapes[:spring]))
        found[springs[-1], sum(coefficients[:rotor])] = 1.0
    return np.delete(found, springs, axis=1)


def _of_stated_bodies(model: Model, J: np.ndarray, inverse: np.ndarray) -> np.ndarray:
    """Return expected squares of the errors that those of the robot file make, (c + s, c + s).

    Changes w of its bodies have the prior of `STATED_ERROR` and move the parameters by
    `G w`, `G = A^-1 J^T B`, with B their columns. What is left of B tells w from the residual.

    Args:
        model: with the bodies of the file.
        J: (N k + p, c + s) scaled derivatives.
        inverse: `A^-1`.
    """
    equations, (N, k) = model.frame.equations, model.residual.shape
    rows, p = J[: N * k].reshape(N, k, -1), equations.size - equations.instants
    BB, JB, Br = np.zeros((p, p)), np.zeros((J.shape[1], p)), np.zeros(p)
    residual = model.residual / model.sigma
    for j, factor in enumerate(equations.factors):
        R = factor.R[:, equations.instants :] / model.sigma[j]
        BB += R.T @ R
        JB += (rows[:, j].T @ factor.Q) @ R
        Br += R.T @ (factor.Q.T @ residual[:, j])
    G, error = inverse @ JB, STATED_ERROR / equations.accuracy
    known = (BB - JB.T @ G) / model.frame.weight + np.eye(p) / error**2
    left = Br - G.T @ (J[: N * k].T @ residual.ravel())
    w = np.linalg.solve(known, left / model.frame.weight)
    return np.asarray(G @ (np.linalg.inv(known) + np.outer(w, w)) @ G.T)


def _inflation(model: Model, unknown: Collection[int], rows: int) -> np.ndarray:
    """Return by how much correlation in time widens the error of each row, at least 1, (rows,)."""
    factors = np.array([correlation_factor(r) for r in model.residual.T])
    is_open = np.isin(np.arange(len(factors)), list(unknown))
    common = float(factors[~is_open].max(initial=1.0))
    found = np.full(rows, common)
    found[: model.residual.size] = np.tile(np.where(is_open, factors, common), len(model.residual))
    return found


def reported_std(
    model: Model, columns: Columns, unknown: Collection[int] = ()
) -> list[dict[str, float]]:
    """Return the standard deviation of each reported number of each candidate."""
    motion = model.frame.equations.motion
    C = covariance(model, columns, unknown)
    free = sum(len(s.coefficients) for s in model.effects if not s.effect.is_given)
    result, at, shape_at = [], 0, free
    for s in model.effects:
        m = 0 if s.effect.is_given else len(s.coefficients)
        rows = [*range(at, at + m), *range(shape_at, shape_at + len(s.shape))]
        at, shape_at = at + m, shape_at + len(s.shape)
        result.append(_delta(s, motion, C[np.ix_(rows, rows)], m))
    return result


def _delta(candidate: EffectAt, motion: ObservedMotion, C: np.ndarray, m: int) -> dict[str, float]:
    values = candidate.report(motion)
    numbers = [name for name, value in values.items() if isinstance(value, float)]
    std = np.sqrt(np.maximum(np.diag(C), 0.0))
    slopes = np.zeros((len(numbers), len(std)))
    for i, step in enumerate(std):
        if step <= 0.0:
            continue
        moved_c, moved_s = candidate.coefficients.copy(), candidate.shape.copy()
        if i < m:
            moved_c[i] += 0.1 * step
        else:
            moved_s[i - m] += 0.1 * step
        after = replace(candidate, shape=moved_s, coefficients=moved_c).report(motion)
        for row, name in enumerate(numbers):
            change = float(after[name]) - float(values[name])
            if name == 'phase':
                change = (change + np.pi) % (2 * np.pi) - np.pi
            slopes[row, i] = change / (0.1 * step)
    variance = np.einsum('ij,jk,ik->i', slopes, C, slopes)
    return {name: float(np.sqrt(max(v, 0.0))) for name, v in zip(numbers, variance, strict=True)}
