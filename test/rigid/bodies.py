"""Random bodies, as clouds of mass points: consistent by construction."""

from __future__ import annotations

import numpy as np


def cloud(rng, points=6):
    """Return masses (points,) and places (points, 3) of a body, kilograms and decimetres."""
    return rng.uniform(0.1, 1.0, size=points), 0.2 * rng.normal(size=(points, 3))


def parameters_of(masses, places):
    """Return the ten inertial parameters of mass points about the origin, from the definition."""
    tensor = sum(
        m * ((x @ x) * np.eye(3) - np.outer(x, x)) for m, x in zip(masses, places, strict=True)
    )
    return np.concatenate(
        [[masses.sum()], masses @ places, tensor[[0, 1, 1, 2, 2, 2], [0, 0, 1, 0, 1, 2]]]
    )


def random_body(seed):
    """Return ten parameters of a body."""
    return parameters_of(*cloud(np.random.default_rng(seed)))
