"""Compiled loops over the bodies of a kinematic tree: motion outwards, forces inwards, columns.

Gravity enters as an acceleration of the root, so that what a body feels is its acceleration less
that of free fall. The force that body i takes to move is linear in its ten parameters. Joint j,
anywhere between i and the root, feels its component along the motion it permits,
`tau_j = S_j^T (force, moment)_i`; every other entry of the regressor is zero. Functions that call
one another stand in one module, because that is what the cache of compiled code watches.

Source: Featherstone 2008, Rigid Body Dynamics Algorithms, chapter 5; Atkeson, An, Hollerbach 1986
for the columns.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from sgp_ros.rigid.rigid_geometry import Geometry

_compiled: Callable[[Any], Any] = njit(cache=True, error_model='numpy')


class Moving(NamedTuple):
    """Motion of the bodies at one time, (b + 1) rows each, the last one of the root.

    Attributes:
        turn: (b + 1, 3, 3) rotation to the frame of the parent.
        place: (b + 1, 3) origin there [m].
        rate: (b + 1, 3) angular velocity, as all below in the frame of the body [rad/s].
        spin: (b + 1, 3) angular acceleration [rad/s^2].
        push: (b + 1, 3) acceleration of the origin less that of free fall [m/s^2].
    """

    turn: np.ndarray
    place: np.ndarray
    rate: np.ndarray
    spin: np.ndarray
    push: np.ndarray


@_compiled
def _at_rest(b: int, gravity: np.ndarray) -> Moving:
    """Return the motion of b bodies at rest, over a root that gravity pushes."""
    moving = Moving(
        np.zeros((b + 1, 3, 3)), np.zeros((b + 1, 3)), np.zeros((b + 1, 3)),
        np.zeros((b + 1, 3)), np.zeros((b + 1, 3)),
    )  # fmt: skip
    moving.push[b] = -gravity
    return moving


@_compiled
def _move(g: Geometry, q: np.ndarray, v: np.ndarray, a: np.ndarray, m: Moving) -> None:
    """Fill the motion of all bodies for one time; q, v, a (b,)."""
    for i in g.order:
        j = g.parents[i]
        slides = g.slidings[i]
        s, c = (0.0, 0.0) if slides else (np.sin(q[i]), 1.0 - np.cos(q[i]))
        turn = m.turn[i]
        for r in range(3):
            for t in range(3):
                turn[r, t] = (
                    g.turns[i, 0, r, t] + s * g.turns[i, 1, r, t] + c * g.turns[i, 2, r, t]
                )
        px = g.starts[i, 0] + q[i] * g.slides[i, 0]
        py = g.starts[i, 1] + q[i] * g.slides[i, 1]
        pz = g.starts[i, 2] + q[i] * g.slides[i, 2]
        m.place[i, 0], m.place[i, 1], m.place[i, 2] = px, py, pz
        wx, wy, wz = m.rate[j, 0], m.rate[j, 1], m.rate[j, 2]
        dx, dy, dz = m.spin[j, 0], m.spin[j, 1], m.spin[j, 2]
        ux, uy, uz = wy * pz - wz * py, wz * px - wx * pz, wx * py - wy * px
        ax = m.push[j, 0] + dy * pz - dz * py + wy * uz - wz * uy
        ay = m.push[j, 1] + dz * px - dx * pz + wz * ux - wx * uz
        az = m.push[j, 2] + dx * py - dy * px + wx * uy - wy * ux
        for t in range(3):
            m.rate[i, t] = turn[0, t] * wx + turn[1, t] * wy + turn[2, t] * wz
            m.spin[i, t] = turn[0, t] * dx + turn[1, t] * dy + turn[2, t] * dz
            m.push[i, t] = turn[0, t] * ax + turn[1, t] * ay + turn[2, t] * az
        wx, wy, wz = m.rate[i, 0], m.rate[i, 1], m.rate[i, 2]
        ex, ey, ez = g.axes[i, 0], g.axes[i, 1], g.axes[i, 2]
        # what the joint adds: its own motion, turned along by the parent
        hx, hy, hz = wy * ez - wz * ey, wz * ex - wx * ez, wx * ey - wy * ex
        if slides:
            m.push[i, 0] += a[i] * ex + 2.0 * v[i] * hx
            m.push[i, 1] += a[i] * ey + 2.0 * v[i] * hy
            m.push[i, 2] += a[i] * ez + 2.0 * v[i] * hz
        else:
            m.spin[i, 0] += a[i] * ex + v[i] * hx
            m.spin[i, 1] += a[i] * ey + v[i] * hy
            m.spin[i, 2] += a[i] * ez + v[i] * hz
            m.rate[i, 0] += v[i] * ex
            m.rate[i, 1] += v[i] * ey
            m.rate[i, 2] += v[i] * ez


@_compiled
def fill_torque(
    g: Geometry,
    gravity: np.ndarray,
    q: np.ndarray,
    v: np.ndarray,
    a: np.ndarray,
    parameters: np.ndarray,
    tau: np.ndarray,
) -> None:
    """Add the torques (n, k) of motions (n, b) to `tau`."""
    b = len(g.order)
    m = _at_rest(b, gravity)
    wrench = np.empty((b + 1, 6))
    for sample in range(len(q)):
        _move(g, q[sample], v[sample], a[sample], m)
        for i in range(b):
            _own_wrench(parameters[i], m.rate[i], m.spin[i], m.push[i], wrench[i])
        for i in g.order[::-1]:
            x = wrench[i]
            s = g.axes[i]
            first = 0 if g.slidings[i] else 3
            felt = s[0] * x[first] + s[1] * x[first + 1] + s[2] * x[first + 2]
            tau[sample, g.rows[i]] += g.gains[i] * felt
            _hand_down(m.turn[i], m.place[i], x, wrench[g.parents[i]])


@_compiled
def _own_wrench(
    parameters: np.ndarray, w: np.ndarray, d: np.ndarray, a: np.ndarray, wrench: np.ndarray
) -> None:
    """Set force and moment (6,) that a body takes to move, about its origin.

    Force `m a + d x h + w x (w x h)`, moment `h x a + I d + w x I w`, first moment h.
    """
    mass, hx, hy, hz, xx, xy, yy, xz, yz, zz = parameters
    wh = w[0] * hx + w[1] * hy + w[2] * hz
    ww = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    wrench[0] = mass * a[0] + d[1] * hz - d[2] * hy + w[0] * wh - ww * hx
    wrench[1] = mass * a[1] + d[2] * hx - d[0] * hz + w[1] * wh - ww * hy
    wrench[2] = mass * a[2] + d[0] * hy - d[1] * hx + w[2] * wh - ww * hz
    lx = xx * w[0] + xy * w[1] + xz * w[2]
    ly = xy * w[0] + yy * w[1] + yz * w[2]
    lz = xz * w[0] + yz * w[1] + zz * w[2]
    ix = xx * d[0] + xy * d[1] + xz * d[2]
    iy = xy * d[0] + yy * d[1] + yz * d[2]
    iz = xz * d[0] + yz * d[1] + zz * d[2]
    wrench[3] = hy * a[2] - hz * a[1] + ix + w[1] * lz - w[2] * ly
    wrench[4] = hz * a[0] - hx * a[2] + iy + w[2] * lx - w[0] * lz
    wrench[5] = hx * a[1] - hy * a[0] + iz + w[0] * ly - w[1] * lx


@_compiled
def _hand_down(turn: np.ndarray, place: np.ndarray, x: np.ndarray, below: np.ndarray) -> None:
    """Add a wrench (6,) of a body to that of the body it hangs on, in the frame of that one."""
    f0 = turn[0, 0] * x[0] + turn[0, 1] * x[1] + turn[0, 2] * x[2]
    f1 = turn[1, 0] * x[0] + turn[1, 1] * x[1] + turn[1, 2] * x[2]
    f2 = turn[2, 0] * x[0] + turn[2, 1] * x[1] + turn[2, 2] * x[2]
    below[0] += f0
    below[1] += f1
    below[2] += f2
    for r in range(3):
        below[3 + r] += turn[r, 0] * x[3] + turn[r, 1] * x[4] + turn[r, 2] * x[5]
    below[3] += place[1] * f2 - place[2] * f1
    below[4] += place[2] * f0 - place[0] * f2
    below[5] += place[0] * f1 - place[1] * f0


@_compiled
def fill_regressor(
    g: Geometry,
    gravity: np.ndarray,
    q: np.ndarray,
    v: np.ndarray,
    a: np.ndarray,
    Y: np.ndarray,
) -> None:
    """Set `Y` to the regressor (n, k, 10 b) of motions (n, b)."""
    b = len(g.order)
    m = _at_rest(b, gravity)
    world = np.zeros((b + 1, 3, 3))
    origin = np.zeros((b + 1, 3))
    screw = np.zeros((b, 3))
    moments = np.empty((3, 3))
    inertias = np.empty((3, 6))
    for r in range(3):
        world[b, r, r] = 1.0
    for sample in range(len(q)):
        _move(g, q[sample], v[sample], a[sample], m)
        Y[sample] = 0.0
        for i in g.order:
            _place(g, m, i, world, origin, screw)
            _own_columns(m.rate[i], m.spin[i], moments, inertias)
            j = i
            while j < b:
                row = Y[sample, g.rows[j], 10 * i : 10 * i + 10]
                zx, zy, zz = screw[j, 0], screw[j, 1], screw[j, 2]
                if g.slidings[j]:
                    _add_force(world[i], zx, zy, zz, m.push[i], moments, row)
                else:
                    dx = origin[i, 0] - origin[j, 0]
                    dy = origin[i, 1] - origin[j, 1]
                    dz = origin[i, 2] - origin[j, 2]
                    lx, ly, lz = zy * dz - zz * dy, zz * dx - zx * dz, zx * dy - zy * dx
                    _add_force(world[i], lx, ly, lz, m.push[i], moments, row)
                    _add_moment(world[i], zx, zy, zz, m.push[i], inertias, row)
                j = g.parents[j]


@_compiled
def _place(
    g: Geometry, m: Moving, i: int, world: np.ndarray, origin: np.ndarray, screw: np.ndarray
) -> None:
    """Set rotation and origin of body i in the root, and the motion its joint permits there."""
    j = g.parents[i]
    for r in range(3):
        x, y, z = world[j, r, 0], world[j, r, 1], world[j, r, 2]
        for t in range(3):
            world[i, r, t] = x * m.turn[i, 0, t] + y * m.turn[i, 1, t] + z * m.turn[i, 2, t]
        origin[i, r] = origin[j, r] + x * m.place[i, 0] + y * m.place[i, 1] + z * m.place[i, 2]
        along = (
            world[i, r, 0] * g.axes[i, 0]
            + world[i, r, 1] * g.axes[i, 1]
            + world[i, r, 2] * g.axes[i, 2]
        )
        screw[i, r] = g.gains[i] * along


@_compiled
def _own_columns(w: np.ndarray, d: np.ndarray, moments: np.ndarray, inertias: np.ndarray) -> None:
    """Set the force per first moment (3, 3) and the moment per inertia (3, 6) of a body."""
    x, y, z = w
    dx, dy, dz = d
    moments[0, 0], moments[0, 1], moments[0, 2] = -y * y - z * z, x * y - dz, x * z + dy
    moments[1, 0], moments[1, 1], moments[1, 2] = x * y + dz, -x * x - z * z, y * z - dx
    moments[2, 0], moments[2, 1], moments[2, 2] = x * z - dy, y * z + dx, -x * x - y * y
    inertias[0, 0], inertias[1, 0], inertias[2, 0] = dx, z * x, -x * y
    inertias[0, 1], inertias[1, 1], inertias[2, 1] = dy - x * z, dx + y * z, x * x - y * y
    inertias[0, 2], inertias[1, 2], inertias[2, 2] = -y * z, dy, x * y
    inertias[0, 3], inertias[1, 3], inertias[2, 3] = dz + x * y, z * z - x * x, dx - y * z
    inertias[0, 4], inertias[1, 4], inertias[2, 4] = y * y - z * z, dz - x * y, dy + x * z
    inertias[0, 5], inertias[1, 5], inertias[2, 5] = y * z, -x * z, dz


@_compiled
def _add_force(
    world: np.ndarray,
    x: float,
    y: float,
    z: float,
    push: np.ndarray,
    moments: np.ndarray,
    row: np.ndarray,
) -> None:
    """Add what a motion (x, y, z) of the body's origin, in the root's frame, feels."""
    lx = world[0, 0] * x + world[1, 0] * y + world[2, 0] * z
    ly = world[0, 1] * x + world[1, 1] * y + world[2, 1] * z
    lz = world[0, 2] * x + world[1, 2] * y + world[2, 2] * z
    row[0] += lx * push[0] + ly * push[1] + lz * push[2]
    for t in range(3):
        row[1 + t] += lx * moments[0, t] + ly * moments[1, t] + lz * moments[2, t]


@_compiled
def _add_moment(
    world: np.ndarray,
    x: float,
    y: float,
    z: float,
    push: np.ndarray,
    inertias: np.ndarray,
    row: np.ndarray,
) -> None:
    """Add what a rotation (x, y, z) about the body's origin, in the root's frame, feels."""
    wx = world[0, 0] * x + world[1, 0] * y + world[2, 0] * z
    wy = world[0, 1] * x + world[1, 1] * y + world[2, 1] * z
    wz = world[0, 2] * x + world[1, 2] * y + world[2, 2] * z
    row[1] += push[1] * wz - push[2] * wy
    row[2] += push[2] * wx - push[0] * wz
    row[3] += push[0] * wy - push[1] * wx
    for t in range(6):
        row[4 + t] += wx * inertias[0, t] + wy * inertias[1, t] + wz * inertias[2, t]
