"""Compiled mass matrix of a kinematic tree by composite bodies.

All bodies beyond a joint move with it as one: mass m, first moment h and moment of inertia I about
the origin of the joint, in its axes, to which those of the bodies beyond are added. A unit motion
of the joint, turning w or sliding s, takes the force `m s + w x h` and the moment `h x s + I w`;
every joint between it and the root feels it along the motion that this one permits. A joint that
nothing resists has an inertia of zero, without rounding. No function of another module is called,
because the cache of compiled code watches this one alone. Arrays are handed on whole, with the
number of a body: a view of one row costs as much as the arithmetic on it.

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
    world, origin, axis = np.zeros((b + 1, 3, 3)), np.zeros((b + 1, 3)), np.zeros((b, 3))
    composite, wrench = np.zeros((b + 1, 10)), np.zeros(6)
    for t in range(3):
        world[b, t, t] = 1.0
    for sample in range(len(q)):
        for i in range(b + 1):
            for c in range(10):
                composite[i, c] = parameters[i, c] if i < b else 0.0
        for i in g.order:
            _place(g, q[sample, i], i, turn, place)
            _stand(g, i, turn, place, world, origin, axis)
        for i in g.order[::-1]:
            _add_body(composite, i, g.parents[i], turn, place)
        for i in g.order:
            _unit_wrench(g, i, composite, wrench)
            first = 0 if g.slidings[i] else 3
            own = 0.0  # in its own frame, where what nothing resists stays an exact zero
            for t in range(3):
                own += g.axes[i, t] * wrench[first + t]
            M[sample, g.rows[i], g.rows[i]] += own * g.gains[i] * g.gains[i]
            _feel(g, i, world, origin, axis, wrench, sample, M)


@_compiled
def _stand(
    g: Geometry,
    i: int,
    turn: np.ndarray,
    place: np.ndarray,
    world: np.ndarray,
    origin: np.ndarray,
    axis: np.ndarray,
) -> None:
    """Set rotation, origin and axis of body i in the frame of the root."""
    j = g.parents[i]
    for r in range(3):
        x, y, z = world[j, r, 0], world[j, r, 1], world[j, r, 2]
        for t in range(3):
            world[i, r, t] = x * turn[i, 0, t] + y * turn[i, 1, t] + z * turn[i, 2, t]
        origin[i, r] = origin[j, r] + x * place[i, 0] + y * place[i, 1] + z * place[i, 2]
        axis[i, r] = (
            world[i, r, 0] * g.axes[i, 0]
            + world[i, r, 1] * g.axes[i, 1]
            + world[i, r, 2] * g.axes[i, 2]
        )


@_compiled
def _feel(
    g: Geometry,
    i: int,
    turn: np.ndarray,
    origin: np.ndarray,
    axis: np.ndarray,
    wrench: np.ndarray,
    sample: int,
    M: np.ndarray,
) -> None:
    """Add what the joints between body i and the root feel of its wrench (6,) to M (n, k, k)."""
    a, b, c = wrench[0], wrench[1], wrench[2]
    d, e, f = wrench[3], wrench[4], wrench[5]
    fx = turn[i, 0, 0] * a + turn[i, 0, 1] * b + turn[i, 0, 2] * c
    fy = turn[i, 1, 0] * a + turn[i, 1, 1] * b + turn[i, 1, 2] * c
    fz = turn[i, 2, 0] * a + turn[i, 2, 1] * b + turn[i, 2, 2] * c
    mx = turn[i, 0, 0] * d + turn[i, 0, 1] * e + turn[i, 0, 2] * f
    my = turn[i, 1, 0] * d + turn[i, 1, 1] * e + turn[i, 1, 2] * f
    mz = turn[i, 2, 0] * d + turn[i, 2, 1] * e + turn[i, 2, 2] * f
    j = g.parents[i]
    while j < len(axis):
        x, y, z = axis[j, 0], axis[j, 1], axis[j, 2]
        if g.slidings[j]:
            felt = x * fx + y * fy + z * fz
        else:
            px = origin[i, 0] - origin[j, 0]
            py = origin[i, 1] - origin[j, 1]
            pz = origin[i, 2] - origin[j, 2]
            felt = x * (mx + py * fz - pz * fy)
            felt += y * (my + pz * fx - px * fz) + z * (mz + px * fy - py * fx)
        felt *= g.gains[i] * g.gains[j]
        M[sample, g.rows[j], g.rows[i]] += felt
        M[sample, g.rows[i], g.rows[j]] += felt
        j = g.parents[j]


@_compiled
def _place(g: Geometry, q: float, i: int, turn: np.ndarray, place: np.ndarray) -> None:
    """Set rotation and origin of body i in the frame of the body it hangs on."""
    s, c = (0.0, 0.0) if g.slidings[i] else (np.sin(q), 1.0 - np.cos(q))
    for t in range(3):
        place[i, t] = g.starts[i, t] + q * g.slides[i, t]
        for u in range(3):
            turn[i, t, u] = g.turns[i, 0, t, u] + s * g.turns[i, 1, t, u] + c * g.turns[i, 2, t, u]


@_compiled
def _add_body(total: np.ndarray, i: int, j: int, turn: np.ndarray, place: np.ndarray) -> None:
    """Add the inertial parameters of body i to those of body j it hangs on, in its frame."""
    a, b, c = turn[i, 0, 0], turn[i, 0, 1], turn[i, 0, 2]
    d, e, f = turn[i, 1, 0], turn[i, 1, 1], turn[i, 1, 2]
    k, m, n = turn[i, 2, 0], turn[i, 2, 1], turn[i, 2, 2]
    px, py, pz = place[i, 0], place[i, 1], place[i, 2]
    mass, hx, hy, hz = total[i, 0], total[i, 1], total[i, 2], total[i, 3]
    fx = a * hx + b * hy + c * hz  # first moment about its origin
    fy = d * hx + e * hy + f * hz
    fz = k * hx + m * hy + n * hz
    total[j, 0] += mass
    total[j, 1] += fx + mass * px
    total[j, 2] += fy + mass * py
    total[j, 3] += fz + mass * pz
    xx, xy, yy = total[i, 4], total[i, 5], total[i, 6]
    xz, yz, zz = total[i, 7], total[i, 8], total[i, 9]
    # R I, then R I R^T
    ax, ay, az = a * xx + b * xy + c * xz, a * xy + b * yy + c * yz, a * xz + b * yz + c * zz
    dx, dy, dz = d * xx + e * xy + f * xz, d * xy + e * yy + f * yz, d * xz + e * yz + f * zz
    kx, ky, kz = k * xx + m * xy + n * xz, k * xy + m * yy + n * yz, k * xz + m * yz + n * zz
    x = (2.0 * fx + mass * px) * px
    y = (2.0 * fy + mass * py) * py
    z = (2.0 * fz + mass * pz) * pz
    total[j, 4] += ax * a + ay * b + az * c + y + z
    total[j, 5] += ax * d + ay * e + az * f - fx * py - px * fy - mass * px * py
    total[j, 6] += dx * d + dy * e + dz * f + x + z
    total[j, 7] += ax * k + ay * m + az * n - fx * pz - px * fz - mass * px * pz
    total[j, 8] += dx * k + dy * m + dz * n - fy * pz - py * fz - mass * py * pz
    total[j, 9] += kx * k + ky * m + kz * n + x + y


@_compiled
def _unit_wrench(g: Geometry, i: int, total: np.ndarray, wrench: np.ndarray) -> None:
    """Set force and moment (6,) that a unit motion of joint i takes."""
    hx, hy, hz = total[i, 1], total[i, 2], total[i, 3]
    x, y, z = g.axes[i, 0], g.axes[i, 1], g.axes[i, 2]
    if g.slidings[i]:
        mass = total[i, 0]
        wrench[0], wrench[1], wrench[2] = mass * x, mass * y, mass * z
        wrench[3], wrench[4], wrench[5] = hy * z - hz * y, hz * x - hx * z, hx * y - hy * x
        return
    wrench[0], wrench[1], wrench[2] = y * hz - z * hy, z * hx - x * hz, x * hy - y * hx
    wrench[3] = total[i, 4] * x + total[i, 5] * y + total[i, 7] * z
    wrench[4] = total[i, 5] * x + total[i, 6] * y + total[i, 8] * z
    wrench[5] = total[i, 7] * x + total[i, 8] * y + total[i, 9] * z
