"""Accelerations that a model predicts at every time of a recording, and its efforts.

The equation of motion is affine in the acceleration: `e(a) = tau_nominal(q, v, a) - tau - tau_x -
base w`, so `a - (de/da)^-1 e(a)` is the prediction, and does not depend on the a it starts from.
A joint that dry friction holds does not accelerate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.explain.suspects import dry_joints
from sgp_ros.diagnosis.locate.remainder import Remainder
from sgp_ros.robots.observed_motion import ObservedMotion


def extra_force(model: Model, motion: ObservedMotion) -> np.ndarray:
    """Return the force of all effects at the full rate, (n, k) [N m or N]."""
    force = motion.stated_force.copy()
    for suspect in model.suspects:
        x = suspect.columns(motion) @ suspect.coefficients
        if x.ndim == 2:
            force += x
        else:
            force[:, suspect.place.joint] += x
    return force


def held_joints(model: Model, motion: ObservedMotion) -> frozenset[int]:
    """Return the joints that dry friction may hold, of the model or of the nominal robot."""
    return motion.dry_joints | dry_joints(model.suspects)


def imbalance(
    model: Model,
    equations: Equations,
    motion: ObservedMotion,
    remainders: Sequence[Remainder] = (),
) -> np.ndarray:
    """Return e at the full rate, (n, k) [N m or N]."""
    change = (model.w @ equations.directions).reshape(motion.tree.parameters.shape)
    changed = replace(
        motion, tree=replace(motion.tree, parameters=motion.tree.parameters + change)
    )
    needed = changed.effort_for(motion.position, motion.velocity, motion.acceleration)
    e = needed - motion.effort - extra_force(model, changed)
    for remainder in remainders:
        e[:, remainder.joint] -= remainder.force(motion)
    return e


def accelerations(
    model: Model,
    equations: Equations,
    motion: ObservedMotion,
    rests: np.ndarray,
    remainders: Sequence[Remainder] = (),
) -> np.ndarray:
    """Return the predicted accelerations, (n, k) [rad/s^2 or m/s^2].

    Args:
        model: fitted on `equations`.
        equations: of the training recording.
        motion: where to predict.
        rests: (n, k) where joints rest.
        remainders: processes beside the model; they do not see the acceleration.
    """
    n, k = motion.position.shape
    plain = imbalance(model, equations, motion)
    slope = np.empty((n, k, k))
    for j in range(k):
        moved = motion.acceleration.copy()
        moved[:, j] += 1.0
        slope[:, :, j] = imbalance(model, equations, replace(motion, acceleration=moved)) - plain
    e = imbalance(model, equations, motion, remainders) if remainders else plain
    a = motion.acceleration - np.linalg.solve(slope, e[:, :, None])[:, :, 0]
    for j in sorted(held_joints(model, motion)):
        rows = np.flatnonzero(rests[:, j])
        if len(rows):
            a[rows] = _held(model, motion, slope[rows], a[rows], rows, j)
    return a


def _held(
    model: Model,
    motion: ObservedMotion,
    slope: np.ndarray,
    a: np.ndarray,
    rows: np.ndarray,
    j: int,
) -> np.ndarray:
    """Return the accelerations in rows where friction holds joint j as far as it can."""
    up = extra_force(model, motion.sliding(1.0))[rows, j]
    down = extra_force(model, motion.sliding(-1.0))[rows, j]
    now = extra_force(model, motion)[rows, j]
    unit = np.zeros((len(rows), a.shape[1], 1))
    unit[:, j] = 1.0
    response = np.linalg.solve(slope, unit)[:, :, 0]
    wanted = now - a[:, j] / response[:, j]
    force = np.clip(wanted, np.minimum(up, down), np.maximum(up, down))
    return a + response * (force - now)[:, None]
