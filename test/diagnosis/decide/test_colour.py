"""Laws of the correlation of residuals in time."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from sgp_ros.diagnosis.decide.colour import correlation_factor


@pytest.mark.parametrize('phi', [0.3, 0.6, 0.8])
def test_the_factor_of_an_autoregression_is_that_of_the_variance_of_its_mean(phi):
    """It is `(1 + phi) / (1 - phi)`; lags below a correlation of 0.05 are left out."""
    noise = np.random.default_rng(1).standard_normal(40000)
    r = signal.lfilter([1.0], [1.0, -phi], noise)
    assert correlation_factor(r) == pytest.approx((1.0 + phi) / (1.0 - phi), rel=0.15)


def test_white_and_alternating_residuals_count_row_by_row():
    """The factor is never below 1, and 1 for a residual of zeros."""
    noise = np.random.default_rng(2).standard_normal(5000)
    for r in (noise, np.resize([1.0, -1.0], 100), np.zeros(50)):
        assert correlation_factor(r) == 1.0
