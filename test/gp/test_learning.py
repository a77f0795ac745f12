"""The box of a search is safe for the factor and does not hold the evidence down."""

import itertools

import numpy as np
import pytest
from scipy import optimize

from sgp_ros.gp.kernels import AdditiveSquaredExponential, Linear, SquaredExponential
from sgp_ros.gp.learning import initial_model, learn, opened_box, search_box
from sgp_ros.gp.model import CoefficientPrior, Model, Observations
from sgp_ros.gp.posterior import Posterior

FLAT = CoefficientPrior.flat(0)


def _observed(y, U, G=None):
    components = y.shape[1] if G is None else G.shape[2]
    return Observations(U, np.zeros((len(U), components, 0)), y, G)


def _sum_of_squares(n=60, noise=0.01):
    rng = np.random.default_rng(1)
    U = rng.uniform(-2.0, 2.0, (n, 3))
    y = (U**2).sum(axis=1) + U[:, 0] + noise * rng.standard_normal(n)
    return _observed(y[:, None], U)


def _searched(data, start, box):
    """Return evidence and place of the best point that SciPy finds in a box."""

    def objective(theta):
        posterior = Posterior(start.with_log_parameters(theta), data, FLAT)
        return -posterior.log_evidence, -posterior.evidence_gradient()

    found = optimize.minimize(
        objective, start.log_parameters, jac=True, method='L-BFGS-B', bounds=box
    )
    return -found.fun, found.x


def test_the_evidence_does_not_end_at_the_top_of_the_first_box():
    """A sum of functions of one input each asks a joint kernel for a variance without scale.

    Without any limit but that of the factor, a search from the same start finds ten nats more
    than the first box holds; the fit must find them too.
    """
    data = _sum_of_squares()
    start = initial_model(data, ((0, 1, 2),))
    box = search_box(data, start)
    inside, best = _searched(data, start, box)
    free = box.copy()
    free[0, 1] += np.log(1e5)
    free[-1, 0] = np.log(1e-6)
    beyond, _ = _searched(data, start.with_log_parameters(best), free)
    learned = learn(data, FLAT, start)
    assert beyond > inside + 5.0
    assert learned.log_evidence > beyond - 0.1
    assert learned.refused == 0


def test_a_mean_that_exceeds_the_spread_is_explained():
    """Z has no mean of its own: a target of 300 standard deviations is nine times that squared."""
    rng = np.random.default_rng(1)
    data = _observed(3.0 + 0.01 * rng.standard_normal((60, 1)), rng.uniform(-2.0, 2.0, (60, 1)))
    learned = learn(data, FLAT, initial_model(data, ((0,),)))
    assert learned.model.kernels[0].variance == pytest.approx(9.0, rel=0.5)
    assert learned.model.noise[0] == pytest.approx(1e-4, rel=0.5)


@pytest.mark.parametrize('noise', [0.0, 1e-6, 1e-2])
def test_every_corner_of_the_opened_box_has_a_factor(noise):
    """Noise above the rounding of the largest variance; no trial of the search is then lost."""
    data = _sum_of_squares(noise=noise)
    start = initial_model(data, ((0, 1, 2),))
    box = search_box(data, start)
    _, best = _searched(data, start, box)
    opened = opened_box(box, best, data, start)
    assert opened is not None
    assert opened[0, 1] > box[0, 1]
    assert np.all((opened[:, 0] <= best) & (best <= opened[:, 1]))
    for corner in itertools.product(*opened):
        model = start.with_log_parameters(np.array(corner))
        assert np.isfinite(Posterior(model, data, FLAT).log_evidence)


def test_a_box_that_holds_the_maximum_stays():
    """Nothing is searched twice where no variance is at its top, or there is none."""
    data = _sum_of_squares()
    for kernel in (SquaredExponential(1.0, (1.0, 1.0), (0, 1)), Linear((1.0,), (2,)), None):
        start = Model((kernel,), (0.1,))
        box = search_box(data, start)
        inside = np.where(np.arange(len(box)) == 0, box.mean(axis=1), box[:, 1])
        assert opened_box(box, inside, data, start) is None


def test_only_what_touches_opens():
    """Of two components that share nothing, one at its top leaves the box of the other alone."""
    one = _sum_of_squares()
    data = _observed(np.column_stack([one.y, one.y]), one.U)
    kernel = AdditiveSquaredExponential((1.0, 1.0), (1.0, 1.0), (0, 1))
    start = Model((kernel, kernel), (0.1, 0.1))
    box = search_box(data, start)
    best = box.mean(axis=1)
    best[5] = box[5, 1]
    opened = opened_box(box, best, data, start)
    assert opened is not None
    changed = np.flatnonzero((opened != box).any(axis=1))
    assert list(changed) == [4, 5, 9]
    assert opened[9, 0] <= best[9]


def test_components_observed_together_share_the_least_noise():
    """Behind an observation matrix one covariance holds all, so its least noise counts."""
    one = _sum_of_squares()
    G = np.tile(np.array([[1.0, 0.5], [0.0, 1.0]]), (len(one.U), 1, 1))
    data = _observed(np.column_stack([one.y, one.y]), one.U, G)
    kernel = SquaredExponential(1.0, (1.0,), (0,))
    start = Model((kernel, kernel), (0.1, 0.1))
    box = search_box(data, start)
    best = box.mean(axis=1)
    best[0] = box[0, 1]
    best[-1] = box[-1, 0] + 1.0
    opened = opened_box(box, best, data, start)
    assert opened is not None
    rounding = np.log(data.y.size * np.finfo(float).eps)
    assert opened[0, 1] <= best[-1] - rounding
    assert opened[-1, 0] <= best[-1]
    assert np.all(opened[-2:, 0] >= np.minimum(opened[0, 1] + rounding, best[-1]))
