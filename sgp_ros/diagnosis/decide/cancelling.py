"""Laws of joints whose efforts are a small difference of large forces.

A pendulum that swings freely takes inertial forces that its weight supplies; what its drive gives
is the small difference. An error of a few per cent in either force, by a motor constant, a gear
or a clock, is then a large part of the effort, though no law is missing. What a model leaves
there is adequate up to `FORCE_ACCURACY` of the inertial forces, if its laws do not lean on the
model being complete: each must be there beside a process Z of position, velocity and acceleration
that takes whatever it can of the effort, and beside bodies of any kind (the semi-parametric model
of the paper). Dry friction changes with the sign of a velocity, which no smooth Z does; a law that
Z can say as well is not asserted, nor one that few joints have: it needs an adequate model.
"""

from __future__ import annotations

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import EVIDENCE, FORCE_ACCURACY
from sgp_ros.diagnosis.decide.cross_validation import LEARNED, without
from sgp_ros.diagnosis.explain.fitted_model import Model, adds_to_usual
from sgp_ros.diagnosis.locate.remainder import (
    PARTS,
    parts_of,
    process_inputs,
    spread,
)
from sgp_ros.gp.learning import initial_model, learn, screened
from sgp_ros.gp.model import CoefficientPrior, Observations
from sgp_ros.gp.posterior import Posterior
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import JOINT, MOTOR

MOST_ROWS = 1000
"""Rows that Z is learned from."""
LEAST_DIRECTION = 1e-3
"""Changes of the bodies that move a joint less, relative to the most, are left out [1]."""
ROWS_PER_COLUMN = 2
"""Least rows for each column beside Z."""


def within_accuracy(
    equations: Equations, model: Model, excess: np.ndarray
) -> tuple[Model, np.ndarray, np.ndarray]:
    """Return a model, its excess (k,), below one where its laws stand, and where it is accurate.

    Laws stand beside Z at joints where the rest is within the accuracy of the forces, (k,) of
    bool. The other laws of a joint where one stands are left out.

    Args:
        equations: of the recording.
        model: the best one.
        excess: what it leaves at each joint, relative to what an adequate one may.
    """
    if not (excess >= 1.0).any():
        return model, excess, np.zeros(len(excess), dtype=bool)
    share = _share(equations, model)
    found = {
        int(j): _standing(equations, model, int(j))
        for j in np.flatnonzero((excess >= 1.0) & (share < 1.0))
    }
    standing = {j: laws for j, laws in found.items() if laws}
    left_out = [s for j, laws in standing.items() for s in _own(model, j) if s not in laws]
    if left_out:
        model = without(equations, model, lambda s: s in left_out)
        share = _share(equations, model)
    stands = np.isin(np.arange(len(share)), list(standing)) & (share < 1.0)
    return model, np.where(stands, share, excess), share < 1.0


def moving_bodies(equations: Equations, joint: int) -> np.ndarray:
    """Return the forces of those changes of bodies that move a joint, (N, m) [N m or N]."""
    _, sizes, directions = np.linalg.svd(equations.factors[joint].R, full_matrices=False)
    return equations.bases[joint] @ directions[sizes > LEAST_DIRECTION * sizes.max()].T


def _own(model: Model, joint: int) -> list[EffectAt]:
    """Return the laws of a joint alone."""
    return [s for s in model.effects
            if s.place.joint == joint and s.effect.site in {JOINT, MOTOR}]  # fmt: skip


def _share(equations: Equations, model: Model) -> np.ndarray:
    """Return what a model leaves of what the accuracy of the inertial forces allows, (k,).

    Inertial forces are those of each joint's own acceleration, with the fitted bodies.
    """
    motion = equations.with_bodies(equations.motion, model.w)
    force = equations.filter(motion.mass_diagonal * motion.acceleration)
    allowed = FORCE_ACCURACY**2 * (force**2).mean(axis=0)
    return np.asarray(model.mean_square / (allowed + 1e-300))


def _standing(equations: Equations, model: Model, joint: int) -> list[EffectAt]:
    """Return the laws of a joint that have their evidence beside Z and free bodies.

    The standard deviation is the greater of the posterior's and the jackknife's over parts left
    out, for what is correlated in time tells less than its rows.
    """
    laws, bodies = _own(model, joint), moving_bodies(equations, joint)
    rows = spread(np.arange(len(bodies)), MOST_ROWS)
    forces = [f[:, joint] for s, f in zip(model.effects, model.forces, strict=True) if s in laws]
    F = np.column_stack([*forces, bodies])
    if not laws or len(rows) < ROWS_PER_COLUMN * F.shape[1]:
        return []
    y, U = model.residual[:, joint] + sum(forces), _states(equations, joint)
    scale, prior = float(y.std()), CoefficientPrior.flat(F.shape[1])

    def data(rows: np.ndarray) -> Observations:
        return Observations(U[rows], F[rows, None] / scale, y[rows, None] / scale)

    known = data(spread(rows, max(LEARNED, ROWS_PER_COLUMN * F.shape[1])))
    start = screened(known, prior, initial_model(known, (tuple(range(U.shape[1])),)))
    process, part = learn(known, prior, start).model, parts_of(len(bodies))[rows]
    whole = Posterior(process, data(rows), prior)
    own = slice(len(laws))
    others = [Posterior(process, data(rows[part != i]), prior).coefficients[own]
              for i in range(PARTS)]  # fmt: skip
    jackknife = (PARTS - 1) * np.var(others, axis=0)
    std = np.sqrt(np.maximum(np.diag(whole.covariance)[own], jackknife))
    is_there = whole.coefficients[own] > np.sqrt(2.0 * EVIDENCE) * std
    return [s for s, is_seen in zip(laws, is_there, strict=True)
            if is_seen and adds_to_usual(s.effect)]  # fmt: skip


def _states(equations: Equations, joint: int) -> np.ndarray:
    """Return what Z sees: all that it may depend on but the direction, and the acceleration."""
    motion = equations.motion
    inputs, names = process_inputs(motion, joint, sees_effort=False)
    smooth = [i for i, name in enumerate(names) if not name.startswith('direction')]
    U = equations.filter(np.column_stack([inputs[:, smooth], motion.acceleration[:, joint]]))
    return np.asarray(U / (U.std(axis=0) + 1e-12))
