"""Masses and centres of mass that a recording contradicts."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import ALIKE, NUMBER_ERROR, PER_PARAMETER
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.result import ParameterError


def parameter_errors(
    equations: Equations, model: Model, unstated: Collection[int] = (),
    other: Model | None = None,
) -> tuple[ParameterError, ...]:  # fmt: skip
    """Return masses and centres that differ by more than two standard deviations.

    Those of one body, with all others as stated, where one alone explains what all of them do.

    Args:
        equations: of the recording.
        model: that was asserted.
        unstated: bodies that the robot's file leaves open: nothing that was stated is wrong.
        other: of another machine, from which they differ; None for the nominal robot.
    """
    tree = equations.motion.tree
    if not model.is_free:
        return ()
    if other is None:
        (w, C), stated = _changed(model), tree.parameters
    else:
        w, C = model.w, _of_bodies(model) + _of_bodies(other)
        stated = equations.with_bodies(equations.motion, other.w).tree.parameters
    changed = equations.with_bodies(equations.motion, w).tree.parameters
    D = equations.directions.reshape(len(C), -1, 10)
    found = []
    for body, link in enumerate(tree.link_names):
        before, after = stated[body], changed[body]
        if after[0] <= 0.0 or before[0] <= 0.0 or body in unstated:
            continue
        slopes = {'mass': D[:, body, 0]}
        for axis, name in enumerate('xyz'):
            slopes[f'com_{name}'] = (
                D[:, body, 1 + axis] - after[1 + axis] / after[0] * D[:, body, 0]
            ) / after[0]
        values = {'mass': (after[0], before[0], 'kg')} | {
            f'com_{n}': (after[1 + i] / after[0], before[1 + i] / before[0], 'm')
            for i, n in enumerate('xyz')
        }
        for name, (now, then, unit) in values.items():
            std = float(np.sqrt(max(float(slopes[name] @ C @ slopes[name]), 0.0)))
            std = float(np.hypot(std, NUMBER_ERROR * abs(now - then)))
            if abs(now - then) > 2.0 * std and abs(now - then) > 1e-9:
                found.append(ParameterError(link, name, float(now), std, float(then), unit))
    return tuple(found)


def _changed(model: Model) -> tuple[np.ndarray, np.ndarray]:
    """Return the change of the bodies, (p,), and its covariance, (p, p); of one if that will do.

    The others cost `|R (w - x)|^2 / (2 weight)` [nats] if they stay as stated. That must be less
    than the price of the numbers they determine, and of no other body nearly as little.
    """
    frame, equations = model.frame, model.frame.equations
    at = equations.instants
    owned = np.asarray(equations.directions.reshape(len(frame.R) - at, -1, 10).any(axis=2))
    found = []
    for body in range(owned.shape[1] if (owned.sum(axis=1) <= 1).all() else 0):
        kept = np.flatnonzero(np.concatenate([np.ones(at, dtype=bool), owned[:, body]]))
        some = replace(frame, R=np.asarray(np.linalg.qr(frame.R[:, kept], mode='r')))
        x = np.linalg.lstsq(frame.R[:, kept], frame.R @ model.w, rcond=None)[0]
        lost = frame.R @ model.w - frame.R[:, kept] @ x
        found.append((0.5 * float(lost @ lost) / frame.weight, body, kept, x, some))
    found.sort(key=lambda item: item[0])
    if len(found) < 2 or found[1][0] < found[0][0] + ALIKE:
        return model.w, _of_bodies(model)
    cost, _, kept, x, some = found[0]
    if cost > PER_PARAMETER * (frame.determined - some.determined):
        return model.w, _of_bodies(model)
    w, C = np.zeros_like(model.w), np.zeros_like(frame.R)
    w[kept], C[np.ix_(kept, kept)] = x, some.covariance
    return w, C[at:, at:]


def _of_bodies(model: Model) -> np.ndarray:
    """Return the covariance of the change of the bodies, (p, p)."""
    instants = model.frame.equations.instants
    return np.asarray(model.frame.covariance[instants:, instants:])
