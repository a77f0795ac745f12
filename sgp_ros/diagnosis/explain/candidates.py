"""Candidate models: effects at places with shapes, fitted jointly with the inertial parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.explain.fitted_model import (
    Model,
    add_force,
    floors,
    price_of,
    shown_inertia,
)
from sgp_ros.diagnosis.explain.frame import Frame
from sgp_ros.diagnosis.explain.inertia_slope import InertiaSlope
from sgp_ros.diagnosis.explain.regression import Columns, dry_joints
from sgp_ros.diagnosis.explain.shape_search import Bench, searched
from sgp_ros.physics.catalogue import TORQUE_GAIN
from sgp_ros.physics.effect_at import EffectAt, in_series
from sgp_ros.physics.motor_beside import beside_rotors, with_rotors
from sgp_ros.physics.servo import Servo

_SMALL = 1e-3
"""Change of a command for a slope, in parts of its root mean square."""


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
    candidates = in_series(candidates, columns.equations(frozenset()).motion.known)
    equations = columns.equations(dry_joints(candidates))
    frame = Frame.of(equations, sigma, is_free=is_free)
    slope = columns.inertia_slope if is_free else None
    if slope is not None:
        free = _solved(Bench(frame, columns, w), columns, candidates, w)
        frame = _held(frame, slope, free, np.zeros(equations.size) if w is None else w, sigma)
    model = None
    for _ in range(rounds):
        bench = Bench(frame, columns, w)
        candidates = searched(bench, candidates, steps, still)
        model = _solved(bench, columns, candidates, w)
        w = model.w if is_free else None
        frame = Frame.of(equations, model.sigma, is_free=is_free)
        if slope is not None:
            frame = _held(frame, slope, model, model.w, model.sigma)
        steps = max(steps // 2, 4)
    assert model is not None
    bench = Bench(frame, columns, w)
    model = _solved(bench, columns, candidates, w)
    one = with_rotors(beside_rotors(model.effects, equations.motion))
    if any(s.place != o.place for s, o in zip(one, model.effects, strict=True)):
        return fit(columns, one, model.sigma, is_free=is_free, w=w, rounds=2, steps=steps)
    return model if one == model.effects else _solved(bench, columns, one, w)


def _held(
    frame: Frame, slope: InertiaSlope, model: Model, w: np.ndarray, sigma: np.ndarray
) -> Frame:
    """Return a frame that holds the inertia of joints without a motor at bodies w (p,)."""
    pull = slope.pull(w, model.w, model.mean_square, sigma, len(model.residual))
    return replace(frame, pull=pull)


def split(
    frame: Frame, columns: Columns, candidates: tuple[EffectAt, ...], w: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, list[int]]:
    """Return target less given effects, free columns (projected), and their widths."""
    y = frame.y
    free, widths = [], []
    for candidate in candidates:
        x = frame.projected(columns.of(candidate, frame.equations, w))
        if candidate.effect.is_given:
            y = y - x[:, 0]
            widths.append(0)
        else:
            free.append(x)
            widths.append(x.shape[1])
    A = np.concatenate(free, axis=1) if free else np.zeros((len(y), 0))
    return y, A, widths


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


def passed_on(candidates: Sequence[EffectAt], equations: Equations) -> np.ndarray:
    """Return what motors pass on of changes of what drives with gains ask for, (k,) factors.

    Targets that come late change nothing of what a drive makes of the motion itself.
    """
    motion = equations.motion
    passed = np.ones(motion.tree.size)
    if not isinstance(motion.drive, Servo):
        return passed
    for s in (s for s in candidates if s.place.joint >= 0 and not s.effect.is_late):
        j, change = s.place.joint, s.characteristic
        u = motion.effort[:, j]
        h = _SMALL * max(float(np.sqrt((u**2).mean())), 1e-300)
        if s.effect is TORQUE_GAIN:
            passed[j] *= abs(1.0 + float(s.coefficients[0]))
        elif change is not None:
            passed[j] *= float(np.abs(change(u + h) - change(u - h)).mean()) / (2 * h)
        elif s.effect.effort_columns(s.place.kind):
            push = h * np.eye(len(passed))[j]
            more, less = (s.force(replace(motion, effort=motion.effort + x))[:, j]
                          for x in (push, -push))  # fmt: skip
            passed[j] *= float(np.abs(1.0 + (more - less) / (2 * h)).mean())
    return passed


def _solved(
    bench: Bench, columns: Columns, candidates: tuple[EffectAt, ...], w_before: np.ndarray | None
) -> Model:
    frame, equations = bench.frame, bench.frame.equations
    c = bench.coefficients(candidates)
    placed, parts, at, left = list[EffectAt](), list[np.ndarray](), 0, -equations.d
    for s in candidates:
        motion = columns.corrected(w_before if s.effect.uses_bodies else None)
        x = columns.local(s, equations, motion)
        own = np.ones(1) if s.effect.is_given else c[at : at + x.shape[-1]]
        at += 0 if s.effect.is_given else len(own)
        placed.append(replace(s, coefficients=own))
        parts.append(x @ own)
        add_force(left, s.place.joint, parts[-1])
    left = -left
    w = frame.parameters(left)
    residual = left - equations.force_of(w)
    mean = (residual**2).mean(axis=0)
    inertia = equations.inertia(w, added_inertia(placed, equations), passed_on(placed, equations))
    variance = mean + floors(equations, inertia)
    N = len(residual)
    size = sum(len(s.shape) for s in candidates) + len(c)
    score = (
        -0.5 * N * float(np.log(variance).sum())
        + N * shown_inertia(equations, inertia, placed)
        - 0.5 * frame.weight * float(w @ w)
        - price_of(frame, size)
    )
    return Model(
        tuple(placed), w, np.sqrt(variance), inertia, score, residual,
        tuple(parts), frame,
    )  # fmt: skip
