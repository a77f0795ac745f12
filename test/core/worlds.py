"""Small random problems that the tests of `core` share."""

from __future__ import annotations

import numpy as np

from sgp_ros.core.kernels import SquaredExponential
from sgp_ros.core.model import Model, Observations


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
