"""Laws of fits of hyper-parameters: what is put in force predicts no worse than what was."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.engine import fitting
from sgp_ros.engine.fitting import FitRequest, fit
from sgp_ros.gp.kernels import SquaredExponential
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
    errors = Posterior(model, request.data, prior).left_out_errors()
    return (errors**2).mean(axis=0)


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
