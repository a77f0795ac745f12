"""Least squares for the coefficients of the physics, in pieces that can be left out."""

from __future__ import annotations

import numpy as np

from sgp_ros.gp.linear_algebra import least_norm

_RANK_TOLERANCE = 1e-10


def triangular(F: np.ndarray, y: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Return R (r, p + 1) with `R^T R` the products of the rows [F y] in units of `scale`.

    Args:
        F: (n, k, p).
        y: (n, k).
        scale: (k,) size of the error of each joint [unit of y].
    """
    rows = np.concatenate([F, y[:, :, None]], axis=2) / scale[:, None]
    return np.asarray(np.linalg.qr(rows.reshape(-1, rows.shape[2]), mode='r'))


def solved(parts: list[np.ndarray]) -> np.ndarray:
    """Return the coefficients (p,) that fit the rows behind the factors of `triangular`.

    Of what nothing determines, the least in units of the columns.
    """
    R = np.vstack(parts)
    A, b = R[:, :-1], R[:, -1]
    norms = np.linalg.norm(A, axis=0)
    norms[norms == 0.0] = 1.0
    scaled = least_norm(A / norms, b, _RANK_TOLERANCE)
    return np.asarray(scaled / norms)


def least_squares(F: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fit all joints together, each in units of its own error (two steps).

    Returns:
        coefficients (p,) and the root mean square error of each joint (k,) [unit of y].
    """
    scale = _error(np.sqrt(np.mean(y * y, axis=0)), y)
    w = np.zeros(F.shape[2])
    for _ in range(2):
        w = solved([triangular(F, y, scale)])
        scale = _error(np.sqrt(np.mean((y - F @ w) ** 2, axis=0)), y)
    return w, scale


def _error(rms: np.ndarray, y: np.ndarray) -> np.ndarray:
    floor = np.finfo(float).eps * np.sqrt(np.mean(y * y, axis=0))
    return np.where(rms > floor, rms, np.where(floor > 0.0, floor, 1.0))


def autocorrelation(residual: np.ndarray, block: np.ndarray, lag: int) -> np.ndarray:
    """Return the correlation of each column of residual (n, k) with itself `lag` rows on, (k,).

    Pairs of rows that stand in different blocks do not count; without pairs it is 0.
    """
    early, late = residual[:-lag], residual[lag:]
    together = block[:-lag] == block[lag:]
    pairs = int(together.sum())
    power = np.mean(residual * residual, axis=0) * max(pairs, 1)
    products = np.sum(early[together] * late[together], axis=0)
    return np.asarray(products / np.where(power > 0.0, power, 1.0))
