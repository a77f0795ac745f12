"""Least squares for the coefficients of the physics, in pieces that can be left out.

Beside it the spectrum of what such a fit leaves: neighbours are correlated, which an estimate pays
for.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import linalg

from sgp_ros.gp.linear_algebra import least_norm

_RANK_TOLERANCE = 1e-10


def triangles(F: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return R_j (k, r, p + 1) with `R_j^T R_j` the products of the rows [F y] of each joint.

    The rows are gone through once; in other units of a joint only its triangle changes.

    Args:
        F: (n, k, p).
        y: (n, k).
    """
    rows = np.concatenate([F, y[:, :, None]], axis=2)
    return np.asarray(np.linalg.qr(rows.transpose(1, 0, 2), mode='r'))


def joined(triangle: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Return R (r, p + 1) of the rows of all joints in units of `scale` (k,), from `triangles`."""
    rows = triangle / scale[:, None, None]
    return np.asarray(np.linalg.qr(rows.reshape(-1, rows.shape[2]), mode='r'))


def solved(parts: list[np.ndarray]) -> np.ndarray:
    """Return the coefficients (p,) that fit the rows behind the factors of `joined`.

    Of what nothing determines, the least in units of the columns.
    """
    R = np.vstack(parts)
    A, b = R[:, :-1], R[:, -1]
    norms = np.linalg.norm(A, axis=0)
    norms[norms == 0.0] = 1.0
    scaled = least_norm(A / norms, b, _RANK_TOLERANCE)
    return np.asarray(scaled / norms)


def least_squares(
    F: np.ndarray, y: np.ndarray, triangle: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Fit all joints together, each in units of its own error (two steps).

    Args:
        F: (n, k, p).
        y: (n, k).
        triangle: of these rows, see `triangles`; None where it is not known.

    Returns:
        coefficients (p,) and the root mean square error of each joint (k,) [unit of y].
    """
    triangle = triangles(F, y) if triangle is None else triangle
    scale = _error(np.sqrt(np.mean(y * y, axis=0)), y)
    w = np.zeros(F.shape[2])
    for _ in range(2):
        w = solved([joined(triangle, scale)])
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


_HIGHEST_ORDER = 12
_ROWS_PER_LAG = 20
_LONGEST_LAG = 60
_LEAST_CORRELATION = 0.05
"""The sum over lags ends where the correlation falls below this."""


def autoregression(residual: np.ndarray, block: np.ndarray) -> tuple[np.ndarray, float]:
    """Fit an autoregression to a residual (n,) of the blocks `block` (n,), order by BIC.

    Yule and Walker's equations, by Levinson's recursion; a stationary process always results.

    Returns:
        weights (q,) of the last q values, and the variance of the innovation over that of the
        residual.
    """
    n = len(residual)
    lags = min(_HIGHEST_ORDER, max(n // _ROWS_PER_LAG, 1), n - 1)
    rho = np.array(
        [1.0, *(_at_lag(residual, block, lag) for lag in range(1, lags + 1))]
    )  # (lags + 1,)
    best, least = (np.zeros(0), 1.0), 0.0
    for order in range(1, lags + 1):
        weights = linalg.solve_toeplitz(rho[:order], rho[1 : order + 1])
        innovation = float(1.0 - weights @ rho[1 : order + 1])
        if innovation <= 0.0:
            break
        score = n * math.log(innovation) + order * math.log(n)
        if score < least:
            best, least = (weights, innovation), score
    return best


def coloured_products(
    H: np.ndarray, block: np.ndarray, weights: np.ndarray, innovation: float
) -> np.ndarray:
    """Return `H^T R H` for the correlations R of an autoregression, (p, p).

    Rows of different blocks are uncorrelated. R is applied by its spectrum, so the result is
    positive semidefinite: `sum_f S(f) H(f)^* H(f)`, with zeros of three times the length
    behind each block, beyond which the correlations are taken for gone. O(n p (p + log n)).

    Args:
        H: (n, p).
        block: (n,).
        weights: (q,) as from `autoregression`.
        innovation: variance of the innovation, for a process of variance one.
    """
    total = np.zeros((H.shape[1], H.shape[1]))
    for part in np.split(H, np.flatnonzero(np.diff(block)) + 1):
        size = 1 << (4 * len(part)).bit_length()
        density = innovation / np.abs(np.fft.fft(np.concatenate([[1.0], -weights]), size)) ** 2
        waves = np.fft.fft(part, size, axis=0)
        total += np.real(waves.conj().T @ (density[:, None] * waves)) / size
    return total


def inflation(weights: np.ndarray, innovation: float) -> float:
    """Return by how much the variance of a mean exceeds that of white noise: rows per free row."""
    return innovation / (1.0 - float(weights.sum())) ** 2


def _at_lag(residual: np.ndarray, block: np.ndarray, lag: int) -> float:
    """Return the correlation at a lag, shrunk to zero as the pairs become fewer.

    Products over all rows, not over the pairs alone: so the sequence is positive semidefinite.
    """
    pairs = int((block[:-lag] == block[lag:]).sum())
    found = float(autocorrelation(residual[:, None], block, lag)[0])
    return found * pairs / len(residual)


def correlation_factor(residual: np.ndarray, along: np.ndarray | None = None) -> float:
    """Return `1 + 2 sum of rho(lag)` of one joint's residual (N,), at least 1.

    The variance of a mean of correlated samples is this much larger than that of independent ones
    (Bartlett 1946). A regressor (N,) that changes faster than the residual averages it: with
    `along`, rho is the product of both autocorrelations.
    """
    r = residual - residual.mean()
    x = np.zeros(len(r)) if along is None else along
    power, size = float(r @ r), float(x @ x)
    if power <= 0.0:
        return 1.0
    total = 1.0
    for lag in range(1, min(_LONGEST_LAG, len(r) // 4)):
        rho = float(r[lag:] @ r[:-lag]) / power
        if rho < _LEAST_CORRELATION:
            break
        total += 2.0 * rho * (float(x[lag:] @ x[:-lag]) / size if size > 0.0 else 1.0)
    return max(total, 1.0)
