"""The discrepancy that no effect describes: the region it is confined to, and its process Z.

A discrepancy that acts everywhere has its energy wherever the robot was: an interval that holds
nearly all of it holds nearly all of the rows. Of all intervals of all variables the one with
the fewest rows is taken, so chance must be kept out for the best of many: with half of the rows
it is far from reach for a homogeneous rest, white or correlated (a test simulates both).

Z is given what is known before the effort is: the position, velocity and direction of its joint,
the motion of the others, and a commanded effort. A measured effort is what it has to predict, and
would explain itself. Evidence decides which of these it needs. It is checked by cross-validation
in blocks, for rows that are correlated in time (Burman, Chow and Nolan 1994).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import REGION_ENERGY, REGION_LEAST_ROWS, REGION_ROWS
from sgp_ros.diagnosis.locate.dependence import own_variables
from sgp_ros.diagnosis.result import Location
from sgp_ros.errors import NumericalError
from sgp_ros.gp.model import CoefficientPrior, Observations
from sgp_ros.gp.model import Model as Hyperparameters
from sgp_ros.gp.posterior import Posterior
from sgp_ros.gp.selection import select_inputs
from sgp_ros.robots.observed_motion import ObservedMotion

PARTS = 6
"""Parts that are left out in turn."""
PIECES = 4
"""Stretches of each part."""


def parts_of(rows: int, pieces: int = PIECES) -> np.ndarray:
    """Return the part that each row belongs to, (rows,); each has so many stretches."""
    return np.asarray(np.arange(rows) * PARTS * pieces // rows % PARTS)


def region(equations: Equations, r: np.ndarray, joint: int) -> Location:
    """Return where the discrepancy r (N,) of a joint is [N m or N]; empty where it is everywhere.

    Intervals of position are of the wrapped one [rad or m], of velocity [rad/s or m/s], of time
    since the first state [s].
    """
    variables = own_variables(equations, joint)
    found = {name: confined(variables[name], r) for name in ('position', 'velocity', 'time')}
    name = min(found, key=lambda n: found[n][2])
    lo, hi, rows = found[name]
    if len(r) < REGION_LEAST_ROWS or rows > REGION_ROWS:
        return Location()
    if name == 'time':
        return Location(('time',), {}, ((lo, hi),))
    return Location((name,), {name: [[lo, hi]]})


def confined(x: np.ndarray, r: np.ndarray) -> tuple[float, float, float]:
    """Return the interval of x (N,) with the fewest rows that holds most of r (N,).

    That is `REGION_ENERGY` of its energy.

    Returns:
        Least and largest x, share of the rows.
    """
    order = np.argsort(x, kind='stable')
    energy = np.concatenate([[0.0], np.cumsum(r[order] ** 2)])
    wanted = REGION_ENERGY * energy[-1]
    last = np.searchsorted(energy, energy[:-1] + wanted)  # rows [i, last) hold enough
    enough = np.flatnonzero(last < len(energy))
    if not len(enough) or not wanted:
        return float(x[order[0]]), float(x[order[-1]]), 1.0
    start = enough[int(np.argmin(last[enough] - enough))]
    stop = int(last[start])
    return float(x[order[start]]), float(x[order[stop - 1]]), (stop - start) / len(x)


EDGE = 0.25
"""Way beyond the data over which Z becomes what it is there [standard deviations]."""
SHELL = 0.2
"""Rows at the edges of the data that say how much of Z holds beyond them, a share of all."""
SIZE = 400
CONDITIONED = 500
"""Rows that a prediction of a part left out is conditioned on."""
MOST_NEIGHBOURS = 2
_AT_ONCE = 2000
"""Predictions whose covariances with the data are held at a time."""


@dataclass(frozen=True, eq=False)
class Remainder:
    """Z of one joint.

    Attributes:
        joint: index.
        inputs: names of what it depends on.
        sees_effort: whether the commanded effort is among the candidates.
        scale: of the candidates, (d,).
        seen: candidates over the scale on the rows of the recording, (N, d).
        residual: that Z was learned from, (N,) [N m or N].
        posterior: of Z.
        used: indices of the inputs among the candidates.
        beyond: part of Z at the edge of the data that holds beyond it, 0 to 1.
    """

    joint: int
    inputs: tuple[str, ...]
    sees_effort: bool
    scale: np.ndarray
    seen: np.ndarray
    residual: np.ndarray
    posterior: Posterior
    used: tuple[int, ...]
    beyond: float = 1.0

    def force(self, motion: ObservedMotion) -> np.ndarray:
        """Return the mean of Z, (n,) [N m or N].

        A mean that follows its length scales out of the data grows there like a polynomial. So
        beyond the range of an input it becomes a part of what it is at its end, see `_beyond`.
        """
        U = process_inputs(motion, self.joint, sees_effort=self.sees_effort)[0] / self.scale
        inside = np.clip(U, *self._range)
        way = np.abs(U - inside)[:, list(self.used)].sum(axis=1)
        mean = _mean(self.posterior, inside)
        return mean * (self.beyond + (1.0 - self.beyond) * np.exp(-way / EDGE))

    @cached_property
    def _range(self) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest candidates on the rows of the recording, (d,) each."""
        return self.seen.min(axis=0), self.seen.max(axis=0)

    def without(self, out: np.ndarray) -> Remainder:
        """Return the process as learned without some rows, (N,) of bool."""
        rows = spread(np.flatnonzero(~out), CONDITIONED)
        known = observations(self.seen, self.residual, rows)
        return replace(
            self, posterior=Posterior(self.posterior.model, known, CoefficientPrior.flat(0))
        )


