"""Output-error fit: the coefficients whose roll-outs stay closest to what was measured.

Inverse regression is biased where accelerations are noisy and the torque is a small difference of
inertia and gravity. A roll-out needs no acceleration: it starts at a measured state, integrates
the measured efforts, and leaves an error in positions. Minimising that over W is nonlinear
least squares; it starts from the regression and needs a start that does not diverge.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import optimize

from sgp_ros.batch.forward import Residual
from sgp_ros.batch.rollout import Windows, roll_out
from sgp_ros.errors import ConfigError, NumericalError
from sgp_ros.gp.linear_algebra import svd
from sgp_ros.physics.term import Motion
from sgp_ros.robots.robot import Robot

_ROUNDS = 3
"""Of weighting; the standard deviations of the second round change by percents in the third."""
_FARTHEST = 100.0
"""Where errors are cut, in standard deviations: a diverged roll-out costs this and no more."""
_DIFFERENCE = 1e-6
"""Step of the Jacobian's differences, in units of each coefficient."""
_TOLERANCE = 1e-6
"""Relative fall of the cost that ends a round."""
_SMALLEST_GAIN = 0.1
_UNDETERMINED = 1e-6


@dataclass(frozen=True, slots=True)
class RolloutFitOptions:
    """How roll-outs are fitted.

    Attributes:
        substeps: of the integrator in each step of the windows.
        compare_every: steps between the positions that are compared.
        lower: smallest value of coefficients by name [unit of the coefficient]: 0 for masses,
            inertias and friction.
        free_gains: joints, by name, whose effort is multiplied by a factor that is found too.
            Of a robot with target `effort` one joint must keep its gain: a factor of all efforts
            is a factor of all coefficients.
        loss: `linear` for least squares; `soft_l1` gives the roll-outs that are farthest off less
            weight.
        evaluations: of all roll-outs at most, in each round, Jacobians not counted.
    """

    substeps: int = 1
    compare_every: int = 5
    lower: Mapping[str, float] | None = None
    free_gains: Sequence[str] = ()
    loss: str = 'linear'
    evaluations: int = 40


@dataclass(frozen=True, slots=True, eq=False)
class RolloutFit:
    """Result of a fit by m roll-outs.

    Attributes:
        W: coefficients, (p,).
        gains: factors of the efforts, (k,); 1 where not free.
        covariance: of W and the free gains, (p + g, p + g): sandwich over blocks of roll-outs,
            whose errors are taken as independent. Not numbers where there are no more blocks
            than coefficients.
        error_std: standard deviation of the position errors, (k,) [rad or m].
        diverged: roll-outs that leave the range of numbers at the solution.
        cost: half the sum of squared errors in standard deviations.
        is_converged: whether the search ended before its evaluations did.
    """

    W: np.ndarray
    gains: np.ndarray
    covariance: np.ndarray
    error_std: np.ndarray
    diverged: int
    cost: float
    is_converged: bool

    @property
    def std(self) -> np.ndarray:
        """Standard deviations of W, (p,) [unit of each coefficient]."""
        return np.sqrt(np.diag(self.covariance)[: len(self.W)])


def fit_rollouts(
    windows: Windows,
    robot: Robot,
    start: np.ndarray,
    options: RolloutFitOptions | None = None,
    residual: Residual | None = None,
) -> RolloutFit:
    """Minimise the position errors of roll-outs, whitened per joint, over W.

    Trust-region least squares within bounds (Branch, Coleman, Li 1999), repeated with the standard
    deviation of each joint's errors as its unit. O(p) roll-outs of all windows an iteration.

    Args:
        windows: m roll-outs of n steps.
        robot: physics of k joints, linear in W.
        start: (p,) coefficients to start from, such as those of a regression.
        options: None for the defaults.
        residual: mean of Z from q and v [unit of the target], held fixed.

    Raises:
        ConfigError: bounds or gains of what the robot does not have, or gains of all joints.
        NumericalError: every roll-out diverges at the start, or the windows do not determine the
            coefficients.
    """
    search = _Search(windows, robot, options or RolloutFitOptions(), residual)
    theta = np.maximum(np.append(start, np.ones(len(search.free))), search.lower)
    std = search.error_std(theta)
    for _ in range(_ROUNDS):
        found = optimize.least_squares(
            search.errors, theta, search.jacobian, args=(std,), bounds=(search.lower, np.inf),
            x_scale=search.unit, ftol=_TOLERANCE, loss=search.options.loss,
            max_nfev=search.options.evaluations,
        )  # fmt: skip
        theta, std = found.x, search.error_std(found.x)
    position = search.position_errors(theta)
    return RolloutFit(
        W=theta[: search.p],
        gains=search.gains(theta),
        covariance=_sandwich(found.jac, found.fun, windows.block),
        error_std=std,
        diverged=int(np.sum(~np.isfinite(position).all(axis=(1, 2)))),
        cost=float(found.cost),
        is_converged=bool(found.status > 0),
    )


