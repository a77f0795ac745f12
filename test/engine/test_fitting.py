"""Laws of fits of hyper-parameters: what is put in force predicts no worse than what was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.engine import fitting
from sgp_ros.engine.fitting import STRETCHES, FitRequest, FitResult, fit, left_out_errors
from sgp_ros.gp.kernels import SquaredExponential
from sgp_ros.gp.learning import LearnedModel
from sgp_ros.gp.model import CoefficientPrior, Model, Observations
from sgp_ros.gp.posterior import Posterior

MOVING, RESTING = 40, 200


def _request(outputs=1):
    """A buffer of a motion and a rest: the last samples repeat one another nearly exactly."""
    rng = np.random.default_rng(2)
    n = MOVING + RESTING
    u = rng.uniform(-3.0, 3.0, size=(n, 1))
    u[MOVING:] = 2.5 + 1e-4 * rng.normal(size=(RESTING, 1))
    y = np.sin(2.0 * u) + 0.3 * rng.normal(size=(n, outputs))
    y[MOVING:, 0] = np.sin(5.0) + 1e-7 * rng.normal(size=RESTING)
    kernel = SquaredExponential.of_values([1.0, 1.0], (0,))
    model = Model((kernel,) * outputs, (0.09, 0.01)[:outputs])
    data = Observations(u, rng.normal(size=(n, outputs, 1)) * 1e-3, y)
    return FitRequest(0, data, np.eye(1), np.zeros(1), model, 1, 0)


def _left_out(model, request):
    prior = CoefficientPrior(request.base_root, request.base_target, 0.0)
    return (left_out_errors(model, request.data, prior) ** 2).mean(axis=0)


def test_rest_does_not_make_a_model_that_knows_it_by_heart(monkeypatch):
    """The evidence alone would take it."""
    request = _request()
    found = fit(request)
    assert found.is_worse
    assert found.refusal == 'no_better'
    assert found.log_evidence > found.log_evidence_before
    monkeypatch.setattr(fitting, 'WORSE', np.inf)
    collapsed = fit(request)
    assert collapsed.refusal == ''
    assert collapsed.model.noise[0] < 1e-4
    assert _left_out(collapsed.model, request) > 2.0 * _left_out(request.model, request)


def test_neighbours_in_time_do_not_vouch_for_a_model_that_knows_them_by_heart(monkeypatch):
    """Each sample of a slow motion is known by those beside it. The next best fit is taken."""
    request = _request()
    u = 2.5 + 1e-2 * np.linspace(0.0, 1.0, RESTING)[:, None]
    y = np.sin(5.0) + 1e-2 * np.sin(2.0 * np.pi * np.arange(RESTING) / 20.0)[:, None]
    data = Observations(u, np.zeros((RESTING, 1, 1)), y)
    by_heart = Model((SquaredExponential.of_values([1.0, 2e-4], (0,)),), (1e-6,))
    prior = CoefficientPrior(np.eye(1), np.zeros(1), 0.0)
    before = Posterior(request.model, data, prior)
    learned = LearnedModel(by_heart, Posterior(by_heart, data, prior).log_evidence, 1, 0)
    assert learned.log_evidence > before.log_evidence
    assert fitting._predicting([learned], before)[2]
    modest = LearnedModel(Model(request.model.kernels, (0.08,)), 0.0, 1, 0)
    model, _, is_worse = fitting._predicting([learned, modest], before)
    assert not is_worse
    assert model == modest.model
    monkeypatch.setattr(fitting, 'STRETCHES', len(data.U))
    assert not fitting._predicting([learned], before)[2]


@pytest.mark.parametrize('n', [3, 25])
@pytest.mark.parametrize('is_flat', [False, True])
def test_a_stretch_does_not_enter_its_own_prediction(n, is_flat):
    """Its errors follow its own values one to one, and those of no other stretch."""
    rng = np.random.default_rng(n)
    kernel = SquaredExponential.of_values([1.0, 1.0], (0,))
    model = Model((kernel, None), (0.1, 0.2))
    U, F = rng.normal(size=(n, 1)), rng.normal(size=(n, 2, 1))
    y = rng.normal(size=(n, 2))
    root = np.eye(1)[int(is_flat) :]
    prior = CoefficientPrior(root, np.zeros(len(root)), 0.0)
    for kind in (model, None):
        found = left_out_errors(kind, Observations(U, F, y), prior)
        part = np.array_split(np.arange(n), min(STRETCHES, n))[0]
        other = y.copy()
        other[part] += 1.0
        moved = left_out_errors(kind, Observations(U, F, other), prior) - found
        assert np.isfinite(found[part]).all()
        np.testing.assert_allclose(moved[part], 1.0)
        alone = Observations(U[:1], F[:1], y[:1])
        assert np.isnan(left_out_errors(kind, alone, prior)).all()


def test_a_stretch_that_alone_determines_a_coefficient_has_no_error():
    rng = np.random.default_rng(0)
    F = rng.normal(size=(20, 1, 2))
    F[:, :, 1] = 0.0
    F[4, :, 1] = 1.0
    data = Observations(np.zeros((20, 1)), F, rng.normal(size=(20, 1)))
    flat = CoefficientPrior(np.zeros((0, 2)), np.zeros(0), 0.0)
    found = left_out_errors(Model((None,), (0.1,)), data, flat)
    assert np.flatnonzero(np.isnan(found[:, 0])).tolist() == [4]


def test_an_output_keeps_what_it_had_where_others_gain():
    """Of two joints one rests; the other one takes what was found for it."""
    request = _request(outputs=2)
    found = fit(request)
    assert found.refusal == ''
    assert found.model.kernels[0] == request.model.kernels[0]
    assert found.model.noise[0] == request.model.noise[0]
    assert found.model.noise[1] != request.model.noise[1]
    before = _left_out(request.model, request)
    assert (_left_out(found.model, request) <= fitting.WORSE * before).all()


@pytest.mark.parametrize('seed', range(3))
def test_a_motion_is_fitted_as_before(seed):
    request = _request()
    rng = np.random.default_rng(seed)
    data = Observations(
        rng.uniform(-3.0, 3.0, size=(60, 1)), np.zeros((60, 1, 1)), np.zeros((60, 1))
    )
    data.y[:] = np.sin(2.0 * data.U) + 0.05 * rng.normal(size=(60, 1))
    found = fit(FitRequest(0, data, np.eye(1), np.zeros(1), request.model, 1, 0))
    assert found.refusal == ''
    assert found.model.noise[0] == pytest.approx(0.05**2, rel=0.6)


def _arm(k, n, rank_deficient):
    """Joints of a tree: each has the coefficients of its own body and of those further out."""
    rng = np.random.default_rng(k)
    p = 3 * k
    U = rng.normal(size=(n, k))
    F = rng.normal(size=(n, k, p))
    for j in range(k):
        F[:, j, : 3 * j] = 0.0
    if rank_deficient:
        F[..., 2::3] = F[..., 1::3]
    noise = rng.uniform(0.05, 0.3, size=k)
    y = F @ rng.normal(size=p) + 0.5 * np.sin(2.0 * U) + noise * rng.normal(size=(n, k))
    kernels = tuple(SquaredExponential.of_values([1.0, 1.0], (j,)) for j in range(k))
    model = Model(kernels, (0.2,) * k)
    return FitRequest(0, Observations(U, F, y), np.zeros((p, p)), np.zeros(p), model, 0, 0)


@pytest.mark.parametrize('rank_deficient', [False, True])
def test_outputs_fitted_in_turn_raise_the_evidence_of_all(rank_deficient, monkeypatch):
    """The gain that the fit claims is that of the evidence of the whole, to rounding."""
    request = _arm(4, 30, rank_deficient)
    monkeypatch.setattr(fitting, 'TOGETHER', 1)
    found = fit(request)
    assert found.refusal == ''
    prior = CoefficientPrior.flat(12)
    before, after = (
        Posterior(model, request.data, prior).log_evidence
        for model in (request.model, found.model)
    )
    gained = found.log_evidence - found.log_evidence_before
    assert gained == pytest.approx(after - before, rel=1e-6)
    monkeypatch.setattr(fitting, 'TOGETHER', 10)
    together = fit(request)
    assert after - before > 0.9 * (together.log_evidence - together.log_evidence_before)


def test_of_many_outputs_every_one_has_its_turn(monkeypatch):
    """A fit takes as many as its rows allow; the others keep what they had."""
    monkeypatch.setattr(fitting, 'TOGETHER', 1)
    monkeypatch.setattr(fitting, 'ROWS', 2 * 30)
    seen = []

    def watch(request):
        seen.append(round(float(request.data.y[0, 0]), 9))
        return FitResult(request.number, request.model, 0.0, 0.0, 1)

    monkeypatch.setattr(fitting, '_fit_together', watch)
    request = _arm(5, 30, rank_deficient=False)
    for number in range(3):
        assert fit(replace(request, number=number)).refusal == 'no_better'
        assert len(seen) == 2 * (number + 1)
    assert set(seen) == {round(float(y), 9) for y in request.data.y[0]}
