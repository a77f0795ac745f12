"""The rivals on the same process as ours: scikit-learn, and GPyTorch exact by Cholesky."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol, TypeAlias

import numpy as np
from scipy import optimize

from sgp_proof.bench.problem import Problem, least_seconds

try:
    import gpytorch
    import torch
except ImportError:
    gpytorch = None
try:
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel
except ImportError:
    GaussianProcessRegressor = None

Rivals: TypeAlias = 'Mapping[str, Rival | None]'
Evaluation: TypeAlias = Callable[[], tuple[float, np.ndarray]]
_LIMITS = (1e-8, 1e8)


class Rival(Protocol):
    """Common interface of the rivals."""

    def step(self, problem: Problem) -> Callable[[], object]:
        """Return the work of one step at the last sample of a problem."""

    def evidence(self, problem: Problem) -> Evaluation:
        """Return one evaluation of log evidence and gradient by its own parameters."""

    def fitted(self, problem: Problem) -> tuple[float, tuple[float, ...], float]:
        """Return signal variance, length scales and noise of highest evidence from the start."""


class ScikitLearn:
    """A refit with given hyper-parameters, the evidence, a fit."""

    def step(self, problem: Problem) -> Callable[[], object]:
        """Factor all samples but the last anew, predict at that."""
        regressor = GaussianProcessRegressor(_kernel(problem), alpha=0.0, optimizer=None)

        def work() -> object:
            regressor.fit(problem.U[:-1], problem.y[:-1])
            return regressor.predict(problem.U[-1:], return_std=True)

        return work

    def evidence(self, problem: Problem) -> Evaluation:
        """Evaluate by the log of the hyper-parameters."""
        regressor = GaussianProcessRegressor(_kernel(problem), alpha=0.0, optimizer=None)
        regressor.fit(problem.U, problem.y)
        theta = regressor.kernel_.theta
        return lambda: regressor.log_marginal_likelihood(theta, eval_gradient=True)

    def fitted(self, problem: Problem) -> tuple[float, tuple[float, ...], float]:
        """Fit with its own optimiser."""
        regressor = GaussianProcessRegressor(_kernel(problem), alpha=0.0)
        regressor.fit(problem.U, problem.y)
        variance, *lengths, noise = np.exp(regressor.kernel_.theta)
        return float(variance), tuple(float(x) for x in lengths), float(noise)


class GPyTorch:
    """A fantasy update, the evidence, a fit."""

    def step(self, problem: Problem) -> Callable[[], object]:
        """Condition on the last sample, predict there; nothing is dropped."""
        model = _model(problem).train(mode=False)
        U, y = model.rest
        with torch.no_grad(), _exact():
            model(U).variance  # noqa: B018 - the first prediction factors what later ones reuse

        def work() -> object:
            with torch.no_grad(), _exact():
                prediction = model.get_fantasy_model(U, y)(U)
                return prediction.mean, prediction.variance

        return work

    def evidence(self, problem: Problem) -> Evaluation:
        """Evaluate by its raw parameters."""
        return _evaluation(_model(problem), problem)

    def fitted(self, problem: Problem) -> tuple[float, tuple[float, ...], float]:
        """Fit by L-BFGS-B."""
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


RIVALS: dict[str, Rival | None] = {
    'gpytorch': None if gpytorch is None else GPyTorch(),
    'sklearn': None if GaussianProcessRegressor is None else ScikitLearn(),
}
"""None for those that are not installed."""


def timed(
    name: str, ours: float, repeats: int, theirs: Callable[[], object] | None
) -> dict[str, Any]:
    """Return the time of a rival's work [ms] and how many times faster ours [s] is."""
    if theirs is None:
        return {f'{name}_ms': None, f'times_faster_{name}': None}
    seconds = least_seconds(theirs, repeats)
    return {f'{name}_ms': 1e3 * seconds, f'times_faster_{name}': seconds / ours}


def _kernel(problem: Problem) -> object:
    return ConstantKernel(problem.variance, _LIMITS) * RBF(
        problem.lengthscales, _LIMITS
    ) + WhiteKernel(problem.noise, _LIMITS)


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


def _evaluation(model: Any, problem: Problem) -> Evaluation:
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