class _Search:
    """The errors as the optimiser sees them: of `theta`, which is W and then the free gains."""

    def __init__(
        self,
        windows: Windows,
        robot: Robot,
        options: RolloutFitOptions,
        residual: Residual | None,
    ) -> None:
        self._windows = windows
        self._robot = robot
        self._residual = residual
        self.options = options
        names = [c.name for c in robot.coefficients]
        self.free = [robot.joint_names.index(j) for j in _known(options.free_gains, robot)]
        self.p = len(names)
        self.lower = np.full(self.p + len(self.free), -np.inf)
        for name, value in (options.lower or {}).items():
            if name not in names:
                raise ConfigError(f'lower bound of {name!r}', f'some of {names}')
            self.lower[names.index(name)] = value
        self.lower[self.p :] = _SMALLEST_GAIN
        self.unit = np.append(_units(windows, robot), np.ones(len(self.free)))

    def gains(self, theta: np.ndarray) -> np.ndarray:
        gains = np.ones(len(self._robot.joints))
        gains[self.free] = theta[self.p :]
        return gains

    def position_errors(self, theta: np.ndarray) -> np.ndarray:
        """Errors at the compared steps, (m, n', k); not numbers where a roll-out diverged."""
        w, every = self._windows, self.options.compare_every
        steps = np.arange(w.effort.shape[1], 0, -every)[::-1]  # the end always
        q, _ = roll_out(
            self._robot, theta[: self.p], w.q[:, 0], w.v[:, 0], self.gains(theta) * w.effort,
            w.step, self.options.substeps, self._residual,
        )  # fmt: skip
        return q[:, steps] - w.q[:, steps]

    def errors(self, theta: np.ndarray, std: np.ndarray) -> np.ndarray:
        """Errors in standard deviations, cut where a roll-out diverged, (m n' k,)."""
        errors = self.position_errors(theta) / std
        return np.clip(np.nan_to_num(errors, nan=_FARTHEST), -_FARTHEST, _FARTHEST).ravel()

    def jacobian(self, theta: np.ndarray, std: np.ndarray) -> np.ndarray:
        """Forward differences of `errors`, (m n' k, p + g)."""
        base = self.errors(theta, std)
        columns = []
        for j, step in enumerate(_DIFFERENCE * self.unit):
            moved = theta.copy()
            moved[j] += step
            columns.append((self.errors(moved, std) - base) / (moved[j] - theta[j]))
        return np.stack(columns, axis=1)

    def error_std(self, theta: np.ndarray) -> np.ndarray:
        """Root mean squared errors of the roll-outs that stay finite, (k,)."""
        errors = self.position_errors(theta)
        stays = np.isfinite(errors).all(axis=(1, 2))
        if not stays.any():
            raise NumericalError(
                f'all {len(errors)} roll-outs diverge',
                'coefficients of a stable robot to start from',
                'shorten the horizon or start from other coefficients',
            )
        return np.sqrt(np.mean(errors[stays] ** 2, axis=(0, 1))) + np.finfo(float).tiny


def _units(windows: Windows, robot: Robot) -> np.ndarray:
    """Size of each coefficient that alone would explain the efforts, (p,)."""
    v = windows.v[:, :-1]
    motion = Motion(
        *(
            x.reshape(-1, v.shape[2])
            for x in (
                windows.q[:, :-1],
                v,
                np.diff(windows.v, axis=1) / windows.step,
                windows.effort,
            )
        )
    )
    column = np.sqrt(np.mean(robot.regressor(motion) ** 2, axis=(0, 1)))
    target = motion.effort if robot.target == 'effort' else motion.acceleration
    size = np.sqrt(np.mean(target**2))
    return np.where((column > 0.0) & (size > 0.0), size / np.where(column > 0.0, column, 1.0), 1.0)


def _known(joints: Sequence[str], robot: Robot) -> Sequence[str]:
    scale_free = robot.target == 'effort' and set(joints) >= set(robot.joint_names)
    if scale_free or not set(joints) <= set(robot.joint_names):
        raise ConfigError(
            f'free gains of joints {list(joints)}',
            f'some of {list(robot.joint_names)}, not all of them for a target of effort',
        )
    return joints


def _sandwich(jacobian: np.ndarray, errors: np.ndarray, block: np.ndarray) -> np.ndarray:
    """Covariance `H^-1 S H^-1`: curvature H, and S of the scores summed over each block.

    Huber 1967; Liang and Zeger 1986 for sums over clusters.
    """
    m, size = len(block), jacobian.shape[1]
    scores = (jacobian * errors[:, None]).reshape(m, -1, size).sum(axis=1)  # (m, size)
    labels, members = np.unique(block, return_inverse=True)
    sums = np.zeros((len(labels), size))
    np.add.at(sums, members, scores)
    unit = np.sqrt(np.sum(jacobian**2, axis=0))
    _, singular, basis = svd(jacobian / np.where(unit > 0.0, unit, 1.0))
    if singular[-1] <= _UNDETERMINED * singular[0]:
        raise NumericalError(
            'roll-outs that do not determine all coefficients',
            'a motion that excites each of them',
            'drop terms of the robot, or fix a gain',
        )
    inverse = (basis.T / singular**2) @ basis / np.outer(unit, unit)
    if len(labels) <= size:
        return np.full((size, size), np.nan)
    correction = len(labels) / (len(labels) - 1)
    return correction * inverse @ (sums.T @ sums) @ inverse
