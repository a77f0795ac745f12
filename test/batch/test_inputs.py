"""Laws of the choice of what Z sees by held-out stretches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_proof.columns import acceleration, single_column
from sgp_ros.batch.fit import fit_offline
from sgp_ros.batch.inputs import CANDIDATES, choose_inputs
from sgp_ros.batch.regression_data import FilteredData, FilterPlan, filtered_data
from sgp_ros.errors import ConfigError
from sgp_ros.gp.learning import learn
from sgp_ros.physics.term import Coefficient, Joint, Motion
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.robot import Robot
from test.batch.worlds import moved_axis

LINEAR_AXIS = load_robot('linear_axis')
REACTION_WHEEL = load_robot('reaction_wheel')

PLAN = FilterPlan(4.0, 20.0, 25)
SMOOTH_AXIS = replace(LINEAR_AXIS, terms=(*LINEAR_AXIS.terms[:2], LINEAR_AXIS.terms[3]))
"""Without a column for dry friction."""
WORLDS = 5

SLIDER = Robot(
    name='slider',
    joints=(Joint('slide', kind='prismatic'),),
    target='effort',
    terms=(single_column(Coefficient('mass', 'kg', 'slide'), 0, acceleration(0), 'Newton'),),
    residual_inputs=(('position:slide', 'velocity:slide'),),
)


def _data(seed, extra, n=240, memory=0.0):
    """Return rows of a mass of 2 kg under noise of 0.1 N and a force that the physics lacks."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) / 20.0
    rate, phase = rng.uniform(0.5, 3.0, size=4), rng.uniform(0.0, 6.0, size=4)
    angle = np.outer(t, rate) + phase
    q, v = np.sin(angle).sum(axis=1), (rate * np.cos(angle)).sum(axis=1)
    a = -(rate**2 * np.sin(angle)).sum(axis=1)
    noise = rng.normal(size=n)
    for i in range(1, n):
        noise[i] = memory * noise[i - 1] + np.sqrt(1.0 - memory**2) * noise[i]
    y = 2.0 * a + extra(q, v) + 0.1 * noise
    motion = Motion(*(x[:, None] for x in (q, v, a, y)))
    F = SLIDER.regressor(motion)
    return FilteredData(t, SLIDER.inputs(motion), F, y[:, None], 20.0, np.zeros(n, dtype=np.int64))


def test_dry_friction_is_seen_as_a_function_of_the_direction():
    """And the fit with it predicts better than the physics alone."""
    data = _data(0, lambda _q, v: 0.8 * np.tanh(v / 0.02))
    choice = choose_inputs(data, SLIDER)
    assert choice.names == (('own:direction',),)
    asked = _data(1, lambda _q, v: 0.8 * np.tanh(v / 0.02))
    errors = [
        (
            (fit_offline(data, SLIDER, method, choice.inputs).predict(asked)[0] - asked.y) ** 2
        ).mean()
        for method in ('PR', 'SGP')
    ]
    assert errors[1] < 0.1 * errors[0]


def test_friction_that_depends_on_the_place_is_seen_so():
    """Position and direction together, neither alone."""
    data = _data(2, lambda q, v: 2.0 * np.maximum(q, 0.0) * np.tanh(v / 0.02))
    assert choose_inputs(data, SLIDER).names == (('own:position', 'own:direction'),)


@pytest.mark.long
def test_complete_physics_keeps_no_process_even_under_coloured_noise():
    """Six worlds: a level of 5 % lets one pass now and then, evidence would take most of them."""
    worlds = [_data(seed, lambda q, _v: 0.0 * q, 160, 0.9) for seed in range(6)]
    assert sum(bool(choose_inputs(world, SLIDER).names[0]) for world in worlds) <= 1


def test_the_first_candidate_is_no_process():
    """Its error is that of the physics alone, and columns lead back to names."""
    data = _data(3, lambda _q, v: 0.3 * v)
    choice = choose_inputs(data, SLIDER)
    assert CANDIDATES[0] == ()
    assert choice.errors.shape == (len(CANDIDATES), 1)
    assert choice.inputs == SLIDER.residual_columns(choice.names[0])


def _axis(robot, seed=0, seconds=40.0, **choices):
    return filtered_data(moved_axis(seed, duration=seconds, **choices), robot, PLAN)


@pytest.mark.parametrize('colour', [0.0, 0.9])
def test_complete_physics_gets_no_process(colour):
    """In no world, whether its noise is white or not."""
    worlds = [_axis(LINEAR_AXIS, seed, seconds=20.0, colour=colour) for seed in range(WORLDS)]
    assert [choose_inputs(world, LINEAR_AXIS).names for world in worlds] == [((),)] * WORLDS


def test_the_choice_does_not_depend_on_the_unit_of_the_effort():
    data = _axis(SMOOTH_AXIS, seed=1, seconds=20.0)
    scaled = replace(data, y=1000.0 * data.y, F=1000.0 * data.F)
    names = [choose_inputs(each, SMOOTH_AXIS).names for each in (data, scaled)]
    assert names[0] == names[1]


def test_own_inputs_are_those_of_each_joint_itself():
    """`own:direction` is another column for every joint, `direction:pole` the same."""
    own = REACTION_WHEEL.residual_columns(('own:velocity', 'own:direction'))
    assert [[REACTION_WHEEL.input_name(c) for c in columns] for columns in own] == [
        ['velocity:pole', 'direction:pole'],
        ['velocity:wheel', 'direction:wheel'],
    ]
    assert len(set(REACTION_WHEEL.residual_columns(('direction:pole',)))) == 1
    for name in ('own:speed', 'own:', 'own'):
        with pytest.raises(ConfigError, match='own:CHANNEL such as own:velocity'):
            REACTION_WHEEL.residual_columns(('own:velocity', name))


def test_the_choice_evaluates_the_evidence_few_times(monkeypatch):
    """Folds share most rows: the fit of one is where the next one starts.

    Twenty fits, each from the best of nine starts to the last digit, took 511 evaluations.
    """
    evaluations = []
    monkeypatch.setattr(
        'sgp_ros.gp.methods.learn',
        lambda *a, **k: evaluations.append((found := learn(*a, **k)).evaluations) or found,
    )
    choose_inputs(_data(0, lambda _q, v: 0.8 * np.tanh(v / 0.02)), SLIDER)
    assert len(evaluations) == 20
    assert sum(evaluations) < 300
