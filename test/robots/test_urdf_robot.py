"""Robots from a URDF, alone and by a robot YAML."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import yaml

from sgp_ros.apps.replay import write_identified_robot
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.replay import replay
from sgp_ros.engine.samples import JointSample
from sgp_ros.errors import ConfigError
from sgp_ros.physics.term import Motion
from sgp_ros.rigid.rigid_body import inverse_dynamics
from sgp_ros.rigid.tree import read_urdf
from sgp_ros.robots.nominal_prior import LEAST_EFFORT, LIMIT_SHARE
from sgp_ros.robots.registry import load_robot
from test.rigid.random_urdf import random_urdf
from test.rigid.test_tree import ARM, FINGER

SHARED = Path(__file__).parents[2] / '..' / 'shared'
TIAGO = SHARED / 'data' / 'tiago' / 'tiago_48_schunk.urdf'
CASES = sorted((SHARED / 'practice' / 'cases').glob('*/robot.urdf'))


def _write(folder, text='', urdf=ARM % FINGER):
    (folder / 'arm.urdf').write_text(urdf)
    path = folder / 'arm.yaml'
    path.write_text(f'schema: 1\nurdf: arm.urdf\n{text}')
    return str(path)


def _motion(robot, n=6, seed=0):
    return Motion(*np.random.default_rng(seed).normal(size=(4, n, len(robot.joints))))


def _nominal(robot):
    return np.array([c.prior_mean for c in robot.coefficients])


def test_a_urdf_alone_is_a_robot(tmp_path):
    """Rigid body, viscous, Coulomb, offset for each joint; nothing is known of them before."""
    _write(tmp_path)
    robot = load_robot(str(tmp_path / 'arm.urdf'))
    assert robot.name == 'arm'
    assert robot.target == 'effort'
    assert set(robot.joint_names) == {'shoulder', 'elbow', 'grip'}
    assert {j.name: j.kind for j in robot.joints}['grip'] == 'prismatic'
    names = {c.name for c in robot.coefficients}
    assert len(names) == 10 * 4 + 3 * 3
    assert {'upper.mass', 'right.Izz', 'elbow.viscous', 'grip.coulomb', 'grip.offset'} <= names
    assert all(c.prior_mean == 0.0 and c.prior_std == math.inf for c in robot.coefficients)
    assert robot.residual_inputs[0][0].startswith('position:')


def test_nominal_prior_means_are_the_torques_of_the_file(tmp_path):
    """Means of all terms, multiplied with their columns: rigid body and friction of the URDF."""
    text = """
    terms: {inertial: all, viscous: all, coulomb: all}
    prior: {inertial: {spread: 0.3}, viscous: {spread: 1.0}, coulomb: {spread: 0.5}}
    """.replace('\n    ', '\n')
    urdf = random_urdf(3, 5, mimics=2)
    robot = load_robot(_write(tmp_path, text, urdf))
    tree = read_urdf(urdf)
    motion = _motion(robot)
    v, fold = motion.velocity, np.zeros((5, 3))
    fold[np.arange(5), tree.follows] = tree.multipliers
    expected = inverse_dynamics(tree, tree.parameters, motion.position, v, motion.acceleration)
    expected += ((v @ fold.T) * tree.damping) @ fold
    expected += np.tanh(v / 0.01) * (np.abs(fold).T @ tree.friction)
    np.testing.assert_allclose(robot.regressor(motion) @ _nominal(robot), expected, atol=1e-10)
    assert all(0.0 < c.prior_std < math.inf for c in robot.coefficients)


def test_prior_spreads_are_relative_with_a_floor(tmp_path):
    """Of mass and friction; a value of zero gets the share of the effort limit."""
    robot = load_robot(
        _write(tmp_path, 'prior: {inertial: {spread: 0.3}, viscous: {spread: 2.0}}')
    )
    prior = {c.name: (c.prior_mean, c.prior_std) for c in robot.coefficients}
    assert prior['upper.mass'] == (2.0, pytest.approx(0.6))
    assert prior['upper.mz'][0] == pytest.approx(1.0)
    # trace / 2 = (2 (0.1 + 2 0.5^2) + 0.01) / 2 is m L^2
    assert prior['upper.mx'] == (0.0, pytest.approx(0.3 * 2.0 * math.sqrt(0.605 / 2.0)))
    assert prior['upper.Ixz'] == (0.0, pytest.approx(0.3 * 0.605))
    assert prior['elbow.viscous'] == (0.3, pytest.approx(0.6))
    assert prior['shoulder.viscous'] == (0.0, pytest.approx(2.0 * LIMIT_SHARE * 30.0))
    assert prior['grip.viscous'] == (0.0, pytest.approx(2.0 * LEAST_EFFORT))
    assert prior['elbow.coulomb'] == (0.0, math.inf)


def test_every_key_of_the_file_has_its_effect(tmp_path):
    """Subset, order, passive joints, gains, terms, width, inputs, single priors."""
    text = """
