"""Contract of every robot, built in or from a URDF."""

from __future__ import annotations

import doctest
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from sgp_ros.engine.config import EngineConfig, describe_settings
from sgp_ros.physics import formula
from sgp_ros.physics.term import Motion
from sgp_ros.robots import robot as robot_module
from sgp_ros.robots.registry import load_robot, robot_names
from test.rigid.random_urdf import random_urdf

CHAIN = """
<robot name="chain"><link name="base"/>
  <link name="one"><inertial><mass value="1"/></inertial></link>
  <link name="two"><inertial><origin xyz="0 0.1 0"/><mass value="2"/></inertial></link>
  <joint name="hinge" type="continuous"><parent link="base"/><child link="one"/>
    <axis xyz="0 1 0"/></joint>
  <joint name="slide" type="prismatic"><parent link="one"/><child link="two"/>
    <axis xyz="1 0 1"/><limit lower="-1" upper="1" effort="20" velocity="1"/></joint>
  <ros2_control name="c" type="system">
    <joint name="slide"><command_interface name="effort"/></joint>
  </ros2_control>
</robot>
"""
EVERYTHING = """
terms: {inertial: all, viscous: all, asymmetric_coulomb: all, stribeck: all, quadratic: all,
        offset: all, armature: all, spring: all}
prior: {inertial: {spread: 0.3}, armature: {spread: 1.0}}
residual_inputs: all
"""


def _from_urdf(name, text, yaml=None):
    with TemporaryDirectory() as folder:
        path = Path(folder, f'{name}.urdf')
        path.write_text(text, encoding='utf-8')
        if yaml is not None:
            path = path.with_suffix('.yaml')
            path.write_text(f'schema: 1\nurdf: {name}.urdf\nname: {name}{yaml}')
        return load_robot(str(path))


ROBOTS = (
    {name: load_robot(name) for name in robot_names()}
    | {'chain': _from_urdf('chain', CHAIN), 'full': _from_urdf('full', CHAIN, EVERYTHING)}
    | {
        f'tree_{seed}': _from_urdf(f'tree_{seed}', random_urdf(seed, joints, mimics))
        for seed, joints, mimics in ((1, 3, 0), (2, 7, 0), (3, 5, 2))
    }
)
NAMES = sorted(ROBOTS)


def _motion(robot, n, seed, **fixed):
    rng = np.random.default_rng(seed)
    shape = (n, len(robot.joints))
    arrays = {
        name: fixed.get(name, rng.normal(size=shape))
        for name in ('position', 'velocity', 'acceleration', 'effort')
    }
    return Motion(**arrays)


@pytest.mark.parametrize('name', NAMES)
def test_regressor_has_a_column_per_coefficient(name):
    """f(u) is (n, k, p), also for a single time."""
    robot = ROBOTS[name]
    for n in (1, 7):
        rows = robot.regressor(_motion(robot, n, 0))
        assert rows.shape == (n, len(robot.joints), len(robot.coefficients))


@pytest.mark.parametrize('name', NAMES)
def test_regressor_is_affine_in_acceleration_and_effort(name):
    """The filter averages state columns apart from driven ones, which needs this."""
    robot = ROBOTS[name]
    one, other = _motion(robot, 5, 1), _motion(robot, 5, 2)
    state = {'position': one.position, 'velocity': one.velocity}

    def f(share):
        acceleration = share * one.acceleration + (1 - share) * other.acceleration
        effort = share * one.effort + (1 - share) * other.effort
        return robot.regressor(Motion(**state, acceleration=acceleration, effort=effort))

    np.testing.assert_allclose(f(0.3), 0.3 * f(1.0) + 0.7 * f(0.0), atol=1e-12)


@pytest.mark.parametrize('name', NAMES)
def test_target_is_no_input(name):
    """The regressor of the target's equation does not read the target."""
    robot = ROBOTS[name]
    motion = _motion(robot, 5, 3)
    other = _motion(robot, 5, 4)
    arrays = {c: getattr(motion, c) for c in ('position', 'velocity', 'acceleration', 'effort')}
    arrays[robot.target] = getattr(other, robot.target)
    np.testing.assert_array_equal(robot.regressor(motion), robot.regressor(Motion(**arrays)))


@pytest.mark.parametrize('name', NAMES)
def test_names_are_unique_and_units_and_sources_given(name):
    """A coefficient can be told apart, read and looked up."""
    robot = ROBOTS[name]
    names = [c.name for c in robot.coefficients]
    assert len(set(names)) == len(names)
    assert all(c.unit for c in robot.coefficients)
    assert all(c.joint is None or c.joint in robot.joint_names for c in robot.coefficients)
    assert all(term.source for term in robot.terms)
    assert robot.description
    assert robot.name == name


@pytest.mark.parametrize('name', NAMES)
@pytest.mark.parametrize('spec', [('default',), ('own',), ('all',)])
def test_residual_inputs_resolve(name, spec):
    """The inputs of Z are columns of the stacked motion, and names lead back to them."""
    robot = ROBOTS[name]
    for columns in robot.residual_columns(spec):
        assert columns
        for column in columns:
            named = robot.input_name(column)
            assert (column,) == robot.residual_columns((named,))[0]


@pytest.mark.parametrize('name', NAMES)
@pytest.mark.parametrize('channel', ['velocity', 'direction'])
def test_an_input_of_every_joint_is_that_of_each_by_name(name, channel):
    """And every joint sees all of them."""
    robot = ROBOTS[name]
    each = tuple(f'{channel}:{joint}' for joint in robot.joint_names)
    assert robot.residual_columns((f'every:{channel}',)) == robot.residual_columns(each)


@pytest.mark.parametrize('name', NAMES)
def test_renaming_joints_changes_names_alone(name):
    """Columns, inputs and units follow the new names."""
    robot = ROBOTS[name]
    names = [f'joint_{i}' for i in range(len(robot.joints))]
    renamed = robot.renamed(names)
    motion = _motion(robot, 4, 5)
    np.testing.assert_array_equal(renamed.regressor(motion), robot.regressor(motion))
    assert renamed.residual_columns(('default',)) == robot.residual_columns(('default',))
    assert {c.joint for c in renamed.coefficients} <= {*names, None}


@pytest.mark.parametrize('name', NAMES)
def test_settings_of_every_robot_round_trip(name):
    """Defaults are valid, and the mapping of a configuration builds the same one."""
    robot = ROBOTS[name]
    config = EngineConfig.from_mapping({}, robot)
    assert EngineConfig.from_mapping(config.to_mapping(), robot) == config
    described = {setting.name for setting in describe_settings(robot)}
    assert described == set(config.to_mapping())
    assert all(setting.description for setting in describe_settings(robot))


@pytest.mark.parametrize('module', [robot_module, formula], ids=lambda module: module.__name__)
def test_the_examples_in_docstrings_run(module):
    """Examples that people copy work."""
    found = doctest.testmod(module)
    assert found.attempted
    assert not found.failed
