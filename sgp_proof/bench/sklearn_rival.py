"""The same process with scikit-learn: a refit with given hyper-parameters, the evidence, a fit."""

from __future__ import annotations

import numpy as np

try:
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel
except ImportError:
    GaussianProcessRegressor = None

from collections.abc import Callable

from sgp_proof.bench.problem import Problem

IS_INSTALLED = GaussianProcessRegressor is not None
_LIMITS = (1e-8, 1e8)


def _kernel(problem: Problem) -> object:
    return ConstantKernel(problem.variance, _LIMITS) * RBF(
        problem.lengthscales, _LIMITS
    ) + WhiteKernel(problem.noise, _LIMITS)


def step(problem: Problem) -> Callable[[], object]:
    """Return the work of one step: factor all samples but the last anew, predict at that."""
    regressor = GaussianProcessRegressor(_kernel(problem), alpha=0.0, optimizer=None)

    def work() -> object:
        regressor.fit(problem.U[:-1], problem.y[:-1])
        return regressor.predict(problem.U[-1:], return_std=True)

    return work


def evidence(problem: Problem) -> Callable[[], tuple[float, np.ndarray]]:
    """Return one evaluation of log evidence and gradient."""
    regressor = GaussianProcessRegressor(_kernel(problem), alpha=0.0, optimizer=None)
    regressor.fit(problem.U, problem.y)
    theta = regressor.kernel_.theta
    return lambda: regressor.log_marginal_likelihood(theta, eval_gradient=True)


def fitted(problem: Problem) -> tuple[float, tuple[float, ...], float]:
    """Return signal variance, length scales and noise of highest evidence from the given start."""
    regressor = GaussianProcessRegressor(_kernel(problem), alpha=0.0).fit(problem.U, problem.y)
    variance, *lengths, noise = np.exp(regressor.kernel_.theta)
    return float(variance), tuple(float(x) for x in lengths), float(noise)
