"""Laws of the regulator."""

from __future__ import annotations

import numpy as np

from sgp_ros.simulation.balance import discrete_regulator


def test_double_integrator_regulator_has_no_cheaper_neighbour():
    """Of all linear gains the Riccati gain costs least from any start: perturb and compare."""
    A, B = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]])
    Q, R, period = np.diag([1.0, 0.1]), np.array([[0.5]]), 0.1
    Ad = np.array([[1.0, period], [0.0, 1.0]])
    Bd = np.array([[0.5 * period**2], [period]])

    def cost(gain):
        x, total = np.array([1.0, -0.5]), 0.0
        for _ in range(600):
            u = -gain @ x
            total += x @ Q @ x + u @ R @ u
            x = Ad @ x + Bd @ u
        return total

    best = discrete_regulator(A, B, Q, R, period)
    for change in np.random.default_rng(0).normal(size=(20, 1, 2)):
        assert cost(best) < cost(best + 0.01 * change)
