"""Compiled mass matrix of a kinematic tree by composite bodies.

All bodies beyond a joint move with it as one. In the axes of the root, about its origin, their
inertias simply add up: mass m, first moment h and moment of inertia I. A unit motion of the joint,
turning w and sliding s there, takes the force `m s + w x h` and the moment `h x s + I w`; every
joint between it and the root feels its component along the motion that this one permits. No
function of another module is called, because the cache of compiled code watches this one alone.

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
    world, origin = np.zeros((b + 1, 3, 3)), np.zeros((b + 1, 3))
    for r in range(3):
        world[b, r, r] = 1.0
    motion, composite, wrench = np.zeros((b, 6)), np.zeros((b + 1, 10)), np.zeros(6)
    for sample in range(len(q)):
        composite[:] = 0.0
        for i in g.order:
            _place(g, q[sample, i], i, world, origin, motion[i])
        for i in g.order[::-1]:
            _add_body(parameters[i], world[i], origin[i], composite[i])
            for t in range(10):
                composite[g.parents[i], t] += composite[i, t]
            _unit_wrench(composite[i], motion[i], wrench)
            row, j = g.rows[i], i
            while j < b:
                felt = 0.0
                for t in range(6):
                    felt += motion[j, t] * wrench[t]
                M[sample, g.rows[j], row] += felt
                if j != i:
                    M[sample, row, g.rows[j]] += felt
                j = g.parents[j]


@_compiled
def _place(
    g: Geometry, q: float, i: int, world: np.ndarray, origin: np.ndarray, motion: np.ndarray
) -> None:
    """Set rotation and origin of body i in the root, and the motion (6,) of its joint there.

    Turning and sliding of the point at the root's origin, per position of the joint it follows.
    """
    j = g.parents[i]
    slides = g.slidings[i]
    s, c = (0.0, 0.0) if slides else (np.sin(q), 1.0 - np.cos(q))
    world[i] = 0.0
    for t in range(3):
        place = g.starts[i, t] + q * g.slides[i, t]
        for r in range(3):
            origin[i, r] = (origin[j, r] if t == 0 else origin[i, r]) + world[j, r, t] * place
        for u in range(3):
            turn = g.turns[i, 0, t, u] + s * g.turns[i, 1, t, u] + c * g.turns[i, 2, t, u]
            for r in range(3):
                world[i, r, u] += world[j, r, t] * turn
    motion[:] = 0.0
    first = 3 if slides else 0
    for r in range(3):
        for t in range(3):
            motion[first + r] += g.gains[i] * world[i, r, t] * g.axes[i, t]
    if not slides:
        x, y, z = origin[i]
        motion[3] = y * motion[2] - z * motion[1]
        motion[4] = z * motion[0] - x * motion[2]
        motion[5] = x * motion[1] - y * motion[0]


@_compiled
def _add_body(
    parameters: np.ndarray, world: np.ndarray, origin: np.ndarray, total: np.ndarray
) -> None:
    """Add the inertial parameters of a body, about the origin of the root in its axes."""
    mass = parameters[0]
    fx, fy, fz = 0.0, 0.0, 0.0  # first moment about the body's origin
    for t in range(3):
        fx += world[0, t] * parameters[1 + t]
        fy += world[1, t] * parameters[1 + t]
        fz += world[2, t] * parameters[1 + t]
    px, py, pz = origin
    total[0] += mass
    total[1] += fx + mass * px
    total[2] += fy + mass * py
    total[3] += fz + mass * pz
    xx, yy, zz = 2.0 * fx * px + mass * px * px, 2.0 * fy * py + mass * py * py, 2.0 * fz * pz
    zz += mass * pz * pz
    total[4] += _turned(parameters, world[0], world[0]) + yy + zz
    total[5] += _turned(parameters, world[0], world[1]) - fx * py - px * fy - mass * px * py
    total[6] += _turned(parameters, world[1], world[1]) + xx + zz
    total[7] += _turned(parameters, world[0], world[2]) - fx * pz - px * fz - mass * px * pz
    total[8] += _turned(parameters, world[1], world[2]) - fy * pz - py * fz - mass * py * pz
    total[9] += _turned(parameters, world[2], world[2]) + xx + yy


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
def _unit_wrench(total: np.ndarray, motion: np.ndarray, wrench: np.ndarray) -> None:
    """Set moment and force (6,) that a motion (6,) takes, about the origin of the root."""
    mass, hx, hy, hz, xx, xy, yy, xz, yz, zz = total
    x, y, z, u, v, w = motion
    wrench[0] = xx * x + xy * y + xz * z + hy * w - hz * v
    wrench[1] = xy * x + yy * y + yz * z + hz * u - hx * w
    wrench[2] = xz * x + yz * y + zz * z + hx * v - hy * u
    wrench[3] = mass * u + y * hz - z * hy
    wrench[4] = mass * v + z * hx - x * hz
    wrench[5] = mass * w + x * hy - y * hx
