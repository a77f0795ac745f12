"""How many rows of a residual that is correlated in time count as one."""

from __future__ import annotations

import numpy as np

LONGEST_LAG = 60
LEAST_CORRELATION = 0.05
"""The sum over lags ends where the correlation falls below this."""


def correlation_factor(residual: np.ndarray) -> float:
    """Return `1 + 2 sum of rho(lag)` of one joint's residual (N,), at least 1.

    The variance of a mean of correlated samples is this much larger than that of independent ones
    (Bartlett 1946).
    """
    r = residual - residual.mean()
    power = float(r @ r)
    if power <= 0.0:
        return 1.0
    total = 1.0
    for lag in range(1, min(LONGEST_LAG, len(r) // 4)):
        rho = float(r[lag:] @ r[:-lag]) / power
        if rho < LEAST_CORRELATION:
            break
        total += 2.0 * rho
    return total
