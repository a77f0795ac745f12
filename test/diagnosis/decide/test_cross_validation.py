"""How much of what a model leaves is no noise, and what parts left out say of an effect."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.diagnosis.criteria import EVIDENCE, INDEPENDENT_ROWS
from sgp_ros.diagnosis.decide import cross_validation
from sgp_ros.diagnosis.decide.cross_validation import (
    LEAST_ROWS,
    repeatable,
    structure,
    supported,
)
from sgp_ros.diagnosis.decide.decision import decide
from sgp_ros.diagnosis.decide.scale import Scale
from sgp_ros.diagnosis.decide.support import left_out, support
from sgp_ros.diagnosis.explain.comparison import Comparison
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.locate.remainder import PARTS, PIECES, parts_of
from test.diagnosis.fitted_models import fitted
from test.diagnosis.worlds import CHAINS, simulate


@pytest.fixture(scope='module')
def equations(equations_for):
    return equations_for(simulate(CHAINS[2], 7, 30.0))[1]


def _white(equations, seed=0):
    return np.random.default_rng(seed).normal(size=equations.d.shape) * np.sqrt(equations.power)


@pytest.mark.parametrize('seed', range(5))
def test_white_noise_has_little_structure(equations, seed):
    """No more than a twentieth above its own uncertainty."""
    found = structure(equations, _white(equations, seed))
    assert found.shape == (2,)
    assert np.all(found < 0.05 + 1.0 / np.sqrt(len(equations.d)))


def test_a_function_of_the_motion_is_structure(equations):
    """Nearly all of it, though its neighbours in time say nothing."""
    q = equations.motion.position[equations.filter.rows]
    rest = np.sin(6.0 * q) * np.sqrt(equations.power)
    assert np.all(structure(equations, rest) > 0.9)


def test_noise_on_top_of_a_function_counts_as_noise(equations):
    """Of equal power each: half."""
    q = equations.motion.position[equations.filter.rows]
    rest = _white(equations) + np.sqrt(2.0 * equations.power) * np.sin(3.0 * q)
    found = structure(equations, rest)
    assert np.all((found > 0.2) & (found < 0.7))


def test_what_its_own_past_predicts_is_structure(equations):
    """Though it has nothing to do with the motion."""
    rows = np.arange(len(equations.d))[:, None]
    for period in (31.0, 4.1):  # a quarter of a period on, a sine has no correlation
        rest = np.sin(2.0 * np.pi * rows / period) * np.sqrt(equations.power)
        assert np.all(structure(equations, rest) > 0.9)


def test_what_follows_the_motion_later_is_structure(equations, monkeypatch):
    """As states that nobody measures do, though the motion at the time says nothing of it."""
    monkeypatch.setattr(cross_validation, '_by_motion', lambda *_: 0.0)
    monkeypatch.setattr(cross_validation, '_by_past', lambda *_: 0.0)
    rest = np.roll(equations.filter(equations.motion.acceleration), 5, axis=0)
    every = np.ones(2, dtype=bool)
    assert np.all(repeatable(equations, rest, every)[0] > 0.9)
    assert np.all(repeatable(equations, _white(equations), every)[0] < 0.1)
    few = replace(equations, d=equations.d[:LEAST_ROWS])  # too few for any response
    assert not cross_validation._by_response(few, few.d[:5]).any()
    settled = replace(equations, motion=replace(equations.motion, is_static=True))
    assert not cross_validation._by_response(settled, rest).any()


def test_filtered_white_noise_predicts_nothing_of_itself(equations):
    """Though rows behind a low-pass are correlated."""
    white = np.random.default_rng(5).normal(size=equations.motion.effort.shape)
    rest = equations.filter(white * np.sqrt(equations.power))
    assert float(rest[1:, 0] @ rest[:-1, 0]) > 0.3 * float(rest[:, 0] @ rest[:, 0])
    assert np.all(structure(equations, rest) < 0.15)


def test_an_effort_does_not_explain_itself(equations):
    """A rest that is the measured effort, of which the motion shows nothing, is noise."""
    motion = replace(equations.motion, effort=_noise_at_full_rate(equations))
    loaded = replace(equations, motion=motion)
    assert np.all(structure(loaded, loaded.filter(motion.effort)) < 0.1)


def _noise_at_full_rate(equations):
    white = np.random.default_rng(4).normal(size=equations.motion.effort.shape)
    return white * np.sqrt(equations.power)


def test_of_few_rows_no_structure_is_known(equations):
    rows = LEAST_ROWS - 1
    assert np.all(structure(equations, _white(equations)[:rows]) == 1.0)


def test_a_joint_that_leaves_next_to_nothing_is_not_looked_at(equations):
    rest = _white(equations) * np.array([1.0, 1e-3])
    found = structure(equations, rest)
    assert found[0] < 0.2
    assert found[1] == 1.0
    assert np.all(structure(equations, np.zeros_like(rest)) == 1.0)


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
    (found,), (unlikely,) = left_out(columns, model, (None,))
    x = [columns.of(s, damped, model.w)[:, 0] for s in model.effects]
    p = damped.base.shape[2] if is_free else 0
    A = np.concatenate([damped.base[:, 0, :p], *x], axis=1) / model.sigma[0]
    y, part = damped.d[:, 0] / model.sigma[0], parts_of(len(damped.d))
    prior, priors = np.sqrt(model.frame.weight) * np.eye(p, A.shape[1]), []
    for i in range(PARTS):
        rows = part != i
        c = np.linalg.lstsq(
            np.concatenate([A[rows], prior]), np.concatenate([y[rows], np.zeros(p)]), rcond=None
        )[0]
        left = (y[~rows] - A[~rows] @ c) * model.sigma[0]
        assert found[i, 0] == pytest.approx(np.mean(left**2), rel=1e-3)
        priors.append(0.5 * c[:p] @ c[:p])
    assert unlikely == pytest.approx(np.mean(priors), rel=1e-3)


def test_a_law_is_left_out_with_or_without_coefficients(damped):
    """As least squares on the rows that remain, with the force of a given law taken off."""
    model = fitted(damped, 'viscous_friction', 'command_delay')
    rubs, late = model.effects
    assert [s.effect.is_given for s in (late, rubs)] == [True, False]
    columns, part = Columns(damped), parts_of(len(damped.d))
    x, given = (columns.of(s, damped)[:, 0, 0] for s in (rubs, late))
    y = damped.d[:, 0]
    found, _ = left_out(columns, model, (None, rubs, late))
    for left, b, d in zip(found, (x, 0.0 * x, x), (y - given, y - given, y), strict=True):
        for i in range(PARTS):
            here = part == i
            c = b[~here] @ d[~here] / max(b[~here] @ b[~here], 1e-300)
            rest = d[here] - c * b[here]
            assert left[i, 0] == pytest.approx(np.mean(rest**2), rel=1e-6)


def test_an_effect_that_is_there_has_support_and_one_beside_it_none(damped):
    floor = 1e-5 * damped.power
    model = fitted(damped, 'viscous_friction', 'cogging')
    there, beside = support(Columns(damped), model, floor, INDEPENDENT_ROWS)
    assert there > 10.0 * EVIDENCE
    assert beside < EVIDENCE


def test_a_model_with_an_effect_without_support_gives_way(damped):
    """To the next of which every effect predicts parts left out; to none where there is none."""
    bases = (fitted(damped, is_free=f) for f in (False, True))
    rich, right = (
        fitted(damped, *names)
        for names in (('viscous_friction', 'cogging'), ('viscous_friction',))
    )
    scale = Scale.of(damped, Comparison(*bases, (right,), (rich,)))
    assert supported(damped, scale, [rich, right]) is right
    assert supported(damped, scale, [rich]) is None


def test_a_model_that_lost_an_effect_is_compared_again(damped, monkeypatch):
    """The next one is worth more than what is left of the first, and is supported as it is."""
    rich = fitted(damped, 'viscous_friction', 'cogging', 'armature')
    next_one = fitted(damped, 'viscous_friction')
    left = fitted(damped, 'quadratic_drag')
    worth, pruned = {rich: 3.0, next_one: 2.0, left: 1.0}, {rich: left, next_one: next_one}
    bases = (fitted(damped, is_free=f) for f in (False, True))
    scale = Scale.of(damped, Comparison(*bases, (), ()))
    monkeypatch.setattr(Scale, 'worth', lambda _self, model: worth[model])
    monkeypatch.setattr(cross_validation, '_pruned', lambda _columns, _scale, model: pruned[model])
    assert supported(damped, scale, [rich]) is left
    assert supported(damped, scale, [rich, next_one]) is next_one


def test_a_plain_law_may_stay_where_a_richer_one_says_as_much(equations_for, dry, monkeypatch):
    """Each predicts nothing beside the other; the plain one knows that friction holds a joint."""
    equations = equations_for(dry)[1]
    rich = fitted(equations, 'coulomb_friction', 'hysteresis', 'armature')
    bases = (fitted(equations, is_free=f) for f in (False, True))
    scale = Scale.of(equations, Comparison(*bases, (), (rich,)))

    def supports(_columns, model, *_):
        return np.array([0.0 if 'hysteresis' in named(model) else 100.0 for _ in model.effects])

    def named(model):
        return {s.name for s in model.effects}

    monkeypatch.setattr(cross_validation, 'support', supports)
    monkeypatch.setattr(cross_validation, 'is_credible', lambda _model: True)
    assert named(supported(equations, scale, [rich])) == {'coulomb_friction', 'armature'}


def test_an_effect_without_support_is_not_asserted(equations_for):
    """A push in one stretch, which a periodic force fits a little and predicts nowhere else."""
    world = simulate(
        CHAINS[1], 5, 10.0, force=lambda t, q, v: (1.5 if 4.0 < t < 4.3 else 0.0,)
    )  # fmt: skip
    _, equations = equations_for(world)
    bases = (fitted(equations, is_free=f) for f in (False, True))
    model = fitted(equations, 'constant_load')
    comparison = Comparison(*bases, (model,), ())
    scale = Scale.of(equations, comparison)
    gain = support(Columns(equations), model, scale.floor * scale.power, scale.rows)
    assert gain[0] < EVIDENCE
    decision = decide(equations, comparison)
    assert decision.verdict != 'missing_physics'
    assert decision.tentative is None
