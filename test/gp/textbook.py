"""A dense implementation of equations (8)-(20), written for the tests alone."""

from __future__ import annotations

import numpy as np


def kernel(u, v, variance, lengthscales):
    """Equation (4) for one component, one pair of inputs."""
    P = np.diag(np.square(lengthscales))
    return variance * np.exp(-(u - v) @ np.linalg.inv(P) @ (u - v) / 2)


def kappa(u, v, kernels):
    """Diagonal matrix of covariances of Z."""
    values = [
        0.0
        if k is None
        else kernel(u[list(k.inputs)], v[list(k.inputs)], k.variance, k.lengthscales)
        for k in kernels
    ]
    return np.diag(values)


def dense(model, data, mu, sigma_w, queries, regressors):
    """Return mean, covariance of X at the queries and log N(y; E[Y], sigma_dd)."""
    n, k, _ = data.F.shape
    G = np.broadcast_to(np.eye(k), (n, k, k)) if data.G is None else data.G
    sigma_v = np.diag(model.noise)
    y = data.y.ravel()
    expected = np.concatenate([G[i] @ data.F[i] @ mu for i in range(n)])
    m = len(sigma_v)
    sigma_dd = np.zeros((n * m, n * m))
    for i in range(n):
        for j in range(n):
            covariance = data.F[i] @ sigma_w @ data.F[j].T
            covariance = covariance + kappa(data.U[i], data.U[j], model.kernels)
            block = G[i] @ covariance @ G[j].T + (sigma_v if i == j else 0)
            sigma_dd[i * m : (i + 1) * m, j * m : (j + 1) * m] = block
    means, covariances = [], []
    for q, f in zip(queries, regressors, strict=True):
        sigma_qd = np.hstack(
            [
                (f @ sigma_w @ data.F[j].T + kappa(q, data.U[j], model.kernels)) @ G[j].T
                for j in range(n)
            ]
        )
        gain = sigma_qd @ np.linalg.inv(sigma_dd)
        means.append(f @ mu + gain @ (y - expected))
        sigma_qq = f @ sigma_w @ f.T + kappa(q, q, model.kernels)
        covariances.append(sigma_qq - gain @ sigma_dd @ gain.T)
    _, log_det = np.linalg.slogdet(sigma_dd)
    residual = y - expected
    log_density = -0.5 * (
        residual @ np.linalg.solve(sigma_dd, residual) + log_det + len(y) * np.log(2 * np.pi)
    )
    return np.array(means), np.array(covariances), log_density
