"""Laws of what a whole stream tells of W, where its basis is at a limit."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.gp.forgetting import Forgetting
from sgp_ros.gp.information import Information
from sgp_ros.gp.posterior import Posterior
from sgp_ros.gp.stream_basis import StreamBasis
from test.gp.worlds import plane, returning


def _learned(model, prior, data, features):
    basis = StreamBasis(model, Information.of_prior(prior), features)
    for u, f, y in zip(data.U, data.F, data.y, strict=True):
        basis.absorb(u, basis.features(u), np.column_stack([f, y]))
    return basis


def test_without_room_the_intervals_of_w_still_hold():
    """A tenth of the features that Z would need make W less certain, not too certain.

    The mean of 40 draws of chi2_3 / 3 has standard deviation 0.129; four of these bound it from
    above. Remainders that counted as news at each sample would give a mean square above ten.
    """
    squares = []
    for seed in range(40):
        model, prior, w, data = plane(seed, 400, 0.01)
        basis = _learned(model, prior, data, 20)
        assert basis.unresolved > 300
        error = basis.total.R @ (basis.total.coefficients - w)
        squares.append(error @ error / 3)
    assert np.mean(squares) < 1.0 + 4 * 0.129


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


def test_what_fades_no_longer_stands_for_the_same_remainder():
    """Samples without room are numbered by as much as they still count."""
    model, prior, _, data = plane(0, 300, 0.01)
    basis = _learned(model, prior, data, 5)
    block = basis.blocks[0]
    before = block.tally.copy()
    forgetting = Forgetting(2.0, Information.of_prior(prior))
    basis.fade(forgetting)
    np.testing.assert_allclose(block.tally, np.exp(-0.5) * before)
