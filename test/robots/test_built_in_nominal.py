"""The bodies of the built-in robots, beside their coefficients and the simulated robots."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.errors import ConfigError
from sgp_ros.physics.term import Motion
from sgp_ros.rigid.rigid_body import mass_matrix
from sgp_ros.robots.nominal import nominal_model
from sgp_ros.robots.observed_motion import ObservedMotion
from sgp_ros.robots.registry import load_robot, robot_names
from sgp_ros.simulation.registry import SIMULATORS

LUMPED = [name for name in robot_names() if load_robot(name).bodies is not None]
VALUES = {name: load_robot(name).bodies.values for name in LUMPED}
OTHERS = {
    'simple_pendulum': {'J': 0.07, 'G': 1.4, 'Fv': 0.01, 'Fc': 0.05, 'offset': -0.02},
    'double_pendulum': {
        'J1': 0.16, 'J12': 0.03, 'J2': 0.033, 'H': 0.024, 'G1': 3.1, 'G2': 1.2, 'Fv1': 0.01,
        'Fv2': 0.005, 'Fc1': 0.1, 'Fc2': 0.06, 'offset1': -0.01, 'offset2': 0.03,
    },
}  # fmt: skip


def _stated(name, values):
    return load_robot(name).with_prior({key: (value, np.inf) for key, value in values.items()})


def _motion(k, rng):
    q, v, a, effort = rng.normal(size=(4, 50, k)) * np.array([2.0, 3.0, 10.0, 5.0])[:, None, None]
    return q, v, a, effort


@pytest.mark.parametrize(
    ('name', 'values'),
    [*VALUES.items(), *OTHERS.items()],
    ids=[*VALUES, *(f'{n} again' for n in OTHERS)],
)
def test_bodies_and_effects_move_as_the_coefficients_say(name, values):
    """The regressor of the built-in robot times its coefficients, on either side."""
    robot = load_robot(name)
    nominal = nominal_model(_stated(name, values))
    q, v, a, command = _motion(len(robot.joints), np.random.default_rng(0))
    command *= [joint.is_actuated for joint in robot.joints]
    # the regressor has dry friction smooth over a width, so only clear directions are compared
    v = np.where(np.abs(v) < 0.5, 0.5, v)
    W = np.array([values[c.name] for c in robot.coefficients])
    gains = np.array([joint.effort_gain for joint in nominal.robot.joints])
    seen = ObservedMotion(
        nominal.tree,
        np.zeros(len(q)),
        0.0,
        q,
        v,
        a,
        command * gains,
        None,
        (),
        nominal.stated,
        sign=np.sign,
    )
    needed = seen.nominal_effort - seen.stated_force
    if robot.target == 'effort':
        predicted = robot.regressor(Motion(q, v, a, command)) @ W
        np.testing.assert_allclose(needed, predicted, rtol=1e-9, atol=1e-9)
        return
    M = mass_matrix(nominal.tree, nominal.tree.parameters, q)
    found = a + np.linalg.solve(M, (command * gains - needed)[:, :, None])[:, :, 0]
    predicted = robot.regressor(Motion(q, v, a, command)) @ W
    np.testing.assert_allclose(found, predicted, rtol=1e-9, atol=1e-7)


@pytest.mark.parametrize('name', SIMULATORS)
def test_the_numbers_of_a_name_are_those_of_the_simulated_robot(name):
    """Which shares no code with the model."""
    true = {c.name: c.value for c in SIMULATORS[name].mechanism.coefficients()}
    assert VALUES[name] == pytest.approx(true, rel=1e-12)


def test_numbers_of_a_robot_yaml_come_before_those_of_the_simulated_robot():
    tree = nominal_model(_stated('linear_axis', {'M': 40.0})).tree
    assert tree.parameters[0, 0] == pytest.approx(40.0)
    assert tree.damping[0] == VALUES['linear_axis']['Fv']


def test_new_names_of_joints_are_those_of_the_bodies():
    nominal = nominal_model(load_robot('reaction_wheel').renamed(['<stick>', 'disc']))
    assert nominal.tree.moving_names == ('<stick>', 'disc')
    assert [joint.is_actuated for joint in nominal.robot.joints] == [False, True]


def test_a_robot_of_which_no_numbers_are_known_is_refused_with_their_names():
    robot = load_robot('simple_pendulum')
    bodies = replace(robot.bodies, values=dict.fromkeys(robot.bodies.values))
    with pytest.raises(ConfigError, match=r'no nominal values of J, G, Fv, Fc, offset'):
        nominal_model(replace(robot, bodies=bodies))


@pytest.mark.parametrize(
    ('name', 'change'),
    [
        ('linear_axis', {'M': -1.0}),
        ('reaction_wheel', {'w9': 2.0}),
        ('double_pendulum', {'J1': 0.01}),
        ('double_pendulum', {'G2': 1e-300}),
    ],
)
def test_coefficients_that_no_bodies_have_are_refused(name, change):
    with pytest.raises(ConfigError, match='bodies with positive inertia'):
        nominal_model(_stated(name, VALUES[name] | change))
