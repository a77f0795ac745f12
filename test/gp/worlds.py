"""Small random problems that the tests of `core` share."""

from __future__ import annotations

import numpy as np

from sgp_ros.gp.kernels import SquaredExponential
from sgp_ros.gp.model import CoefficientPrior, Model, Observations


def random_problem(seed, n=12, k=2, p=3, d=3, gain=None, noise_like=None):
    """Return a model and observations; `gain` is the number of outputs of g(u), None for none."""
    rng = np.random.default_rng(seed)
    U = rng.normal(size=(n, d))
    F = rng.normal(size=(n, k, p))
    m = k if gain is None else gain
    G = None if gain is None else rng.normal(size=(n, m, k))
    y = rng.normal(size=(n, m))
    kernels = tuple(
        SquaredExponential(
            float(rng.uniform(0.5, 2.0)),
            tuple(rng.uniform(0.5, 2.0, size=2)),
            (j % d, (j + 1) % d),
        )
        for j in range(k)
    )
    if noise_like == 'parametric':
        kernels = (None,) * k
    return Model(kernels, tuple(rng.uniform(0.1, 0.5, size=m))), Observations(U, F, y, G)


def plane(seed, n, noise):
    """Return model, prior, W and n samples that cross a plane, so that Z needs many features."""
    kernel = SquaredExponential(1.0, (0.5, 0.5), (0, 1))
    rng = np.random.default_rng(seed)
    t = np.arange(n)
    start = rng.uniform(0.0, 6.0)
    U = np.stack([2.0 * np.sin(t / 15.4 + start), 1.3 * np.cos(t / 9.8)], axis=1)
    values, vectors = np.linalg.eigh(kernel.matrix(U))
    z = vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.normal(size=n))
    F = np.stack([np.ones(n), U[:, 0], rng.normal(size=n)], axis=1)[:, None]
    w = rng.normal(size=3)
    y = F[:, 0] @ w + z + np.sqrt(noise) * rng.normal(size=n)
    prior = CoefficientPrior.from_std(np.zeros(3), np.ones(3))
    return Model((kernel,), (noise,)), prior, w, Observations(U, F, y[:, None])


def returning(seed, n=700):
    """Return model, prior, W and n samples of a robot that comes by each place every 50 or so."""
    kernel = SquaredExponential(1.0, (0.5,), (0,))
    grid = np.linspace(-2.0, 2.0, 40)[:, None]
    K = kernel.matrix(grid) + 1e-9 * np.eye(40)
    rng = np.random.default_rng(seed)
    U = 2.0 * np.sin(2 * np.pi * np.arange(n) / 97.0 + rng.uniform(0.0, 6.0))[:, None]
    F = np.stack([np.ones(n), U[:, 0], rng.normal(size=n)], axis=1)[:, None]
    w = rng.normal(size=3)
    z = np.linalg.solve(K, np.linalg.cholesky(K) @ rng.normal(size=40))
    y = F[:, 0] @ w + kernel.matrix(U, grid) @ z + np.sqrt(0.1) * rng.normal(size=n)
    prior = CoefficientPrior.from_std(np.zeros(3), np.ones(3))
    return Model((kernel,), (0.1,)), prior, w, Observations(U, F, y[:, None])
