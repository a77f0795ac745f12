"""The same process with GPyTorch, exact by Cholesky: a fantasy update, the evidence, a fit."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import optimize

try:
    import gpytorch
    import torch
except ImportError:
    gpytorch = None

from collections.abc import Callable

from sgp_proof.bench.problem import Problem

IS_INSTALLED = gpytorch is not None


def _exact() -> Any:
    return gpytorch.settings.fast_computations(
        covar_root_decomposition=False, log_prob=False, solves=False
    )


def _model(problem: Problem) -> Any:
    """Return an exact process; several outputs are a batch that shares the kernel."""
    torch.set_num_threads(1)
    outputs, inputs = problem.y.shape[1], problem.U.shape[1]

    class Process(gpytorch.models.ExactGP):  # type: ignore[misc]  # no types
        def __init__(self, U: Any, y: Any, likelihood: Any) -> None:
            super().__init__(U, y, likelihood)
            self.mean = gpytorch.means.ZeroMean()
            self.kernel = gpytorch.kernels.ScaleKernel(
                gpytorch.kernels.RBFKernel(ard_num_dims=inputs)
            )

        def forward(self, U: Any) -> Any:
            return gpytorch.distributions.MultivariateNormal(self.mean(U), self.kernel(U))

    U, y = torch.from_numpy(problem.U), torch.from_numpy(problem.y.T.copy())
    U, y = (U, y[0]) if outputs == 1 else (U.expand(outputs, *U.shape), y)
    likelihood = gpytorch.likelihoods.GaussianLikelihood(
        noise_constraint=gpytorch.constraints.GreaterThan(1e-8)
    )
    model = Process(U[..., :-1, :], y[..., :-1], likelihood).double()
    model.kernel.outputscale = problem.variance
    model.kernel.base_kernel.lengthscale = torch.tensor(
        [problem.lengthscales], dtype=torch.float64
    )
    likelihood.noise = problem.noise
    model.rest = (U[..., -1:, :], y[..., -1:])
    return model


def step(problem: Problem) -> Callable[[], object]:
    """Return the work of one step: condition on the last sample, predict there; drop nothing."""
    model = _model(problem).train(mode=False)
    U, y = model.rest
    with torch.no_grad(), _exact():
        model(U).variance  # noqa: B018 - the first prediction factors what later ones reuse

    def work() -> object:
        with torch.no_grad(), _exact():
            prediction = model.get_fantasy_model(U, y)(U)
            return prediction.mean, prediction.variance

    return work


def evidence(problem: Problem) -> Callable[[], tuple[float, np.ndarray]]:
    """Return one evaluation of log evidence and gradient by its own parameters."""
    return _evaluation(_model(problem), problem)


def _evaluation(model: Any, problem: Problem) -> Callable[[], tuple[float, np.ndarray]]:
    U, y = torch.from_numpy(problem.U), torch.from_numpy(problem.y[:, 0].copy())
    model.set_train_data(U, y, strict=False)
    model.train()
    marginal = gpytorch.mlls.ExactMarginalLogLikelihood(model.likelihood, model)

    def work() -> tuple[float, np.ndarray]:
        model.zero_grad()
        with _exact():
            value = marginal(model(U), y) * len(y)
            value.backward()
        return value.item(), np.concatenate([p.grad.ravel().numpy() for p in model.parameters()])

    return work


def fitted(problem: Problem) -> tuple[float, tuple[float, ...], float]:
    """Return signal variance, length scales and noise of highest evidence, by L-BFGS-B."""
    model = _model(problem)
    work = _evaluation(model, problem)
    parameters = list(model.parameters())
    sizes = np.cumsum([p.numel() for p in parameters])[:-1]

    def objective(theta: np.ndarray) -> tuple[float, np.ndarray]:
        for parameter, values in zip(parameters, np.split(theta, sizes), strict=True):
            parameter.data = torch.from_numpy(values.copy()).reshape(parameter.shape)
        value, gradient = work()
        return -value, -gradient

    start = np.concatenate([p.detach().ravel().numpy() for p in parameters])
    optimize.minimize(objective, start, jac=True, method='L-BFGS-B')
    lengths = model.kernel.base_kernel.lengthscale.detach().ravel()
    return (
        float(model.kernel.outputscale.detach()),
        tuple(float(x) for x in lengths),
        float(model.likelihood.noise.detach()[0]),
    )
