"""The model that a diagnosis ends with, its bodies, and what it predicts on a recording.

The equation of motion is affine in the acceleration: `e(a) = tau_nominal(q, v, a) - tau - tau_x -
base w`, so `a - (de/da)^-1 e(a)` is the predicted acceleration, and does not depend on the a it
starts from. A joint that dry friction holds does not accelerate.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.compare.rest import resting
from sgp_ros.diagnosis.compare.trajectory import Bandwidth, RawTrajectory, observe
from sgp_ros.diagnosis.explain.fitted_model import Model, extra_force, held_joints, imbalance
from sgp_ros.diagnosis.locate.remainder import Remainder
from sgp_ros.diagnosis.shown import Predictions
from sgp_ros.errors import NumericalError
from sgp_ros.rigid.consistent import project_information
from sgp_ros.rigid.pseudo_inertia import is_consistent
from sgp_ros.rigid.tree import Tree
from sgp_ros.robots.observed_motion import ObservedMotion


def _left(
    model: Model,
    equations: Equations,
    motion: ObservedMotion,
    remainders: Sequence[Remainder],
) -> np.ndarray:
    """Return the imbalance that processes leave, (n, k) [N m or N]."""
    e = imbalance(model, equations, motion)
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
    e = _left(model, equations, motion, remainders) if remainders else plain
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


_SHARP = 4.0
"""States are smoothed at this multiple of the cut-off where accelerations are predicted."""


@dataclass(frozen=True, eq=False)
class FinalModel:
    """Effects, bodies and processes, fitted on the training recording."""

    model: Model
    nominal: Model
    equations: Equations
    remainders: tuple[Remainder, ...]

    def predict(self, raw: RawTrajectory, tree: Tree) -> Predictions:
        """Return the accelerations at every time of a recording."""
        cutoff = self.equations.filter.cutoff
        rate = 1.0 / raw.step
        motion = observe(raw, tree, Bandwidth(cutoff, min(_SHARP * cutoff, 0.4 * rate)))
        rests = resting(raw, motion, Bandwidth(cutoff, min(_SHARP * cutoff, 0.4 * rate)))
        a = accelerations(self.model, self.equations, motion, rests, self.remainders)
        return Predictions(motion.time, a)

    def imbalance(
        self,
        model: Model,
        motion: ObservedMotion,
        rests: np.ndarray,
        remainders: tuple[Remainder, ...],
    ) -> np.ndarray:
        """Return e of one of the models, (n, k); 0 where dry friction holds a joint [N m or N]."""
        e = _left(model, self.equations, motion, remainders)
        for j in held_joints(model, motion):
            e[rests[:, j], j] = 0.0
        return e


def diagnosed_bodies(
    equations: Equations, model: Model, unstated: Collection[int] = ()
) -> np.ndarray | None:
    """Return the inertial parameters of the bodies, (b, 10), in the order of the tree.

    The model's change w of the parameters has the information `R^T R`, its prior included. Where
    it leads to bodies that cannot exist, those that the data contradict least take their place.

    Args:
        equations: of the recording.
        model: that was asserted.
        unstated: bodies that the robot's file leaves open.

    Returns:
        None where the bodies are those of the file, or none that can exist were found.
    """
    nominal = equations.motion.tree.parameters
    if not model.is_free:
        return nominal if unstated else None
    D, at = equations.directions, equations.instants  # parameters change by w[at:] @ D
    changed = (nominal.ravel() + model.w[at:] @ D).reshape(nominal.shape)
    if np.all(is_consistent(changed)):
        return changed
    root = np.linalg.solve(D, model.frame.R[at:, at:].T).T  # R w = root @ change, any instants
    blocks = [range(10 * i, 10 * i + 10) for i in range(len(nominal))]
    try:
        found = project_information(changed.ravel(), root, blocks, reference=nominal.ravel())
    except NumericalError:
        return None
    return found.coefficients.reshape(nominal.shape)
