"""Predictions of the final model, and its bodies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.fitted_model import extra_force, floors, imbalance
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.prove.prediction import FinalModel, accelerations, diagnosed_bodies
from sgp_ros.diagnosis.prove.proof import prove
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import Place
from sgp_ros.rigid.pseudo_inertia import is_consistent
from test.diagnosis.fitted_models import with_coefficients
from test.diagnosis.worlds import CHAINS, simulate

INNER = slice(80, -80)


def _fitted(equations, *candidates, is_free=False):
    start = np.sqrt((equations.d**2).mean(axis=0) + floors(equations))
    return fit(Columns(equations), candidates, start, is_free=is_free)


def _candidate(name, joint):
    return EffectAt(EFFECTS[name], Place(joint), np.zeros(0))


def _error(found, true):
    """Share of the variance that held commands, averaged by a hat, leave at their jumps."""
    return ((found - true)[INNER] ** 2).mean(axis=0) / true[INNER].var(axis=0)


def _low(equations, x):
    return equations.filter(x)


@pytest.mark.parametrize('k', [1, 2])
def test_the_true_model_predicts_the_true_acceleration(robots, equations_for, perfect, k):
    """Both through the same low-pass; commands jump between the samples."""
    raw, equations = equations_for(perfect[k])
    model = _fitted(equations)
    final = FinalModel(model, model, equations, ())
    found = final.predict(raw, robots[k][1])
    np.testing.assert_allclose(found.time, perfect[k].time, atol=1e-9)
    low = equations.filter
    # a state is taken when a command begins: the mean of both sides is what the hat sees
    true = perfect[k].acceleration.copy()
    error = low(found.acceleration) - low(true)
    assert np.all((error**2).mean(axis=0) < 0.01 * low(true).var(axis=0))


def test_the_prediction_does_not_depend_on_the_measured_acceleration(equations_for, heavy):
    """The equation of motion is affine in it, also with other bodies."""
    _, equations = equations_for(heavy[2])
    model = _fitted(equations, _candidate('armature', 1), is_free=True)
    motion = equations.motion
    rests = np.zeros(motion.position.shape, dtype=bool)
    plain = accelerations(model, equations, motion, rests)
    rng = np.random.default_rng(0)
    other = replace(motion, acceleration=rng.normal(0.0, 20.0, plain.shape))
    np.testing.assert_allclose(
        accelerations(model, equations, other, rests), plain, rtol=1e-7, atol=1e-7
    )
    balanced = replace(motion, acceleration=plain)
    assert np.abs(imbalance(model, equations, balanced)).max() < 1e-8


def test_a_joint_that_friction_holds_does_not_accelerate(equations_for, dry):
    """In the middle of its rests; where it slides, friction brakes."""
    _, equations = equations_for(dry)
    model = _fitted(equations, _candidate('coulomb_friction', 0))
    assert model.effects[0].coefficients[0] == pytest.approx(1.2, rel=0.02)
    motion, rests = equations.motion, equations.rests
    a = accelerations(model, equations, motion, rests)
    still = rests[:, 0] & (dry.velocity[:, 0] == 0.0) & (dry.acceleration[:, 0] == 0.0)
    assert still.sum() > 20
    free = accelerations(model, equations, motion, np.zeros_like(rests))
    assert np.median(np.abs(a[still])) < 1e-6
    assert np.median(np.abs(free[still])) > 0.1
    sliding = np.abs(motion.velocity[:, 0]) > 0.3
    force = extra_force(model, motion)[sliding, 0]
    np.testing.assert_allclose(force, -model.effects[0].coefficients[0] * np.sign(
        motion.velocity[sliding, 0]))  # fmt: skip


def test_the_proof_measures_what_an_effect_takes_away(robots, equations_for, viscous):
    """Before: the nominal robot; after: a rest of a ten-thousandth."""
    raw, equations = equations_for(viscous)
    nominal = _fitted(equations)
    model = _fitted(equations, _candidate('viscous_friction', 0))
    proof = prove(FinalModel(model, nominal, equations, ()), raw, robots[1][1], 'train')
    before, after = proof.nmse_before['joint0'], proof.nmse_after['joint0']
    direct = (equations.d**2).mean() / equations.filter(equations.motion.effort).var()
    assert before == pytest.approx(direct, rel=0.02)
    assert after < 1e-4
    assert proof.acceleration_after['joint0'] < 0.01 * proof.acceleration_before['joint0']
    assert proof.nlpd_after < proof.nlpd_before


def test_every_number_of_a_proof_comes_with_its_interval(robots, equations_for, viscous):
    """Which holds it, and is narrow where the recording is long."""
    raw, equations = equations_for(viscous)
    model = _fitted(equations, _candidate('viscous_friction', 0))
    proof = prove(FinalModel(model, _fitted(equations), equations, ()), raw, robots[1][1], 'train')
    numbers = {
        'nmse_before': proof.nmse_before, 'nmse_after': proof.nmse_after,
        'acceleration_nmse_before': proof.acceleration_before,
        'acceleration_nmse_after': proof.acceleration_after,
        'rollout_nmse_before': proof.rollout_before, 'rollout_nmse_after': proof.rollout_after,
    }  # fmt: skip
    assert proof.intervals.keys() == numbers.keys()
    for name, table in numbers.items():
        low, high = proof.intervals[name]['joint0']
        assert 0.0 < low < table['joint0'] < high < 10.0 * low
    for value, (low, high) in zip(
        (proof.nlpd_before, proof.nlpd_after), proof.nlpd_intervals, strict=True
    ):
        assert low < value < high


def test_roll_outs_show_what_an_effect_takes_away(robots, equations_for, viscous):
    """Of ten seconds, about thirty; all end."""
    raw, equations = equations_for(viscous)
    model = _fitted(equations, _candidate('viscous_friction', 0))
    proof = prove(FinalModel(model, _fitted(equations), equations, ()), raw, robots[1][1], 'train')
    assert 25 < proof.rollouts <= 33
    assert proof.failed == 0
    assert proof.rollout_after['joint0'] < 1e-3 * proof.rollout_before['joint0']


def test_both_models_are_judged_on_the_roll_outs_that_both_finish(robots, equations_for, viscous):
    """Where one runs away the other gains nothing: counted, and in neither mean."""
    raw, equations = equations_for(viscous)
    model = _fitted(equations, _candidate('quadratic_drag', 0))
    mad = with_coefficients(model, np.array([-1e5]))
    proof = prove(FinalModel(model, mad, equations, ()), raw, robots[1][1], 'train')
    assert proof.failed > 0
    turned = prove(FinalModel(mad, model, equations, ()), raw, robots[1][1], 'train')
    assert turned.failed == proof.failed
    assert turned.rollout_before == proof.rollout_after
    assert all(map(np.isfinite, proof.rollout_before.values()))
    assert (not proof.rollout_after) == (proof.failed == proof.rollouts)


def test_states_beyond_those_learned_from_are_far(robots, equations_for, perfect):
    """States learned from have no distance."""
    raw, equations = equations_for(perfect[1])
    model = _fitted(equations)
    final = FinalModel(model, model, equations, ())
    assert prove(final, raw, robots[1][1], 'train').distance < 0.01
    wide, _ = equations_for(simulate(CHAINS[1], 5, 5.0, reach=6.0))
    assert prove(final, wide, robots[1][1], 'wide').distance > 0.3


@pytest.fixture(scope='module')
def equations(equations_for, perfect):
    return equations_for(perfect[2])[1]


def _model(equations, *, is_free):
    start = np.sqrt((equations.d**2).mean(axis=0)) + 1e-9
    return fit(Columns(equations), (), start, is_free=is_free, rounds=1)


def test_bodies_that_were_not_free_are_the_nominal_ones(equations):
    assert diagnosed_bodies(equations, _model(equations, is_free=False)) is None


def test_bodies_that_can_exist_are_those_of_the_model(equations):
    model = _model(equations, is_free=True)
    small = replace(model, w=np.full(len(model.w), 0.01))
    nominal = equations.motion.tree.parameters
    expected = nominal + (small.w @ equations.directions).reshape(nominal.shape)
    np.testing.assert_allclose(diagnosed_bodies(equations, small), expected, atol=1e-12)


def test_bodies_that_cannot_exist_are_replaced_by_such_as_can(equations):
    """Near in what the data show: the projection costs less than nominal bodies would."""
    model = _model(equations, is_free=True)
    wild = replace(model, w=model.w + 0.0)
    wild.w[0] = -6.0  # a negative mass: six times a quarter less
    found = diagnosed_bodies(equations, wild)
    assert np.all(is_consistent(found))
    change = (found - equations.motion.tree.parameters).ravel()
    w = np.linalg.solve(equations.directions.T, change)
    R = model.frame.R
    assert np.linalg.norm(R @ (w - wild.w)) < np.linalg.norm(R @ wild.w)
