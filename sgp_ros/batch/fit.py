"""Identification from a whole recording: hyper-parameters from some rows, W and Z from all.

Hyper-parameters are learned by evidence on rows spread evenly over the data, since one evaluation
costs the cube of their number. With them fixed, all rows enter the posterior of W and Z
(`batch.posterior`), for every method.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from sgp_ros.batch.least_squares import autocorrelation
from sgp_ros.batch.posterior import BatchPosterior
from sgp_ros.batch.regression_data import FilteredData
from sgp_ros.errors import ConfigError, RecordingError
from sgp_ros.gp.linear_algebra import column_scale, svd
from sgp_ros.gp.methods import METHODS, FitOptions, Inputs
from sgp_ros.gp.model import CoefficientPrior, Model, Observations
from sgp_ros.gp.posterior import RANK_TOLERANCE, ZERO_COLUMN
from sgp_ros.robots.robot import Robot

FEWEST_ROWS = 10
"""Rows beyond the coefficients per joint without which nothing is fitted."""
_GAP = 10.0
"""Factor on both sides of the rank's tolerance within which no singular value is believed."""


@dataclass(frozen=True, slots=True)
class OfflineOptions:
    """How a recording is fitted.

    Attributes:
        max_points: most rows from which hyper-parameters are learned.
        max_basis: most basis functions of the Z of a joint.
        has_flat_prior: whether the robot's prior of W is set aside.
        learning: starts of the hyper-parameters.
    """

    max_points: int = 600
    max_basis: int = 600
    has_flat_prior: bool = False
    learning: FitOptions = field(default_factory=FitOptions)


@dataclass(frozen=True, slots=True, eq=False)
class FittedCoefficients:
    """Estimate of W.

    Attributes:
        names: of the p coefficients; none for GP.
        mean: (p,) [unit of each].
        covariance: (p, p), with the correlation of the residual in time.
        white_covariance: (p, p), had the residual been white.
        is_identifiable: (p,) of bool; the spread of one that is not means nothing.
    """

    names: tuple[str, ...]
    mean: np.ndarray
    covariance: np.ndarray
    white_covariance: np.ndarray
    is_identifiable: np.ndarray

    @property
    def std(self) -> np.ndarray:
        """Standard deviations, (p,); infinite for what is not identifiable."""
        return np.where(self.is_identifiable, np.sqrt(np.diag(self.covariance)), np.inf)


@dataclass(frozen=True, slots=True, eq=False)
class OfflineFit:
    """A robot identified from a recording.

    Attributes:
        method: a key of `gp.methods.METHODS`.
        physics: posterior of W, with Z for SGP; None for GP.
        process: posterior of Z on top of it, for GP and PRGP.
        coefficients: what was found out about W.
        log_evidence: of the last stage on the rows `points` [nat].
        points: rows from which hyper-parameters were learned.
        residual_autocorrelation: (k,) of what the fit leaves, from row to row [1].
        effective_rows: (k,) independent rows that would tell as much of a mean.
    """

    method: str
    physics: BatchPosterior | None
    process: BatchPosterior | None
    coefficients: FittedCoefficients
    log_evidence: float
    points: np.ndarray
    residual_autocorrelation: np.ndarray
    effective_rows: np.ndarray

    @property
    def model(self) -> Model:
        """Hyper-parameters of the stage that holds Z, or of PR."""
        stage = self.process or self.physics
        assert stage is not None
        return stage.model

    def predict(self, data: FilteredData) -> tuple[np.ndarray, np.ndarray]:
        """Return mean (n, k) and variance (n, k) of the target `data.y`, noise included.

        PRGP adds the means; its variance is that of the process alone, since the second step
        takes the coefficients of the first for known.
        """
        if self.process is None:
            assert self.physics is not None
            return self.physics.predict(data.U, data.F)
        mean, variance = self.process.predict(data.U, data.F[:, :, :0])
        if self.physics is not None:
            mean = mean + data.F @ self.physics.coefficients
        return mean, variance


