"""Candidate models: effects at places with shapes, fitted jointly with the inertial parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.explain.fitted_model import Model, floors, price_of
from sgp_ros.diagnosis.explain.frame import Frame
from sgp_ros.diagnosis.explain.regression import (
    Columns,
    dry_joints,
    shape_bounds,
    shape_scales,
    with_shapes,
)
from sgp_ros.physics.effect_at import EffectAt

UNSEEN = 1e-12
"""A column that is this much smaller than the largest acts on nothing; its coefficient is zero."""


def fit(
    columns: Columns,
    candidates: tuple[EffectAt, ...],
    sigma: np.ndarray,
    *,
    is_free: bool = True,
    w: np.ndarray | None = None,
    rounds: int = 3,
    steps: int = 12,
    still: int = 0,
) -> Model:
    """Fit shapes, coefficients and inertial parameters; the scale of each joint by iteration.

    Args:
        columns: of the recording.
        candidates: effects with the shapes to start from.
        sigma: (k,) scale to start from [N m or N].
        is_free: whether inertial parameters may differ.
        w: (p,) their change to start from; None for none.
        rounds: iterations.
        steps: of the search in the first.
        still: so many of the first candidates keep their shapes.
    """
    equations = columns.equations(dry_joints(candidates))
    frame = Frame.of(equations, sigma, is_free=is_free)
    model = None
    for _ in range(rounds):
        moved = _searched(frame, columns, candidates, steps, w, still)
        candidates = (*candidates[:still], *moved)
        model = _solved(frame, columns, candidates, w)
        w = model.w if is_free else None
        frame = Frame.of(equations, model.sigma, is_free=is_free)
        steps = max(steps // 2, 4)
    assert model is not None
    return _solved(frame, columns, candidates, w)


class _Projected:
    """Projected columns of candidates in one frame, with all but one shape held.

    Args:
        frame: that projects.
        columns: of the recording.
        w: (p,) change of the bodies; None for none.
    """

    def __init__(self, frame: Frame, columns: Columns, w: np.ndarray | None) -> None:
        self.frame, self._columns, self._w = frame, columns, w
        self._known: dict[tuple[object, bytes], np.ndarray] = {}

    def of(self, candidate: EffectAt, among: int) -> np.ndarray:
        """Return those of one of so many candidates, (N k + p, m)."""
        key = candidate.key, candidate.shape.tobytes()
        if key not in self._known:
            if len(self._known) > 4 * among:
                self._known.clear()
            x = self._columns.of(candidate, self.frame.equations, self._w)
            self._known[key] = self.frame.projected(x)
        return self._known[key]


def split(
    frame: Frame, columns: Columns, candidates: tuple[EffectAt, ...], w: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, list[int]]:
    """Return target less given effects, free columns (projected), and their widths."""
    return _split(_Projected(frame, columns, w), candidates)


def _split(
    projected: _Projected, candidates: tuple[EffectAt, ...]
) -> tuple[np.ndarray, np.ndarray, list[int]]:
    y = projected.frame.y
    free, widths = [], []
    for candidate in candidates:
        x = projected.of(candidate, len(candidates))
        if candidate.effect.is_given:
            y = y - x[:, 0]
            widths.append(0)
        else:
            free.append(x)
            widths.append(x.shape[1])
    A = np.concatenate(free, axis=1) if free else np.zeros((len(y), 0))
    return y, A, widths


def _least(A: np.ndarray, y: np.ndarray) -> np.ndarray:
    if not A.shape[1]:
        return np.zeros(0)
    scale = np.sqrt((A * A).sum(axis=0))
    scale[scale <= UNSEEN * scale.max()] = np.inf
    c = np.linalg.lstsq(A / scale, y, rcond=1e-7)[0]
    return np.asarray(c / scale)


def _residual(projected: _Projected, candidates: tuple[EffectAt, ...]) -> np.ndarray:
    """Return the scaled residual, (N k + p,)."""
    y, A, _ = _split(projected, candidates)
    return y - A @ _least(A, y)


def _searched(
    frame: Frame,
    columns: Columns,
    candidates: tuple[EffectAt, ...],
    steps: int,
    w: np.ndarray | None,
    still: int,
) -> tuple[EffectAt, ...]:
    """Improve the shapes of candidates after the first ones by Levenberg-Marquardt in bounds."""
    fixed, candidates = candidates[:still], candidates[still:]
    low, high = shape_bounds(frame.equations, candidates)
    if not len(low):
        return candidates
    if fixed:
        frame = frame.beyond(*split(frame, columns, fixed, w)[:2])
    x = np.clip(np.concatenate([s.shape for s in candidates]), low, high)
    span = np.maximum(shape_scales(frame.equations, candidates), 1e-12)
    projected = _Projected(frame, columns, w)
    r = _residual(projected, with_shapes(candidates, x))
    cost, damping = float(r @ r), 1e-2
    for _ in range(steps):
        J = np.empty((len(r), len(x)))
        for i in range(len(x)):
            h = 2e-4 * span[i] if x[i] + 2e-4 * span[i] <= high[i] else -2e-4 * span[i]
            moved = x.copy()
            moved[i] += h
            J[:, i] = (_residual(projected, with_shapes(candidates, moved)) - r) / (h / span[i])
        H, g = J.T @ J, J.T @ r
        improved = False
        for _ in range(6):
            step = -np.linalg.solve(
                H + damping * (np.diag(np.diag(H)) + 1e-12 * np.eye(len(x))), g
            )
            trial = np.clip(x + np.clip(step, -0.2, 0.2) * span, low, high)
            r1 = _residual(projected, with_shapes(candidates, trial))
            c1 = float(r1 @ r1)
            if c1 < cost:
                gain = (cost - c1) / cost
                x, r, cost, improved = trial, r1, c1, True
                damping = max(damping / 5.0, 1e-8)
                break
            damping *= 6.0
        if not improved or gain < 1e-6:
            break
    return with_shapes(candidates, x)


def added_inertia(candidates: Sequence[EffectAt], equations: Equations) -> np.ndarray:
    """Return what rotors and loads add to the mass matrix, (`POSES`, k, k) [kg m^2 or kg]."""
    still, *pushed = equations.poses
    added = np.zeros((*still.position.shape, len(pushed)))
    for s in candidates:
        if not s.effect.sees_acceleration or s.effect.uses_bodies:
            continue
        before = s.columns(still) @ s.coefficients
        for j, motion in enumerate(pushed):
            force = s.columns(motion) @ s.coefficients - before
            added[:, s.place.joint if force.ndim == 1 else slice(None), j] -= force
    return added


def _solved(
    frame: Frame, columns: Columns, candidates: tuple[EffectAt, ...], w_before: np.ndarray | None
) -> Model:
    equations = frame.equations
    y, A, widths = split(frame, columns, candidates, w_before)
    c = _least(A, y)
    placed, forces, at = [], [], 0
    for s, m in zip(candidates, widths, strict=True):
        x = columns.of(s, equations, w_before)
        own = np.ones(1) if s.effect.is_given else c[at : at + m]
        at += m
        placed.append(replace(s, coefficients=own))
        forces.append(x @ own)
    left = equations.d - sum(forces, np.zeros_like(equations.d))
    w = frame.parameters(left)
    residual = left - equations.force_of_bodies(w)
    mean = (residual**2).mean(axis=0)
    inertia = equations.inertia(w, added_inertia(placed, equations))
    # what is measured is the motion: the floor is one of accelerations
    variance = mean + floors(equations) * np.exp(2.0 * np.maximum(inertia, -50.0))
    N = len(residual)
    size = sum(len(s.shape) for s in candidates) + len(c)
    score = (
        -0.5 * N * float(np.log(variance).sum())
        + N * float(inertia.sum())
        - 0.5 * frame.weight * float(w @ w)
        - price_of(frame, size)
    )
    return Model(
        tuple(placed), w, np.sqrt(variance), inertia, score, residual,
        tuple(forces), frame,
    )  # fmt: skip
