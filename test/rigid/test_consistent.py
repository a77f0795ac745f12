"""The projection onto physically consistent parameters, against laws and brute force."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import linalg, optimize

from sgp_ros.errors import NumericalError
from sgp_ros.rigid import consistent
from sgp_ros.rigid.consistent import project, project_information
from sgp_ros.rigid.pseudo_inertia import inertial_parameters, is_consistent, pseudo_inertia
from test.rigid.bodies import random_body

SEEDS = st.integers(0, 2**32 - 1)


def _problem(seed, links=2, rank=None, error=0.3):
    """Return truth (12 k,), an estimate of it, its information root, blocks and friction."""
    rng = np.random.default_rng(seed)
    bodies = [random_body(rng.integers(2**32)) for _ in range(links)]
    truth = np.concatenate([*bodies, rng.uniform(0.0, 1.0, size=2 * links)])
    p = len(truth)
    R = rng.normal(size=(rank or p, p)) / (error * (np.abs(truth) + 0.01))
    scale = np.linalg.norm(R, axis=0)
    noisy = R @ truth + rng.normal(size=len(R))
    mean = np.linalg.lstsq(R / scale, noisy, rcond=None)[0] / scale
    blocks = [range(10 * i, 10 * i + 10) for i in range(links)]
    return truth, mean, R, blocks, range(10 * links, p)


def _is_real(w, blocks, friction):
    return all(is_consistent(w[list(block)]) for block in blocks) and (w[friction] >= 0.0).all()


@given(SEEDS)
@settings(max_examples=50)
def test_the_result_is_always_a_real_body(seed):
    """For any result of least squares."""
    _, mean, R, blocks, friction = _problem(seed)
    found = project_information(mean, R, blocks, nonnegative=friction)
    assert _is_real(found.coefficients, blocks, friction)


@given(SEEDS)
def test_a_consistent_estimate_stays_as_it_is(seed):
    """No bias where physics has nothing to say."""
    truth, _, R, blocks, friction = _problem(seed)
    found = project_information(truth, R, blocks, nonnegative=friction)
    assert found.was_consistent
    assert found.distance == 0.0
    assert np.allclose(found.coefficients, truth, rtol=1e-6, atol=1e-9)


@given(SEEDS)
@settings(max_examples=50)
def test_projection_never_moves_away_from_the_truth(seed):
    """A projection onto a convex set that holds the truth: nearer in the metric of the data."""
    truth, mean, R, blocks, friction = _problem(seed)
    found = project_information(mean, R, blocks, nonnegative=friction)
    before, after = (
        np.linalg.norm(R @ (mean - truth)),
        np.linalg.norm(R @ (found.coefficients - truth)),
    )
    assert after <= before * (1.0 + 1e-6) + 1e-6
    angle = (R @ (mean - found.coefficients)) @ (R @ (truth - found.coefficients))
    assert angle <= 1e-5 * (1.0 + before**2), 'no consistent point lies nearer in that direction'


@pytest.mark.long
@pytest.mark.parametrize('seed', range(4))
def test_projection_is_the_optimum_of_a_brute_force_search(seed):
    """One link, parametrised by a Cholesky factor of J, from many starts."""
    _, mean, R, blocks, _ = _problem(seed, links=1, error=0.6)
    mean, R = mean[:10], R[:, :10]
    found = project_information(mean, R, blocks)
    if found.was_consistent:
        mean = mean - 2.0 * random_body(seed)
        found = project_information(mean, R, blocks)
    assert not found.was_consistent
    rows, columns = np.tril_indices(4)

    def residual(entries):
        L = np.zeros((4, 4))
        L[rows, columns] = entries
        return R @ (inertial_parameters(L @ L.T) - mean)

    rng = np.random.default_rng(seed)
    fits = [
        optimize.least_squares(residual, 0.5 * rng.normal(size=10), xtol=1e-14, ftol=1e-14)
        for _ in range(12)
    ]
    best = min(2.0 * fit.cost for fit in fits)
    assert found.distance == pytest.approx(best, rel=1e-3)  # the margin costs the difference


def test_undetermined_directions_come_from_the_reference():
    """Directions that the data do not show are nominal; the others stay, to the digit."""
    truth, mean, R, blocks, friction = _problem(5, rank=7)
    found = project_information(mean, R, blocks, nonnegative=friction, reference=truth)
    assert np.allclose(R @ found.coefficients, R @ mean, atol=1e-6 * np.linalg.norm(R @ mean))
    nothing = project_information(mean, 0.0 * R, blocks, nonnegative=friction, reference=truth)
    assert np.allclose(nothing.coefficients, truth, rtol=1e-9)


@given(SEEDS)
@settings(max_examples=30)
def test_data_come_before_the_reference(seed):
    """A reference fills in, it does not pull away from what is feasible and fits better."""
    truth, mean, R, blocks, friction = _problem(seed, rank=15)
    other = np.concatenate([random_body(seed), random_body(seed + 1), np.ones(4)])
    found = project_information(mean, R, blocks, nonnegative=friction, reference=other)
    assert _is_real(found.coefficients, blocks, friction)
    assert found.distance <= np.sum((R @ (mean - truth)) ** 2) + 1e-2


@pytest.mark.parametrize('rank', [24, 9])
def test_covariance_and_information_say_the_same(rank):
    """Two ways to state one posterior, of full rank or not."""
    truth, mean, R, blocks, friction = _problem(8, rank=rank)
    scale = np.linalg.norm(R, axis=0)
    covariance = np.linalg.pinv(R / scale)
    covariance = (covariance @ covariance.T) / np.outer(scale, scale)
    null = linalg.null_space(R / scale) / scale[:, None]
    options = {'nonnegative': friction, 'reference': truth}
    one = project(mean, covariance, blocks, undetermined=null, **options)
    other = project_information(mean, R, blocks, **options)
    assert one.distance == pytest.approx(other.distance, rel=1e-5, abs=1e-5)
    assert np.allclose(one.coefficients, other.coefficients, atol=1e-5)


def test_a_singular_covariance_needs_its_undetermined_directions():
    """Zero variance may mean well known or unknown: the caller says which."""
    with pytest.raises(NumericalError, match='singular'):
        project(np.ones(10), np.diag([1.0] * 9 + [0.0]), [range(10)])


def test_a_reference_without_inertias_will_do():
    """Many robot files hold zeros; a ball of the size of the estimate takes their place."""
    _, mean, R, blocks, friction = _problem(11, rank=12)
    empty = np.zeros_like(mean)
    found = project_information(mean, R, blocks, nonnegative=friction, reference=empty)
    assert _is_real(found.coefficients, blocks, friction)


def test_units_do_not_matter():
    """Millimetres and grams give the same body."""
    _, mean, R, blocks, _ = _problem(13, links=1)
    mean, R = mean[:10] - 2.0 * random_body(1), R[:, :10]
    unit = 1e3 * np.array([1.0] + 3 * [1e3] + 6 * [1e6])
    reference = random_body(1)
    one = project_information(mean, R, blocks, reference=reference)
    other = project_information(mean * unit, R / unit, blocks, reference=reference * unit)
    assert not one.was_consistent
    scale = np.abs(one.coefficients).max()
    assert np.allclose(other.coefficients / unit, one.coefficients, atol=1e-6 * scale)
    assert np.linalg.eigvalsh(pseudo_inertia(one.coefficients))[0] > 0.0


def test_a_solver_that_does_not_converge_is_an_error_in_one_line(monkeypatch):
    """No half-solved parameters."""
    make = consistent.clarabel.DefaultSettings

    def impatient():
        settings = make()
        settings.max_iter = 1
        return settings

    monkeypatch.setattr(consistent.clarabel, 'DefaultSettings', impatient)
    _, mean, R, blocks, friction = _problem(3)
    with pytest.raises(NumericalError, match='MaxIterations') as caught:
        project_information(-mean, R, blocks, nonnegative=friction)
    assert '\n' not in str(caught.value)


def test_shapes_that_do_not_fit_are_refused():
    """Ten columns a link."""
    with pytest.raises(ValueError, match='blocks'):
        project_information(np.ones(10), np.eye(10), [range(9)])