def fit_offline(
    data: FilteredData,
    robot: Robot,
    method: str = 'SGP',
    inputs: Inputs | None = None,
    options: OfflineOptions | None = None,
) -> OfflineFit:
    """Identify a robot from filtered data.

    Args:
        data: n rows, thinned out until the residual is white, as far as that is possible.
        robot: with its prior of W.
        method: PR, GP, PRGP or SGP.
        inputs: per joint the columns of U that Z sees, as `Robot.residual_columns` resolves them,
            None for a joint without Z; None for the robot's own choice.
        options: as usual where None.

    Raises:
        ConfigError: a method or input that does not exist.
        RecordingError: too few rows.
        NumericalError: hyper-parameters cannot be learned.
    """
    options = options or OfflineOptions()
    if method not in METHODS:
        raise ConfigError(f'method {method!r}', f'one of {list(METHODS)}')
    n, k, p = data.F.shape
    if n * k < p + k * FEWEST_ROWS:
        raise RecordingError(
            f'{n} filtered rows for {p} coefficients',
            f'at least {-(-p // k) + FEWEST_ROWS}',
            'use a longer recording with more motion, or a higher cut-off',
        )
    inputs = inputs or robot.residual_columns(('default',))
    prior = prior_of(robot, is_flat=options.has_flat_prior)
    whole = Observations(data.U, data.F, data.y)
    points = np.unique(np.linspace(0, n - 1, min(options.max_points, n)).astype(int))
    few = _rows(whole, points), prior
    if method == 'SGP':  # the others learn with W alone, or without it
        few = on_determined(*few)
    learned = METHODS[method](*few, inputs, options.learning)
    physics, process, residual = None, None, whole
    limit = options.max_basis
    if learned.physics is not None:
        physics = BatchPosterior(learned.physics.model, whole, prior, data.block, limit)
    if learned.process is not None:
        explained = 0.0 if physics is None else data.F @ physics.coefficients
        residual = Observations(whole.U, data.F[:, :, :0], data.y - explained)
        flat = CoefficientPrior.flat(0)
        process = BatchPosterior(learned.process.model, residual, flat, data.block, limit)
    last = process or physics
    assert last is not None
    return OfflineFit(
        method,
        physics,
        process,
        _coefficients(robot, physics),
        learned.log_evidence,
        points,
        autocorrelation(last.residual(residual), data.block, 1),
        n / last.rows_per_free_row,
    )


def prior_of(robot: Robot, *, is_flat: bool = False) -> CoefficientPrior:
    """Return the robot's prior of W, or the one that knows nothing."""
    if is_flat:
        return CoefficientPrior.flat(len(robot.coefficients))
    mean = np.array([c.prior_mean for c in robot.coefficients])
    return CoefficientPrior.from_std(mean, np.array([c.prior_std for c in robot.coefficients]))


def on_determined(
    data: Observations, prior: CoefficientPrior
) -> tuple[Observations, CoefficientPrior]:
    """Return the regression on what rows and prior determine of W, as r coefficients of p.

    Whatever the covariance K = L L^T, the rows of L^-1 F span what those of F span. So
    W = S^-1 V x with the column scale S of `gp.posterior`, and V (p, r) an orthonormal basis of
    the rows of F S^-1 and of the prior: the evidence, taken over the determined directions, stays
    the same to rounding, and each evaluation costs what r columns cost. Data without a clear gap
    between information and rounding stay as they are.

    Args:
        data: n rows, directly observed.
        prior: of p coefficients.
    """
    p = prior.size
    scale = column_scale(data.F, prior.root)
    rows = np.vstack([data.F.reshape(-1, p), prior.root]) / scale
    rows[:, scale <= ZERO_COLUMN * scale.max(initial=0.0)] = 0.0
    size, Vt = svd(np.asarray(np.linalg.qr(rows, mode='r')))[1:]
    share = size / size.max(initial=np.finfo(float).tiny)
    is_clear = (share > _GAP * RANK_TOLERANCE) | (share < RANK_TOLERANCE / _GAP)
    V = Vt[: int((share > RANK_TOLERANCE).sum())].T
    if not is_clear.all() or V.shape[1] == p:
        return data, prior
    into = V / scale[:, None]
    seen = Observations(data.U, data.F @ into, data.y)
    return seen, CoefficientPrior(prior.root @ into, prior.target, prior.log_det)


def _rows(data: Observations, rows: np.ndarray) -> Observations:
    return Observations(data.U[rows], data.F[rows], data.y[rows])


def _coefficients(robot: Robot, physics: BatchPosterior | None) -> FittedCoefficients:
    if physics is None:
        none = np.zeros((0, 0))
        return FittedCoefficients((), np.zeros(0), none, none, np.zeros(0, dtype=bool))
    return FittedCoefficients(
        tuple(c.name for c in robot.coefficients),
        physics.coefficients,
        physics.covariance,
        physics.white_covariance,
        physics.is_identifiable,
    )
