"""Laws of what a whole stream tells of W, where its basis is at a limit."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.core.information import Information
from sgp_ros.core.posterior import Posterior
from sgp_ros.core.stream_basis import StreamBasis
from test.core.worlds import returning


def _learned(model, prior, data, features):
    basis = StreamBasis(model, Information.of_prior(prior), features)
    for u, f, y in zip(data.U, data.F, data.y, strict=True):
        basis.absorb(u, basis.features(u), np.column_stack([f, y]))
    return basis


@pytest.mark.parametrize('noise', [1e-2, 1e-4, 1e-6, 1e-8])
def test_little_noise_costs_no_digit_that_w_needs(noise):
    """Down to a hundred-millionth of the variance of Z, W is that of a batch fit.

    Errors of a hundredth of the noise are all that the basis may make; features so close that
    their covariance has no inverse in double precision would be lost far above that.
    """
    model, prior, _, data = returning(2)
    model = type(model)(model.kernels, (noise,))
    kernel = model.kernels[0]
    grid = np.linspace(-2.0, 2.0, 9)[:, None]
    z = kernel.matrix(data.U, grid) @ np.random.default_rng(0).normal(size=9)
    rough = np.sqrt(noise) * np.random.default_rng(1).normal(size=len(z))
    data.y[:, 0] = data.F[:, 0] @ [1.0, 2.0, 3.0] + z + rough
    found = _learned(model, prior, data, 100).total
    batch = Posterior(model, data, prior)
    deviations = np.sqrt(np.diag(batch.covariance))
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), deviations, rtol=0.02)
    assert np.all(np.abs(found.coefficients - batch.coefficients) < 0.2 * deviations)
