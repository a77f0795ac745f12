"""Masses and centres of mass that a recording contradicts."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import NUMBER_ERROR
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.result import ParameterError


def parameter_errors(
    equations: Equations, model: Model, unstated: Collection[int] = (),
    other: Model | None = None,
) -> tuple[ParameterError, ...]:  # fmt: skip
    """Return masses and centres that differ by more than two standard deviations.

    Args:
        equations: of the recording.
        model: that was asserted.
        unstated: bodies that the robot's file leaves open: nothing that was stated is wrong.
        other: of another machine, from which they differ; None for the nominal robot.
    """
    tree = equations.motion.tree
    if not model.is_free:
        return ()
    C, stated = _of_bodies(model), tree.parameters
    changed = equations.with_bodies(equations.motion, model.w).tree.parameters
    if other is not None:
        C = C + _of_bodies(other)
        stated = equations.with_bodies(equations.motion, other.w).tree.parameters
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


def _of_bodies(model: Model) -> np.ndarray:
    """Return the covariance of the change of the bodies, (p, p)."""
    instants = model.frame.equations.instants
    return np.asarray(model.frame.covariance[instants:, instants:])
