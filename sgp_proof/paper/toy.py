"""Section IV.A: the toy pendulum with a friction irregularity that the physics does not know."""

from __future__ import annotations

import numpy as np

from sgp_proof.paper.protocol import Test, World
from sgp_ros.gp.model import Observations

W = 9.81
"""True coefficient of `w sin(theta)` [rad/s^2]."""
BUMP, BUMP_FROM, BUMP_TO = -6.0, 2.0, 2.5
NOISE_STD = 0.3
DENSE, SPARSE = (0.0, np.pi), (-2.0, 0.0)
GRID = 200


def make_world(seed: int, dense: int = 150, sparse: int = 6) -> World:
    """Draw positions, densely in [0, pi] and sparsely in [-2, 0], and noisy accelerations.

    The paper gives the regions and the model, no numbers of samples and no noise; 150 and 6
    samples and a noise of 0.3 rad/s^2 are a choice.

    Args:
        seed: of the draw.
        dense: samples in [0, pi].
        sparse: samples in [-2, 0].
    """
    rng = np.random.default_rng((seed, dense, sparse))
    theta = np.concatenate([rng.uniform(*DENSE, size=dense), rng.uniform(*SPARSE, size=sparse)])
    tests = {
        'dense': _test(np.linspace(*DENSE, GRID), rng),
        'sparse': _test(np.linspace(*SPARSE, GRID), rng),
    }
    return World(_observe(theta, rng), tests, ('acceleration',), ((0,),), true_coefficients={0: W})


def true_acceleration(theta: np.ndarray) -> np.ndarray:
    """Return the acceleration with the irregularity, (n,) for positions (n,) [rad/s^2]."""
    inside = (theta >= BUMP_FROM) & (theta <= BUMP_TO)
    return W * np.sin(theta) + BUMP * inside


def _observe(theta: np.ndarray, rng: np.random.Generator) -> Observations:
    y = true_acceleration(theta) + NOISE_STD * rng.standard_normal(len(theta))
    return Observations(theta[:, None], np.sin(theta)[:, None, None], y[:, None])


def _test(theta: np.ndarray, rng: np.random.Generator) -> Test:
    return Test(_observe(theta, rng), true_acceleration(theta)[:, None])
