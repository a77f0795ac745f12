"""Balancing of the reaction wheel upright by a linear-quadratic regulator."""

from __future__ import annotations

import numpy as np
from scipy import linalg

from sgp_ros.simulation.controllers import Controller
from sgp_ros.simulation.mechanism import Mechanism

_STATE_COST = (100.0, 1.0, 1e-3)
_COMMAND_COST = 0.1


def discrete_regulator(
    A: np.ndarray, B: np.ndarray, Q: np.ndarray, R: np.ndarray, period_s: float
) -> np.ndarray:
    """Return the gain K (m, n) of `command = -K x`, with the command held for `period_s`.

    The held system is exact (matrix exponential); K solves the discrete Riccati equation.

    Args:
        A: (n, n) of `dx/dt = A x + B command`.
        B: (n, m).
        Q: (n, n) cost of the state.
        R: (m, m) cost of the command.
        period_s: sampling period [s].
    """
    n, m = B.shape
    joint = np.zeros((n + m, n + m))
    joint[:n] = np.hstack([A, B])
    held = linalg.expm(joint * period_s)
    Ad, Bd = held[:n, :n], held[:n, n:]
    S = linalg.solve_discrete_are(Ad, Bd, Q, R)
    gain: np.ndarray = np.linalg.solve(R + Bd.T @ S @ Bd, Bd.T @ S @ Ad)
    return gain


def balance(mechanism: Mechanism, _rng: np.random.Generator, period_s: float) -> Controller | None:
    """Build the regulator of pole angle, pole velocity and wheel velocity about upright."""
    w = {c.name: c.value for c in mechanism.coefficients()}
    A = np.array([[0.0, 1.0, 0.0], [w['w1'], w['w3'], w['w4']], [w['w5'], w['w7'], w['w8']]])
    B = np.array([[0.0], [w['w9']], [w['w10']]])
    cost = np.diag(_STATE_COST), np.array([[_COMMAND_COST]])
    gain = discrete_regulator(A, B, *cost, period_s)
    return lambda _t, q, v: -gain @ np.array([q[0], v[0], v[1]])
