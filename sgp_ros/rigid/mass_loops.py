"""Compiled mass matrix of a kinematic tree by composite bodies.

All bodies beyond a joint move with it as one: mass m, first moment h and moment of inertia I about
the origin of the joint, in its axes, to which those of the bodies beyond are added. A unit motion
of the joint, turning w or sliding s, takes the force `m s + w x h` and the moment `h x s + I w`;
handed down to the root, it is felt by every joint on the way along the motion that this one
permits. A joint that nothing resists has an inertia of zero, without rounding. No function of
another module is called, because the cache of compiled code watches this one alone.

Source: Featherstone 2008, Rigid Body Dynamics Algorithms, section 6.2.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit

from sgp_ros.rigid.rigid_geometry import Geometry

_compiled: Callable[[Any], Any] = njit(cache=True, error_model='numpy')


@_compiled
def fill_mass(g: Geometry, q: np.ndarray, parameters: np.ndarray, M: np.ndarray) -> None:
    """Add the mass matrices (n, k, k) of positions (n, b) to `M`."""
    b = len(g.order)
    turn, place = np.zeros((b, 3, 3)), np.zeros((b, 3))
    composite, wrench = np.zeros((b + 1, 10)), np.zeros(6)
    for sample in range(len(q)):
        composite[:b], composite[b] = parameters, 0.0
        for i in g.order[::-1]:
            _place(g, q[sample, i], i, turn[i], place[i])
            _add_body(composite[i], turn[i], place[i], composite[g.parents[i]])
        for i in g.order:
            _unit_wrench(g, i, composite[i], wrench)
            row, j = g.rows[i], i
            while j < b:
                felt = 0.0
                first = 0 if g.slidings[j] else 3
                for t in range(3):
                    felt += g.axes[j, t] * wrench[first + t]
                felt *= g.gains[i] * g.gains[j]
                M[sample, g.rows[j], row] += felt
                if j != i:
                    M[sample, row, g.rows[j]] += felt
                _hand_down(turn[j], place[j], wrench)
                j = g.parents[j]


@_compiled
def _place(g: Geometry, q: float, i: int, turn: np.ndarray, place: np.ndarray) -> None:
    """Set rotation and origin of body i in the frame of the body it hangs on."""
    s, c = (0.0, 0.0) if g.slidings[i] else (np.sin(q), 1.0 - np.cos(q))
    for t in range(3):
        place[t] = g.starts[i, t] + q * g.slides[i, t]
        for u in range(3):
            turn[t, u] = g.turns[i, 0, t, u] + s * g.turns[i, 1, t, u] + c * g.turns[i, 2, t, u]


@_compiled
def _hand_down(turn: np.ndarray, place: np.ndarray, wrench: np.ndarray) -> None:
    """Turn force and moment (6,) of a body into those of the body it hangs on, in its frame."""
    a, b, c, d, e, f = wrench
    fx = turn[0, 0] * a + turn[0, 1] * b + turn[0, 2] * c
    fy = turn[1, 0] * a + turn[1, 1] * b + turn[1, 2] * c
    fz = turn[2, 0] * a + turn[2, 1] * b + turn[2, 2] * c
    x, y, z = place
    wrench[0], wrench[1], wrench[2] = fx, fy, fz
    wrench[3] = turn[0, 0] * d + turn[0, 1] * e + turn[0, 2] * f + y * fz - z * fy
    wrench[4] = turn[1, 0] * d + turn[1, 1] * e + turn[1, 2] * f + z * fx - x * fz
    wrench[5] = turn[2, 0] * d + turn[2, 1] * e + turn[2, 2] * f + x * fy - y * fx


@_compiled
def _add_body(
    parameters: np.ndarray, turn: np.ndarray, place: np.ndarray, total: np.ndarray
) -> None:
    """Add the inertial parameters of a body to those of the body it hangs on, in its frame."""
    mass = parameters[0]
    fx, fy, fz = 0.0, 0.0, 0.0  # first moment about its origin
    for t in range(3):
        fx += turn[0, t] * parameters[1 + t]
        fy += turn[1, t] * parameters[1 + t]
        fz += turn[2, t] * parameters[1 + t]
    px, py, pz = place
    total[0] += mass
    total[1] += fx + mass * px
    total[2] += fy + mass * py
    total[3] += fz + mass * pz
    xx, yy, zz = 2.0 * fx * px + mass * px * px, 2.0 * fy * py + mass * py * py, 2.0 * fz * pz
    zz += mass * pz * pz
    total[4] += _turned(parameters, turn[0], turn[0]) + yy + zz
    total[5] += _turned(parameters, turn[0], turn[1]) - fx * py - px * fy - mass * px * py
    total[6] += _turned(parameters, turn[1], turn[1]) + xx + zz
    total[7] += _turned(parameters, turn[0], turn[2]) - fx * pz - px * fz - mass * px * pz
    total[8] += _turned(parameters, turn[1], turn[2]) - fy * pz - py * fz - mass * py * pz
    total[9] += _turned(parameters, turn[2], turn[2]) + xx + yy


@_compiled
def _turned(parameters: np.ndarray, u: np.ndarray, v: np.ndarray) -> float:
    """Return `u I v` for the moments of inertia of a body."""
    xx, xy, yy, xz, yz, zz = parameters[4:]
    return (
        u[0] * (xx * v[0] + xy * v[1] + xz * v[2])
        + u[1] * (xy * v[0] + yy * v[1] + yz * v[2])
        + u[2] * (xz * v[0] + yz * v[1] + zz * v[2])
    )


@_compiled
def _unit_wrench(g: Geometry, i: int, total: np.ndarray, wrench: np.ndarray) -> None:
    """Set force and moment (6,) that a unit motion of joint i takes."""
    mass, hx, hy, hz, xx, xy, yy, xz, yz, zz = total
    x, y, z = g.axes[i]
    if g.slidings[i]:
        wrench[0], wrench[1], wrench[2] = mass * x, mass * y, mass * z
        wrench[3], wrench[4], wrench[5] = hy * z - hz * y, hz * x - hx * z, hx * y - hy * x
        return
    wrench[0], wrench[1], wrench[2] = y * hz - z * hy, z * hx - x * hz, x * hy - y * hx
    wrench[3] = xx * x + xy * y + xz * z
    wrench[4] = xy * x + yy * y + yz * z
    wrench[5] = xz * x + yz * y + zz * z