name: mine
joints: [elbow, shoulder]
locked: {grip: 0.02}
passive: [shoulder]
effort_gain: {elbow: -13.6}
payload: {link: tool, mass: 0.5, com: [0, 0, 0.05]}
terms: {inertial: [elbow], coulomb: [shoulder], armature: all}
coulomb_width: 0.5
prior: {inertial: {spread: 0.3}}
residual_inputs: [velocity:shoulder]
parameters: {fore.mass: {value: 1.2, std: 0.1, unit: kg}}
"""
    robot = load_robot(_write(tmp_path, text))
    assert robot.name == 'mine'
    assert robot.joint_names == ('elbow', 'shoulder')
    assert [j.is_actuated for j in robot.joints] == [True, False]
    assert [j.effort_gain for j in robot.joints] == [-13.6, 1.0]
    names = [c.name for c in robot.coefficients]
    assert names[0] == 'fore.mass'
    assert names[10:] == ['shoulder.coulomb', 'elbow.armature', 'shoulder.armature']
    first, second = robot.coefficients[0], robot.coefficients[3]
    assert (first.prior_mean, first.prior_std) == (1.2, 0.1)
    assert second.prior_mean == pytest.approx(0.5 * 0.2 + 0.5 * 0.25)
    assert robot.residual_inputs == (('velocity:shoulder',),) * 2
    motion = _motion(robot)
    np.testing.assert_allclose(
        robot.regressor(motion)[:, 1, 10], np.tanh(motion.velocity[:, 1] / 0.5)
    )


@pytest.mark.parametrize(
    ('text', 'found'),
    [
        ('colour: red', "unknown key 'colour'"),
        ('robot: linear_axis', "unknown key 'robot'"),
        ('name: 3', 'name is 3, not a text'),
        ('joints: elbow', "joints is 'elbow', not a list of names"),
        ('joints: [knee]', "joints ['knee']"),
        ('locked: {grip: open}', 'locked is'),
        ('passive: {grip: 1}', 'passive is'),
        ('effort_gain: {knee: 2}', "effort_gain of 'knee'"),
        ('effort_gain: {elbow: 0}', 'effort_gain of elbow is 0'),
        ('effort_gain: {elbow: .nan}', 'effort_gain is'),
        ('payload: {link: tool}', 'payload.mass is None'),
        ('payload: {link: tool, mass: 1, com: [0, 0]}', 'payload.com is [0, 0], not 3 numbers'),
        ('payload: {link: hand, mass: 1}', "payload on link 'hand'"),
        ('payload: {link: tool, mass: 1, size: 2}', "unknown key 'payload.size'"),
        ('terms: [inertial]', "terms is ['inertial'], not a mapping"),
        ('terms: {magic: all}', "term 'magic' is not one of"),
        ('terms: {viscous: most}', "term viscous for 'most'"),
        ('terms: {viscous: [knee]}', "term viscous for ['knee']"),
        ('terms: {viscous: [elbow, elbow]}', 'twice'),
        ('coulomb_width: 0', 'coulomb_width is 0, not a positive number'),
        ('stribeck_velocity: fast', "stribeck_velocity is 'fast'"),
        ('prior: {inertial: 0.3}', 'prior of inertial is 0.3'),
        ('prior: {inertial: {spread: -1}}', 'prior.inertial.spread is -1'),
        ('prior: {spring: {spread: 1}}', "prior of 'spring'"),
        ('residual_inputs: 3', 'residual_inputs is 3'),
        ('residual_inputs: [speed]', "residual input 'speed'"),
        ('parameters: {elbow.mass: {value: 1}}', "unknown parameters ['elbow.mass']"),
    ],
)
def test_a_wrong_entry_is_refused_in_one_line(tmp_path, text, found):
    """The line names the entry, and which there are only where one is unknown."""
    with pytest.raises(ConfigError) as caught:
        load_robot(_write(tmp_path, text))
    assert found in str(caught.value)
    assert ('the keys [' in str(caught.value)) is ('unknown key' in found)
    assert '\n' not in str(caught.value)


def test_all_problems_of_a_file_are_listed_at_once(tmp_path):
    """Those of its form and those of its names."""
    text = 'colour: red\nname: 3\nterms: {magic: all}\neffort_gain: {knee: 1}\nparameters: 7'
    with pytest.raises(ConfigError) as caught:
        load_robot(_write(tmp_path, text))
    for part in ('colour', 'name is 3', 'magic', 'knee', 'parameters is 7'):
        assert part in str(caught.value)


def test_a_wrong_urdf_is_refused_in_one_line(tmp_path):
    """Alone and from a robot YAML; also where there is none."""
    broken = _write(tmp_path, urdf='<robot')
    for path in (broken, str(tmp_path / 'arm.urdf')):
        with pytest.raises(ConfigError, match='not XML') as caught:
            load_robot(path)
        assert '\n' not in str(caught.value)
    (tmp_path / 'arm.urdf').unlink()
    with pytest.raises(ConfigError, match='no file'):
        load_robot(broken)


def _swing():
    for i, t in enumerate(np.arange(0.0, 4.0, 0.01)):
        q, v = np.array([np.sin(3 * t)]), np.array([3 * np.cos(3 * t)])
        yield JointSample(i * 10_000_000, ('elbow',), q, v, 2.0 * v + np.tanh(v / 0.2))


def test_the_identified_robot_is_the_same_robot_with_a_prior(tmp_path):
    """It finds the URDF from any folder, and keeps what the file said."""
    text = 'name: mine\njoints: [elbow]\ncoulomb_width: 0.2\nterms: {viscous: all, coulomb: all}\n'
    robot = load_robot(_write(tmp_path, text + 'parameters: {elbow.viscous: {value: 3, std: 1}}'))
    engine = Engine(robot, EngineConfig.from_mapping({'model.method': 'PR'}, robot))
    replay(engine, _swing(), lambda _step: None)
    other = tmp_path / 'out' / 'robot_identified.yaml'
    other.parent.mkdir()
    write_identified_robot(other.parent, engine)
    again = load_robot(str(other))
    assert again.name == 'mine'
    assert again.joints == robot.joints
    assert again.source['urdf'] == str(other.parent / 'robot_identified.urdf')
    changed = {'urdf', 'parameters'}
    kept = [{k: x for k, x in r.source.items() if k not in changed} for r in (again, robot)]
    assert kept[0] == kept[1]
    motion = _motion(robot)
    np.testing.assert_array_equal(again.regressor(motion), robot.regressor(motion))
    found = {p.name: (p.value, p.std) for p in engine.parameters()}
    assert {c.name: (c.prior_mean, c.prior_std) for c in again.coefficients} == found
    assert found['elbow.viscous'][0] == pytest.approx(2.0, abs=0.2)


def test_the_identified_robot_of_a_bare_urdf_loads(tmp_path):
    """Nothing but the URDF was given."""
    _write(tmp_path)
    robot = load_robot(str(tmp_path / 'arm.urdf'))
    path = tmp_path / 'robot_identified.yaml'
    write_identified_robot(tmp_path, Engine(robot, EngineConfig.from_mapping({}, robot)))
    assert load_robot(str(path)).joints == robot.joints


@pytest.mark.skipif(not TIAGO.is_file(), reason='the URDF of TIAGo is no part of the project')
def test_four_joints_of_tiago_are_a_robot(tmp_path):
    """A file of 47 joints with meshes, sensors, wheels and a follower."""
    names = [f'arm_{i}_joint' for i in range(1, 5)]
    gains = dict.fromkeys(names, 13.6) | {'arm_4_joint': -8.7}
    path = tmp_path / 'tiago.yaml'
    document = {'schema': 1, 'urdf': str(TIAGO.resolve()), 'joints': names, 'effort_gain': gains}
    path.write_text(yaml.safe_dump(document))
    robot = load_robot(str(path))
    assert robot.joint_names == tuple(names)
    assert robot.joints[3].effort_gain == -8.7
    assert robot.regressor(_motion(robot)).shape == (6, 4, 4 * 13)
    whole = load_robot(str(TIAGO))
    assert 'gripper_right_finger_joint' not in whole.joint_names
    assert np.all(np.isfinite(whole.regressor(_motion(whole))))


@pytest.mark.skipif(not CASES, reason='the practice recordings are no part of the project')
@pytest.mark.parametrize('path', CASES, ids=lambda p: p.parent.name)
def test_the_robots_of_the_practice_recordings_load(path):
    """Each is a robot whose settings have defaults."""
    robot = load_robot(str(path))
    EngineConfig.from_mapping({}, robot)
    assert np.all(np.isfinite(robot.regressor(_motion(robot))))