def process_inputs(
    motion: ObservedMotion, joint: int, *, sees_effort: bool
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return what Z of a joint could depend on, (n, d), and the names."""
    tree = motion.tree
    columns = [motion.wrapped[:, joint], motion.velocity[:, joint], motion.direction[:, joint]]
    names = [
        f'{what} of {tree.joint_names[joint]}' for what in ('position', 'velocity', 'direction')
    ]
    if sees_effort:
        columns.append(motion.effort[:, joint])
        names.append(f'effort of {tree.joint_names[joint]}')
    near = sorted((i for i in range(tree.size) if i != joint), key=lambda i: abs(i - joint))
    for i in near[:MOST_NEIGHBOURS]:
        columns += [motion.wrapped[:, i], motion.velocity[:, i]]
        names += [f'{what} of {tree.joint_names[i]}' for what in ('position', 'velocity')]
    return np.column_stack(columns), tuple(names)


def learn_remainder(equations: Equations, residual: np.ndarray, joint: int) -> Remainder | None:
    """Return Z of a joint learned from a residual (N, k).

    None where there is none, or where it does not predict parts that were left out: an event that
    happens once, such as a burst, is not a function of the motion, and predictions elsewhere are
    better without it.
    """
    sees_effort = bool(equations.motion.is_commanded[joint])
    full, names = process_inputs(equations.motion, joint, sees_effort=sees_effort)
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
    if explained_share(model, U, y[:, 0], parts_of(len(y), 1)) <= 0.0:
        return None
    rows = spread(np.arange(len(y)), SIZE)
    posterior = Posterior(model, observations(U, y[:, 0], rows), prior)
    used = tuple(chosen.inputs)
    return Remainder(
        joint, tuple(names[i] for i in used), sees_effort, scale, U, y[:, 0], posterior, used,
        _beyond(model, U, y[:, 0], used),
    )  # fmt: skip


def _beyond(model: Hyperparameters, U: np.ndarray, r: np.ndarray, used: tuple[int, ...]) -> float:
    """Return the part of Z at the edge of the data that holds beyond it, 0 to 1.

    It is learned once more without the rows whose inputs are largest or smallest. Of what it is at
    the edge of the others, that part leaves least of r (N,) there: none, where they differ.
    """
    rank = np.argsort(np.argsort(U[:, list(used)], axis=0), axis=0) / len(U)
    outer = np.abs(rank - 0.5).max(axis=1, initial=0.0)
    out = outer > np.quantile(outer, 1.0 - SHELL)
    known = observations(U, r, spread(np.flatnonzero(~out), CONDITIONED))
    edge = np.clip(U[out], known.U.min(axis=0), known.U.max(axis=0))
    z = _mean(Posterior(model, known, CoefficientPrior.flat(0)), edge)
    return float(np.clip(z @ r[out] / max(float(z @ z), 1e-300), 0.0, 1.0))


def _mean(posterior: Posterior, U: np.ndarray) -> np.ndarray:
    """Return the mean of Z at inputs (n, d), (n,) [N m or N]."""
    rows = range(0, max(len(U), 1), _AT_ONCE)
    return np.concatenate([posterior.process_mean(U[i : i + _AT_ONCE])[:, 0] for i in rows])


def explained_share(
    model: Hyperparameters, U: np.ndarray, r: np.ndarray, part: np.ndarray
) -> float:
    """Return the share of r (N,) that Z at inputs U (N, d) explains on parts left out.

    Negative where it makes things worse, or where its noise is so small beside its signal that
    the covariance has no factor. `part` (N,) is the part of each row.
    """
    try:
        error = sum(_error(model, U, r, part == i) for i in range(PARTS))
    except NumericalError:
        return -math.inf
    return 1.0 - error / max(float(r @ r), 1e-300)


def _error(model: Hyperparameters, U: np.ndarray, r: np.ndarray, out: np.ndarray) -> float:
    """Return the sum of squared errors on the rows that are out."""
    known = observations(U, r, spread(np.flatnonzero(~out), CONDITIONED))
    there = U[out]
    found = Posterior(model, known, CoefficientPrior.flat(0))
    return float(((r[out] - _mean(found, there)) ** 2).sum())


def spread(rows: np.ndarray, count: int) -> np.ndarray:
    """Return at most `count` of the rows, evenly spread."""
    chosen = np.linspace(0, len(rows) - 1, min(count, len(rows)))
    return np.asarray(rows[np.unique(chosen.astype(int))])


def observations(U: np.ndarray, r: np.ndarray, rows: np.ndarray) -> Observations:
    """Return some rows of inputs U (N, d) and values r (N,), without physics."""
    return Observations(U[rows], np.zeros((len(rows), 1, 0)), r[rows, None])
