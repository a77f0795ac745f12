"""Laws of robots by name and by file."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sgp_ros.errors import ConfigError
from sgp_ros.physics.term import Motion
from sgp_ros.robots.registry import load_robot


def _write(tmp_path, text):
    path = tmp_path / 'robot.yaml'
    path.write_text(text)
    return str(path)


def test_a_robot_file_changes_names_and_priors(tmp_path):
    """Joints are renamed; parameters get prior mean and std; null knows nothing."""
    robot = load_robot(
        _write(
            tmp_path,
            """
            schema: 1
            robot: linear_axis
            joints: [slide]
            parameters:
              M: {value: 95.1, std: 0.2, unit: kg}
              Fv: {value: 200, std: null}
            """,
        )
    )
    assert robot.joint_names == ('slide',)
    priors = {c.name: (c.prior_mean, c.prior_std) for c in robot.coefficients}
    assert priors['M'] == (95.1, 0.2)
    assert priors['Fv'] == (200.0, math.inf)
    assert priors['Fc'] == (0.0, math.inf)


@pytest.mark.parametrize(
    ('text', 'found'),
    [
        ('schema: 2\nrobot: linear_axis', 'schema is 2'),
        ('schema: 1\nrobot: unicycle', "'unicycle'"),
        ('schema: 1\nrobot: linear_axis\ncolour: red', "unknown key 'colour'"),
        ('schema: 1\nrobot: linear_axis\njoints: slide', 'not a list of names'),
        ('schema: 1\nrobot: linear_axis\njoints: [a, b]', '1 different names'),
        ('schema: 1\nrobot: linear_axis\nparameters: {K: {value: 1}}', "['K']"),
        ('schema: 1\nrobot: linear_axis\nparameters: {M: 3}', 'parameter M'),
        ('schema: 1\nrobot: linear_axis\nparameters: {M: {value: 1, std: 0}}', 'no positive std'),
        ('schema: 1\nrobot: linear_axis\nparameters: [1]', 'not a mapping'),
        ('[1, 2]', 'list'),
        ('a: [', 'not YAML'),
    ],
)
def test_a_wrong_robot_file_is_refused_in_one_line(tmp_path, text, found):
    """Found, expected and where stand in one line."""
    with pytest.raises(ConfigError) as caught:
        load_robot(_write(tmp_path, text))
    assert found in str(caught.value)
    assert '\n' not in str(caught.value)


def test_all_problems_of_a_file_are_listed_at_once(tmp_path):
    """Nobody wants to mend a file one error at a time."""
    text = 'schema: 3\nrobot: unicycle\ncolour: red\njoints: 5'
    with pytest.raises(ConfigError) as caught:
        load_robot(_write(tmp_path, text))
    for part in ('schema', 'unicycle', 'colour', 'joints'):
        assert part in str(caught.value)


@pytest.mark.parametrize('name', ['nothing', 'missing.yaml', 'robot.txt'])
def test_what_is_no_robot_is_refused(tmp_path, name):
    """The error lists the built-in names."""
    (tmp_path / 'robot.txt').write_text('schema: 1')
    path = name if name == 'nothing' else str(tmp_path / name)
    with pytest.raises(ConfigError, match='linear_axis'):
        load_robot(path)


def test_unknown_residual_inputs_are_refused():
    """The error lists what exists; an acceleration is no input of a forward model."""
    for spec in (('speed:pole',), ('acceleration:pole',), ('effort:pole',)):
        with pytest.raises(ConfigError, match='velocity:pole'):
            load_robot('reaction_wheel').residual_columns(spec)


def test_ten_parameter_wheel_satisfies_equation_27():
    """f(u) w is the right-hand side of the equation, written out."""
    w = np.arange(1.0, 11.0)
    rng = np.random.default_rng(0)
    theta, speed, m = rng.normal(size=2), rng.normal(size=2), 0.7
    robot = load_robot('reaction_wheel')
    names = [int(c.name[1:]) - 1 for c in robot.coefficients]
    motion = Motion(theta[None], speed[None], np.zeros((1, 2)), np.array([[0.0, m]]))
    state = np.array([np.sin(theta[0]), theta[1], *speed])
    expected = [w[:4] @ state + w[8] * m, w[4:8] @ state + w[9] * m]
    np.testing.assert_allclose(robot.regressor(motion)[0] @ w[names], expected)


def test_six_parameter_wheel_satisfies_equation_28():
    """The paper's feature matrix: no velocities."""
    robot = load_robot('reaction_wheel_6')
    assert [c.name for c in robot.coefficients] == ['w1', 'w2', 'w9', 'w5', 'w6', 'w10']
    motion = Motion(
        np.array([[0.4, 2.0]]), np.array([[5.0, 6.0]]), np.zeros((1, 2)), np.array([[0.0, 3.0]])
    )
    s = np.sin(0.4)
    np.testing.assert_allclose(
        robot.regressor(motion)[0], [[s, 2.0, 3.0, 0, 0, 0], [0, 0, 0, s, 2.0, 3.0]]
    )


def test_units_follow_the_kind_of_joint():
    """Metres and newtons on a prismatic joint, radians and volts where stated."""
    assert load_robot('linear_axis').target_unit('axis') == 'N'
    wheel = load_robot('reaction_wheel')
    assert wheel.target_unit('pole') == 'rad/s^2'
    assert wheel.joints[1].unit('effort') == 'V'
    assert load_robot('linear_axis').joints[0].unit('velocity') == 'm/s'
