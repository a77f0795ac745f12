"""Rotations in the forms that robot files write them in."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np


def rpy_of(R: np.ndarray) -> tuple[float, float, float]:
    """Return roll, pitch and yaw of `R = Rz(yaw) Ry(pitch) Rx(roll)` [rad].

    Pitch and yaw are read from `R Rx(-roll)`, so they suit any roll that rounding leaves where
    the pitch is a right angle.
    """
    roll = math.atan2(R[2, 1], R[2, 2])
    c, s = math.cos(roll), math.sin(roll)
    across, up = c * R[:, 1] - s * R[:, 2], s * R[:, 1] + c * R[:, 2]
    return roll, math.atan2(-R[2, 0], up[2]), math.atan2(-across[0], across[1])


def of_rpy(rpy: Sequence[float]) -> np.ndarray:
    """Return `Rz(yaw) Ry(pitch) Rx(roll)`, (3, 3)."""
    roll, pitch, yaw = rpy
    x, y, z = np.eye(3)
    return about(z, yaw) @ about(y, pitch) @ about(x, roll)


def of_quaternion(wxyz: Sequence[float]) -> np.ndarray:
    """Return the rotation (3, 3) of a quaternion, of any length above zero."""
    w, x, y, z = np.asarray(wxyz, dtype=np.float64) / np.linalg.norm(wxyz)
    return np.array([
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ])  # fmt: skip


def about(axis: Sequence[float] | np.ndarray, angle: float) -> np.ndarray:
    """Return the rotation (3, 3) about a unit axis (Rodrigues)."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turned: np.ndarray = np.eye(3) + math.sin(angle) * K + (1.0 - math.cos(angle)) * K @ K
    return turned


def between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the shortest rotation (3, 3) that turns unit vector `a` into `b`."""
    cross, cosine = np.cross(a, b), float(np.clip(a @ b, -1.0, 1.0))
    length = float(np.linalg.norm(cross))
    if length < 1e-12:
        if cosine > 0.0:
            return np.eye(3)
        aside = np.cross(a, np.eye(3)[int(np.argmin(np.abs(a)))])
        return about(aside / np.linalg.norm(aside), math.pi)
    return about(cross / length, math.atan2(length, cosine))
