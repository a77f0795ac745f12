"""What models leave of parts of the recording left out of their fit."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.diagnosis.decide.decision import NATS, ROWS, Scale, _supported, decide
from sgp_ros.diagnosis.decide.second_opinion import left_out, support
from sgp_ros.diagnosis.explain.hypotheses import Competition
from sgp_ros.diagnosis.explain.suspects import Columns
from sgp_ros.diagnosis.parts import PARTS, PIECES, parts_of
from test.diagnosis.fitted_models import fitted
from test.diagnosis.worlds import CHAINS, simulate


@pytest.fixture(scope='module')
def damped(equations_for, viscous):
    return equations_for(viscous)[1]


def test_every_part_is_a_sixth_in_stretches_over_the_recording():
    part = parts_of(2400)
    assert np.all(np.bincount(part) == 2400 // PARTS)
    assert np.count_nonzero(np.diff(part)) == PARTS * PIECES - 1
    assert set(parts_of(25)) == set(range(PARTS))


@pytest.mark.parametrize('is_free', [False, True])
def test_parts_are_predicted_by_a_fit_to_the_others(damped, is_free):
    """As least squares on the rows that remain, written out."""
    model = fitted(damped, 'viscous_friction', 'spring', is_free=is_free)
    columns = Columns(damped)
    found = left_out(columns, model, model.suspects)
    x = [columns.of(s, damped, model.w)[:, 0] for s in model.suspects]
    p = damped.base.shape[2] if is_free else 0
    A = np.concatenate([damped.base[:, 0, :p], *x], axis=1) / model.sigma[0]
    y, part = damped.d[:, 0] / model.sigma[0], parts_of(len(damped.d))
    prior = np.eye(p, A.shape[1])
    for i in range(PARTS):
        rows = part != i
        c = np.linalg.lstsq(
            np.concatenate([A[rows], prior]), np.concatenate([y[rows], np.zeros(p)]), rcond=None
        )[0]
        left = (y[~rows] - A[~rows] @ c) * model.sigma[0]
        assert found[i, 0] == pytest.approx(np.mean(left**2), rel=1e-3)


def test_an_effect_that_is_there_has_support_and_one_beside_it_none(damped):
    floor = 1e-5 * damped.power
    model = fitted(damped, 'viscous_friction', 'cogging')
    there, beside = support(Columns(damped), model, floor)
    assert ROWS * there > 10.0 * NATS
    assert ROWS * beside < NATS


def test_a_model_with_an_effect_without_support_gives_way(damped):
    """To the next of which every effect predicts parts left out; to none where there is none."""
    bases = (fitted(damped, is_free=f) for f in (False, True))
    rich, right = (
        fitted(damped, *names)
        for names in (('viscous_friction', 'cogging'), ('viscous_friction',))
    )
    scale = Scale.of(damped, Competition(*bases, (right,), (rich,)))
    assert _supported(damped, scale, [rich, right]) is right
    assert _supported(damped, scale, [rich]) is None


def test_an_effect_without_support_is_not_asserted(equations_for):
    """A push in one stretch, which a periodic force fits a little and predicts nowhere else."""
    world = simulate(
        CHAINS[1], 5, 10.0, force=lambda t, q, v: (1.5 if 4.0 < t < 4.3 else 0.0,)
    )  # fmt: skip
    _, equations = equations_for(world)
    bases = (fitted(equations, is_free=f) for f in (False, True))
    model = fitted(equations, 'constant_load')
    competition = Competition(*bases, (model,), ())
    scale = Scale.of(equations, competition)
    gain = support(Columns(equations), model, scale.floor * scale.power)
    assert scale.rows * gain[0] < NATS
    decision = decide(equations, competition)
    assert decision.verdict != 'missing_physics'
    assert decision.tentative is None
