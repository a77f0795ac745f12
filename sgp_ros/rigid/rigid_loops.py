"""Compiled loops over the bodies of a kinematic tree: motion outwards, forces inwards, columns.

Gravity enters as an acceleration of the root, so that what a body feels is its acceleration less
that of free fall. The force that body i takes to move is linear in its ten parameters. Joint j,
anywhere between i and the root, feels its component along the motion it permits,
`tau_j = S_j^T (force, moment)_i`; every other entry of the regressor is zero. Functions that call
one another stand in one module, because that is what the cache of compiled code watches.

Source: Featherstone 2008, Rigid Body Dynamics Algorithms, chapter 5; Atkeson, An, Hollerbach 1986
for the columns. Arrays are handed on whole, with the number of a body: a view of one row would
cost as much as the arithmetic on it.
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
    for t in range(3):
        moving.push[b, t] = -gravity[t]
    return moving


@_compiled
def _move(
    g: Geometry, q: np.ndarray, v: np.ndarray, a: np.ndarray, sample: int, m: Moving
) -> None:
    """Fill the motion of all bodies for one of the times; q, v, a (n, b)."""
    turn = m.turn
    for i in g.order:
        j = g.parents[i]
        slides = g.slidings[i]
        angle, speed, gain = q[sample, i], v[sample, i], a[sample, i]
        s, c = (0.0, 0.0) if slides else (np.sin(angle), 1.0 - np.cos(angle))
        for r in range(3):
            for t in range(3):
                turn[i, r, t] = (
                    g.turns[i, 0, r, t] + s * g.turns[i, 1, r, t] + c * g.turns[i, 2, r, t]
                )
        px = g.starts[i, 0] + angle * g.slides[i, 0]
        py = g.starts[i, 1] + angle * g.slides[i, 1]
        pz = g.starts[i, 2] + angle * g.slides[i, 2]
        m.place[i, 0], m.place[i, 1], m.place[i, 2] = px, py, pz
        wx, wy, wz = m.rate[j, 0], m.rate[j, 1], m.rate[j, 2]
        dx, dy, dz = m.spin[j, 0], m.spin[j, 1], m.spin[j, 2]
        ux, uy, uz = wy * pz - wz * py, wz * px - wx * pz, wx * py - wy * px
        ax = m.push[j, 0] + dy * pz - dz * py + wy * uz - wz * uy
        ay = m.push[j, 1] + dz * px - dx * pz + wz * ux - wx * uz
        az = m.push[j, 2] + dx * py - dy * px + wx * uy - wy * ux
        for t in range(3):
            m.rate[i, t] = turn[i, 0, t] * wx + turn[i, 1, t] * wy + turn[i, 2, t] * wz
            m.spin[i, t] = turn[i, 0, t] * dx + turn[i, 1, t] * dy + turn[i, 2, t] * dz
            m.push[i, t] = turn[i, 0, t] * ax + turn[i, 1, t] * ay + turn[i, 2, t] * az
        wx, wy, wz = m.rate[i, 0], m.rate[i, 1], m.rate[i, 2]
        ex, ey, ez = g.axes[i, 0], g.axes[i, 1], g.axes[i, 2]
        # what the joint adds: its own motion, turned along by the parent
        hx, hy, hz = wy * ez - wz * ey, wz * ex - wx * ez, wx * ey - wy * ex
        if slides:
            m.push[i, 0] += gain * ex + 2.0 * speed * hx
            m.push[i, 1] += gain * ey + 2.0 * speed * hy
            m.push[i, 2] += gain * ez + 2.0 * speed * hz
        else:
            m.spin[i, 0] += gain * ex + speed * hx
            m.spin[i, 1] += gain * ey + speed * hy
            m.spin[i, 2] += gain * ez + speed * hz
            m.rate[i, 0] += speed * ex
            m.rate[i, 1] += speed * ey
            m.rate[i, 2] += speed * ez


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
        _move(g, q, v, a, sample, m)
        for i in range(b):
            _own_wrench(parameters, m, i, wrench)
        for i in g.order[::-1]:
            first = 0 if g.slidings[i] else 3
            felt = (
                g.axes[i, 0] * wrench[i, first]
                + g.axes[i, 1] * wrench[i, first + 1]
                + g.axes[i, 2] * wrench[i, first + 2]
            )
            tau[sample, g.rows[i]] += g.gains[i] * felt
            _hand_down(m, wrench, i, g.parents[i])


@_compiled
def _own_wrench(parameters: np.ndarray, m: Moving, i: int, wrench: np.ndarray) -> None:
    """Set force and moment (6,) that body i takes to move, about its origin.

    Force `m a + d x h + w x (w x h)`, moment `h x a + I d + w x I w`, first moment h.
    """
    mass, hx, hy, hz = parameters[i, 0], parameters[i, 1], parameters[i, 2], parameters[i, 3]
    xx, xy, yy = parameters[i, 4], parameters[i, 5], parameters[i, 6]
    xz, yz, zz = parameters[i, 7], parameters[i, 8], parameters[i, 9]
    wx, wy, wz = m.rate[i, 0], m.rate[i, 1], m.rate[i, 2]
    dx, dy, dz = m.spin[i, 0], m.spin[i, 1], m.spin[i, 2]
    ax, ay, az = m.push[i, 0], m.push[i, 1], m.push[i, 2]
    wh = wx * hx + wy * hy + wz * hz
    ww = wx * wx + wy * wy + wz * wz
    wrench[i, 0] = mass * ax + dy * hz - dz * hy + wx * wh - ww * hx
    wrench[i, 1] = mass * ay + dz * hx - dx * hz + wy * wh - ww * hy
    wrench[i, 2] = mass * az + dx * hy - dy * hx + wz * wh - ww * hz
    lx = xx * wx + xy * wy + xz * wz
    ly = xy * wx + yy * wy + yz * wz
    lz = xz * wx + yz * wy + zz * wz
    ix = xx * dx + xy * dy + xz * dz
    iy = xy * dx + yy * dy + yz * dz
    iz = xz * dx + yz * dy + zz * dz
    wrench[i, 3] = hy * az - hz * ay + ix + wy * lz - wz * ly
    wrench[i, 4] = hz * ax - hx * az + iy + wz * lx - wx * lz
    wrench[i, 5] = hx * ay - hy * ax + iz + wx * ly - wy * lx


@_compiled
def _hand_down(m: Moving, wrench: np.ndarray, i: int, j: int) -> None:
    """Add the wrench (6,) of body i to that of body j it hangs on, in the frame of that one."""
    turn, x = m.turn, wrench
    f0 = turn[i, 0, 0] * x[i, 0] + turn[i, 0, 1] * x[i, 1] + turn[i, 0, 2] * x[i, 2]
    f1 = turn[i, 1, 0] * x[i, 0] + turn[i, 1, 1] * x[i, 1] + turn[i, 1, 2] * x[i, 2]
    f2 = turn[i, 2, 0] * x[i, 0] + turn[i, 2, 1] * x[i, 1] + turn[i, 2, 2] * x[i, 2]
    x[j, 0] += f0
    x[j, 1] += f1
    x[j, 2] += f2
    for r in range(3):
        x[j, 3 + r] += turn[i, r, 0] * x[i, 3] + turn[i, r, 1] * x[i, 4] + turn[i, r, 2] * x[i, 5]
    px, py, pz = m.place[i, 0], m.place[i, 1], m.place[i, 2]
    x[j, 3] += py * f2 - pz * f1
    x[j, 4] += pz * f0 - px * f2
    x[j, 5] += px * f1 - py * f0


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
        _move(g, q, v, a, sample, m)
        Y[sample] = 0.0
        for i in g.order:
            _place(g, m, i, world, origin, screw)
            _own_columns(m, i, moments, inertias)
            j = i
            while j < b:
                row = Y[sample, g.rows[j], 10 * i : 10 * i + 10]
                zx, zy, zz = screw[j, 0], screw[j, 1], screw[j, 2]
                if g.slidings[j]:
                    _add_force(world, i, zx, zy, zz, m, moments, row)
                else:
                    dx = origin[i, 0] - origin[j, 0]
                    dy = origin[i, 1] - origin[j, 1]
                    dz = origin[i, 2] - origin[j, 2]
                    lx, ly, lz = zy * dz - zz * dy, zz * dx - zx * dz, zx * dy - zy * dx
                    _add_force(world, i, lx, ly, lz, m, moments, row)
                    _add_moment(world, i, zx, zy, zz, m, inertias, row)
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
def _own_columns(m: Moving, i: int, moments: np.ndarray, inertias: np.ndarray) -> None:
    """Set the force per first moment (3, 3) and the moment per inertia (3, 6) of body i."""
    x, y, z = m.rate[i, 0], m.rate[i, 1], m.rate[i, 2]
    dx, dy, dz = m.spin[i, 0], m.spin[i, 1], m.spin[i, 2]
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
    i: int,
    x: float,
    y: float,
    z: float,
    m: Moving,
    moments: np.ndarray,
    row: np.ndarray,
) -> None:
    """Add what a motion (x, y, z) of the body's origin, in the root's frame, feels."""
    p0, p1, p2 = m.push[i, 0], m.push[i, 1], m.push[i, 2]
    lx = world[i, 0, 0] * x + world[i, 1, 0] * y + world[i, 2, 0] * z
    ly = world[i, 0, 1] * x + world[i, 1, 1] * y + world[i, 2, 1] * z
    lz = world[i, 0, 2] * x + world[i, 1, 2] * y + world[i, 2, 2] * z
    row[0] += lx * p0 + ly * p1 + lz * p2
    for t in range(3):
        row[1 + t] += lx * moments[0, t] + ly * moments[1, t] + lz * moments[2, t]


@_compiled
def _add_moment(
    world: np.ndarray,
    i: int,
    x: float,
    y: float,
    z: float,
    m: Moving,
    inertias: np.ndarray,
    row: np.ndarray,
) -> None:
    """Add what a rotation (x, y, z) about the body's origin, in the root's frame, feels."""
    p0, p1, p2 = m.push[i, 0], m.push[i, 1], m.push[i, 2]
    wx = world[i, 0, 0] * x + world[i, 1, 0] * y + world[i, 2, 0] * z
    wy = world[i, 0, 1] * x + world[i, 1, 1] * y + world[i, 2, 1] * z
    wz = world[i, 0, 2] * x + world[i, 1, 2] * y + world[i, 2, 2] * z
    row[1] += p1 * wz - p2 * wy
    row[2] += p2 * wx - p0 * wz
    row[3] += p0 * wy - p1 * wx
    for t in range(6):
        row[4 + t] += wx * inertias[0, t] + wy * inertias[1, t] + wz * inertias[2, t]
