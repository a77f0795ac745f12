"""Learning of hyper-parameters by maximum evidence (Wu and Movellan, section III.D).

The search stays in a box relative to the data. A covariance has a factor in double precision while
its noise stays above what rounding leaves in its largest entries: `noise >= n eps variance`
(Higham, Accuracy and Stability of Numerical Algorithms, 2002, section 10.1). A first box is small
enough for that at its every corner. Where the evidence still rises at the top of a variance, which
a function that is nearly constant, linear or a sum of its inputs makes it do, a second box opens
as far as the noise found allows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import optimize

from sgp_ros.errors import NumericalError
from sgp_ros.gp.kernel import Kernel
from sgp_ros.gp.kernels import SquaredExponential
from sgp_ros.gp.model import CoefficientPrior, Model, Observations
from sgp_ros.gp.posterior import Posterior

_NOISE_FLOOR = 1e-8
_NOISE_TOP = 1e2
_RANGE = 1e4
_TOUCHING = 1e-6


def search_box(data: Observations, start: Model) -> np.ndarray:
    """Return the least and largest logarithm of each hyper-parameter of `start`, (h, 2).

    Those of a kernel as far from their typical values as the kernel says, noise from 1e-8 to 1e2
    times the variance of the target.
    """
    power = variance_or_one(data.y)
    spread = np.sqrt(variance_or_one(data.U))
    rows: list[tuple[float, float]] = []
    for component, kernel in enumerate(start.kernels):
        if kernel is None:
            continue
        variance = power[component] if data.G is None else power.mean()
        scales = kernel.scales(float(variance), spread[list(kernel.inputs)])
        below, above = (
            kernel.spread_over((getattr(p, side) for p in kernel.parameters), len(kernel.inputs))
            for side in ('below', 'above')
        )
        rows += zip(scales / below, scales * above, strict=True)
    rows += [(_NOISE_FLOOR * x, _NOISE_TOP * x) for x in power]
    return np.log(np.array(rows))


def opened_box(
    box: np.ndarray, best: np.ndarray, data: Observations, start: Model
) -> np.ndarray | None:
    """Return a higher box (h, 2) about `best` (h,); None where no variance touches the top.

    A linear function of an input whose length scale is 1e4 spreads has 1e8 times the variance of
    the target; so far the new box goes, with the mean square of the target in place of its
    variance, for Z has to explain the mean too. It ends where the noise of `best` would be lost
    in rounding, and its least noise is what the rounding of its tops leaves.
    """
    rounding = data.y.size * float(np.finfo(float).eps)
    square = np.maximum((data.y**2).mean(axis=0), variance_or_one(data.y))
    wider = box.copy()
    noise = len(best) - len(start.noise)
    is_open = False
    row = 0
    for component, kernel in enumerate(start.kernels):
        if kernel is None:
            continue
        seen = slice(component, component + 1) if data.G is None else slice(None)
        heights = row + np.flatnonzero(kernel.is_variance)
        row += len(kernel.values)
        if not np.any(best[heights] > box[heights, 1] - _TOUCHING):
            continue
        least_noise = best[noise:][seen].min()
        top = min(np.log(_RANGE**2 * square[seen].mean()), least_noise - np.log(rounding))
        wider[heights, 1] = np.maximum(box[heights, 1], top)
        lowest = wider[heights, 1].max() + np.log(rounding)
        noises = wider[noise:][seen]
        noises[:, 0] = np.clip(lowest, noises[:, 0], np.maximum(noises[:, 0], least_noise))
        is_open = True
    return wider if is_open else None


def variance_or_one(x: np.ndarray) -> np.ndarray:
    """Return the variances of the columns of x (n, d), one where there is none, (d,)."""
    variance = x.var(axis=0)
    return np.where(variance > 0.0, variance, 1.0)


RULES = ('paper', 'standardised')
"""How length scales start: at the variance of each input, as printed in the paper, or at its
standard deviation, which has the right unit and does not depend on the unit chosen."""

_RESTART_SPREAD = 1.5
_REFUSED = 1e25
TOLERANCE = 1e7 * float(np.finfo(float).eps)
"""Relative change of the evidence at which a search ends."""
_SCREENED_LENGTHS = (0.3, 1.0, 3.0)
_SCREENED_NOISE = (0.1, 1.0, 10.0)


@dataclass(frozen=True, slots=True, eq=False)
class LearnedModel:
    """Result of a fit.

    Attributes:
        model: the hyper-parameters of the best start.
        log_evidence: at these [nat].
        evaluations: of evidence and gradient, over all starts.
        refused: starts that ended without a positive definite covariance.
    """

    model: Model
    log_evidence: float
    evaluations: int
    refused: int


def initial_model(
    data: Observations,
    inputs: tuple[tuple[int, ...] | None, ...],
    rule: str = 'standardised',
    kernel: type[Kernel] = SquaredExponential,
) -> Model:
    """Return the values from which learning starts.

    `sigma_z` is the sample variance of the target, `sigma_v` a hundredth of it. With an
    observation matrix the mean variance of the observations serves for every component of X.

    Args:
        data: observations, at least two.
        inputs: per component of X the columns of U its Z sees; None for no Z.
        rule: one of `RULES`.
        kernel: of each Z.
    """
    if rule not in RULES:
        raise ValueError(f'rule {rule!r} is none of {RULES}')
    power = variance_or_one(data.y)
    spread = variance_or_one(data.U)
    if rule == 'standardised':
        spread = np.sqrt(spread)
    kernels: list[Kernel | None] = []
    for component, columns in enumerate(inputs):
        if columns is None:
            kernels.append(None)
            continue
        variance = power[component] if data.G is None else power.mean()
        scales = kernel.scales(float(variance), spread[list(columns)])
        kernels.append(kernel.of_values(scales, columns))
    return Model(tuple(kernels), tuple(float(x) / 100.0 for x in power))


def screened(data: Observations, prior: CoefficientPrior, start: Model) -> Model:
    """Return the best of a few variations of `start`: other length scales, other noise.

    The evidence has several maxima (a long length scale with much noise, a short one with little),
    and a first step of the optimiser from far away can end in a poor one. Nine evaluations.
    """
    best, highest = start, -np.inf
    for length in _SCREENED_LENGTHS:
        for noise in _SCREENED_NOISE:
            kernels = tuple(
                None if k is None else k.with_lengthscales(
                    tuple(length * x for x in k.lengthscales)
                )
                for k in start.kernels
            )  # fmt: skip
            candidate = Model(kernels, tuple(noise * x for x in start.noise))
            try:
                evidence = Posterior(candidate, data, prior).log_evidence
            except NumericalError:
                continue
            if evidence > highest:
                best, highest = candidate, evidence
    return best


def learn(
    data: Observations,
    prior: CoefficientPrior,
    start: Model,
    restarts: int = 0,
    rng: np.random.Generator | None = None,
    *,
    tolerance: float = TOLERANCE,
) -> LearnedModel:
    """Maximise the evidence from `start` and from `restarts` random perturbations of it.

    L-BFGS-B on the logarithms, with the analytic gradient, in a box relative to the data. Where
    the best point touches the top of a variance, the search goes on from there in a higher box
    (`gp/learning.py`): in one box of that height, trials without a factor end searches early.

    Raises:
        NumericalError: not one start led to a positive definite covariance.
        ValueError: restarts without a generator.
    """
    if restarts and rng is None:
        raise ValueError('restarts need a random generator')
    box = search_box(data, start)
    starts = [start.log_parameters]
    for _ in range(restarts):
        assert rng is not None
        starts.append(starts[0] + _RESTART_SPREAD * rng.standard_normal(len(starts[0])))
    search = _Search(data, prior, start, tolerance)
    for theta in starts:
        search.climb(theta, box)
    if search.best is None:
        raise NumericalError(
            f'no positive definite covariance in {len(starts)} starts of the fit',
            'distinct inputs and a target that varies',
            'check the recording for repeated or constant samples',
        )
    higher = opened_box(box, search.best, data, start)
    if higher is not None:
        search.climb(search.best, higher)
    model = start.with_log_parameters(search.best)
    return LearnedModel(model, -search.lowest, search.evaluations, search.refused)


class _Search:
    """The negative evidence as the optimiser sees it, remembering the best point."""

    def __init__(
        self, data: Observations, prior: CoefficientPrior, start: Model, tolerance: float
    ) -> None:
        self._data = data
        self._prior = prior
        self._start = start
        self._tolerance = tolerance
        self.best: np.ndarray | None = None
        self.lowest = np.inf
        self.evaluations = 0
        self.refused = 0

    def climb(self, theta: np.ndarray, box: np.ndarray) -> None:
        """Search from theta (h,) inside a box (h, 2)."""
        low, high = box.T
        optimize.minimize(
            self._objective, np.clip(theta, low, high), jac=True, method='L-BFGS-B', bounds=box,
            options={'ftol': self._tolerance},
        )  # fmt: skip

    def _objective(self, theta: np.ndarray) -> tuple[float, np.ndarray]:
        self.evaluations += 1
        try:
            model = self._start.with_log_parameters(theta)
            posterior = Posterior(model, self._data, self._prior)
        except NumericalError:
            self.refused += 1
            return self._wall(theta)
        value = -posterior.log_evidence
        if value < self.lowest:
            self.lowest = value
            self.best = theta.copy()
        return value, -posterior.evidence_gradient()

    def _wall(self, theta: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the value taken as the evidence where the covariance has no factor.

        A bowl about the best point: a line search that came from there is led back by a usable
        step. From a huge constant it would step back to where it started, and end there.
        """
        if self.best is None:
            return _REFUSED, np.zeros_like(theta)
        offset = theta - self.best
        height = 1.0 + abs(self.lowest)
        return self.lowest + height * (1.0 + 0.5 * float(offset @ offset)), height * offset
