"""The spectrum of a residual whose neighbours are correlated, and what it does to an estimate."""

from __future__ import annotations

import math

import numpy as np
from scipy import linalg

from sgp_ros.batch.physics import autocorrelation

_HIGHEST_ORDER = 12
_ROWS_PER_LAG = 20


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
