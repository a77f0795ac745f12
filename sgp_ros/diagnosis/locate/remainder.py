"""The Gaussian process Z for what no named effect describes, per joint.

Z is given the position, velocity, direction and effort of its joint and the motion of the others,
and evidence decides which of these it needs: that is also what the discrepancy depends on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.parts import PARTS, parts_of
from sgp_ros.gp.model import CoefficientPrior, Observations
from sgp_ros.gp.model import Model as Hyperparameters
from sgp_ros.gp.posterior import Posterior
from sgp_ros.gp.selection import select_inputs
from sgp_ros.robots.observed_motion import ObservedMotion

SIZE = 400
CONDITIONED = 500
"""Rows that a prediction of a part left out is conditioned on."""
MOST_NEIGHBOURS = 2


@dataclass(frozen=True, eq=False)
class Remainder:
    """Z of one joint.

    Attributes:
        joint: index.
        inputs: names of what it depends on.
        columns: of `process_inputs`.
        posterior: of Z.
    """

    joint: int
    inputs: tuple[str, ...]
    columns: tuple[int, ...]
    scale: np.ndarray
    posterior: Posterior

    def force(self, motion: ObservedMotion) -> np.ndarray:
        """Return the mean of Z, (n,) [N m or N]."""
        U = process_inputs(motion, self.joint)[0] / self.scale
        rows = 2000
        n = len(U)
        F = np.zeros((rows, 1, 0))
        parts = [
            self.posterior.predict(U[i : i + rows], F[: min(rows, n - i)]).mean[:, 0]
            for i in range(0, n, rows)
        ]
        return np.concatenate(parts)


def process_inputs(motion: ObservedMotion, joint: int) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return what Z of a joint could depend on, (n, d), and the names."""
    tree = motion.tree
    columns = [motion.wrapped[:, joint], motion.velocity[:, joint], motion.direction[:, joint]]
    names = [
        f'{what} of {tree.joint_names[joint]}' for what in ('position', 'velocity', 'direction')
    ]
    if tree.is_actuated[joint]:
        columns.append(motion.effort[:, joint])
        names.append(f'effort of {tree.joint_names[joint]}')
    near = sorted((i for i in range(tree.size) if i != joint), key=lambda i: abs(i - joint))
    for i in near[:MOST_NEIGHBOURS]:
        columns += [motion.wrapped[:, i], motion.velocity[:, i]]
        names += [f'{what} of {tree.joint_names[i]}' for what in ('position', 'velocity')]
    return np.column_stack(columns), tuple(names)


def learn_remainder(equations: Equations, residual: np.ndarray, joint: int) -> Remainder | None:
    """Return Z of a joint learned from a residual (N, k).

    None where there is none, or where it foretells nothing of parts left out: what happens once,
    such as a burst, is no function of the motion, and predictions elsewhere are better without.
    """
    full, names = process_inputs(equations.motion, joint)
    U = equations.filter(full)
    scale = U.std(axis=0) + 1e-12
    U = U / scale
    y = residual[:, joint, None]
    F = np.zeros((len(y), 1, 0))
    prior = CoefficientPrior.flat(0)
    chosen = select_inputs(Observations(U, F, y), prior, 0, tuple(range(U.shape[1])), 200)
    if chosen.kernel is None or chosen.inputs is None:
        return None
    model = Hyperparameters((chosen.kernel,), (chosen.noise,))
    if foretold(model, U, y[:, 0], parts_of(len(y), 1)) <= 0.0:
        return None
    rows = spread(np.arange(len(y)), SIZE)
    posterior = Posterior(model, observations(U, y[:, 0], rows), prior)
    return Remainder(
        joint, tuple(names[i] for i in chosen.inputs), chosen.inputs, scale, posterior
    )


def foretold(model: Hyperparameters, U: np.ndarray, r: np.ndarray, part: np.ndarray) -> float:
    """Return the share of r (N,) that Z at inputs U (N, d) explains on parts left out.

    Negative where it makes things worse. `part` (N,) is the part of each row.
    """
    error = sum(_error(model, U, r, part == i) for i in range(PARTS))
    return 1.0 - error / max(float(r @ r), 1e-300)


def _error(model: Hyperparameters, U: np.ndarray, r: np.ndarray, out: np.ndarray) -> float:
    """Return the sum of squared errors on the rows that are out."""
    known = observations(U, r, spread(np.flatnonzero(~out), CONDITIONED))
    there = U[out]
    found = Posterior(model, known, CoefficientPrior.flat(0))
    mean = found.predict(there, np.zeros((len(there), 1, 0))).mean[:, 0]
    return float(((r[out] - mean) ** 2).sum())


def spread(rows: np.ndarray, count: int) -> np.ndarray:
    """Return at most `count` of the rows, evenly spread."""
    chosen = np.linspace(0, len(rows) - 1, min(count, len(rows)))
    return np.asarray(rows[np.unique(chosen.astype(int))])


def observations(U: np.ndarray, r: np.ndarray, rows: np.ndarray) -> Observations:
    """Return some rows of inputs U (N, d) and values r (N,), without physics."""
    return Observations(U[rows], np.zeros((len(rows), 1, 0)), r[rows, None])
