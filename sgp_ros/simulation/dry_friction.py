"""Which joints with dry friction stick, and which way the others slide.

At rest the friction takes any value up to its level. By Gauss's principle of least constraint the
friction forces r of the joints at rest are those that minimise `r^T A r / 2 + a^T r` in their
range, where a is the acceleration without them and A the matching block of the inverse mass
matrix: a joint whose friction is inside its range sticks, the others start to slide. What is said
of joints holds of any axis `g^T v` with dry friction, such as a motor that turns with two joints.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

_SWEEPS = 200
_TOLERANCE = 1e-14
_DEPENDENT = 1e-10


def friction_at_rest(
    A: np.ndarray, acceleration: np.ndarray, level_up: np.ndarray, level_down: np.ndarray
) -> np.ndarray:
    """Return the friction forces of s joints at rest, (s,) [N m or N].

    In closed form for one joint, else by projected Gauss-Seidel, O(s^2) a sweep.

    Args:
        A: (s, s) block of the inverse mass matrix, positive definite.
        acceleration: (s,) without these forces.
        level_up: (s,) level of friction against a start in the positive direction.
        level_down: (s,) the same in the negative direction.
    """
    if len(acceleration) == 1:
        return np.minimum(np.maximum(-acceleration / A[0], -level_up), level_down)
    r = np.zeros(len(acceleration))
    for _ in range(_SWEEPS):
        before = r.copy()
        for j in range(len(r)):
            wanted = r[j] - (acceleration[j] + A[j] @ r) / A[j, j]
            r[j] = min(max(wanted, -level_up[j]), level_down[j])
        if np.all(np.abs(r - before) <= _TOLERANCE * (level_up + level_down)):
            break
    return r


def directions_from_rest(
    A: np.ndarray, acceleration: np.ndarray, level_up: np.ndarray, level_down: np.ndarray
) -> list[int]:
    """Return for each of s joints at rest: 0 if it sticks, else the direction in which it starts.

    Args:
        A: (s, s) block of the inverse mass matrix, positive definite.
        acceleration: (s,) without friction of these joints.
        level_up: (s,) level of friction against a start in the positive direction.
        level_down: (s,) the same in the negative direction.
    """
    r = friction_at_rest(A, acceleration, level_up, level_down)
    starting = acceleration + A @ r
    inside = (-level_up < r) & (r < level_down)
    return [0 if inside[j] else int(np.sign(starting[j])) for j in range(len(r))]


def hold_axes(inverse_mass: np.ndarray, acceleration: np.ndarray, G: np.ndarray) -> np.ndarray:
    """Return the accelerations (k,) once the axes `G v`, (s, k), are held at rest.

    They may depend on each other: two joints and a motor that turns with both.
    """
    columns = inverse_mass @ G.T
    reaction = np.linalg.pinv(G @ columns, rcond=_DEPENDENT, hermitian=True) @ (G @ acceleration)
    return np.asarray(acceleration - columns @ reaction)


def hold_still(
    inverse_mass: np.ndarray, acceleration: np.ndarray, stuck: Sequence[int]
) -> np.ndarray:
    """Return the accelerations (k,) once the joints `stuck` are held at rest."""
    if not stuck:
        return acceleration
    if len(stuck) == 1:
        column = inverse_mass[:, stuck[0]]
        alone: np.ndarray = acceleration - column * (acceleration[stuck[0]] / column[stuck[0]])
        alone[stuck[0]] = 0.0
        return alone
    columns = inverse_mass[:, stuck]
    reaction = np.linalg.solve(columns[stuck, :], acceleration[stuck])
    held: np.ndarray = acceleration - columns @ reaction
    held[stuck] = 0.0
    return held
