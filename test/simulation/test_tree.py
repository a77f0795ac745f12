"""Laws of trees from a URDF."""

from __future__ import annotations

import sys

import mujoco
import numpy as np
import pinocchio
import pytest

from sgp_proof.concealed import robots
from sgp_ros.errors import ConfigError
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.recording import simulate
from sgp_ros.simulation.tree import GRAVITY, Tree
from sgp_ros.simulation.tree_simulator import tree_simulator
from sgp_ros.simulation.tree_text import read_tree
from test.simulation.trees import arm, pendulum


def pinocchio_order(model, names):
    return [model.joints[model.getJointId(name)].idx_v for name in names]


def random_urdf(seed, damping=1.0):
    family, bodies = robots.draw_robot(np.random.default_rng(seed))
    bodies = [body for body in bodies if body.kind != 'continuous'] or bodies
    for body in bodies:
        object.__setattr__(body, 'damping', damping * body.damping)
        object.__setattr__(body, 'kind', body.kind.replace('continuous', 'revolute'))
    bodies = bodies if bodies[0].parent < 0 else robots.random_tree(np.random.default_rng(seed))
    for i, body in enumerate(bodies):
        object.__setattr__(body, 'joint', f'joint_{i}')
        object.__setattr__(body, 'link', f'link_{i}')
    return robots.urdf(family, bodies), bodies


@pytest.mark.parametrize('seed', range(12))
def test_mass_and_forces_are_those_of_pinocchio(seed):
    """Two libraries, one tree: branches, prismatic joints, gravity and damping."""
    urdf, bodies = random_urdf(seed)
    tree, model = Tree(urdf), pinocchio.buildModelFromXML(urdf)
    order = pinocchio_order(model, [joint.name for joint in tree.text.joints])
    q, v = np.random.default_rng(seed).normal(size=(2, len(order)))
    inverse_mass, force = tree.dynamics(q, v)
    there = np.argsort(order)
    M = pinocchio.crba(model, model.createData(), q[there])
    M = np.triu(M) + np.triu(M, 1).T
    bias = pinocchio.nonLinearEffects(model, model.createData(), q[there], v[there])
    expected = -bias[order] - v * [float(f'{body.damping:.4g}') for body in bodies]
    np.testing.assert_allclose(inverse_mass @ M[np.ix_(order, order)], np.eye(len(q)), atol=1e-9)
    np.testing.assert_allclose(force, expected, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize('seed', range(3))
def test_energy_of_a_frictionless_tree_is_kept(seed):
    """Energy by Pinocchio along the motion; Runge and Kutta of order four at 4 ms."""
    urdf, _ = random_urdf(seed, damping=0.0)
    simulator = tree_simulator(urdf)
    k = len(simulator.joints)
    recording = simulate(
        make_simulation(simulator, controller='zero', position=[0.4] * k, velocity=[0.5] * k), 2.0
    )
    model = pinocchio.buildModelFromXML(urdf)
    data = model.createData()
    there = np.argsort(pinocchio_order(model, simulator.joint_names))
    pairs = zip(recording.true_position, recording.true_velocity, strict=True)
    energy = np.array(
        [
            (pinocchio.computeKineticEnergy(model, data, q[there], v[there]),
             pinocchio.computePotentialEnergy(model, data, q[there]))
            for q, v in pairs
        ]
    )  # fmt: skip
    moved = np.ptp(energy[:, 0]) + 1e-12
    assert np.ptp(energy.sum(axis=1)) < 1e-5 * max(moved, 1e-3)


def test_tilted_base_turns_gravity_by_the_transposed_orientation():
    """A fixed joint with the same roll and pitch below the robot does the same."""
    roll, pitch = 0.3, -0.2
    tilted = Tree(arm(), base_roll=roll, base_pitch=pitch)
    below = arm().replace(
        '<link name="ground"/>',
        '<link name="floor"/><link name="ground"/><joint name="foot" type="fixed">'
        f'<parent link="floor"/><child link="ground"/><origin rpy="{roll} {pitch} 0"/></joint>',
    )
    q, v = np.array([0.4, -0.8]), np.array([1.0, 2.0])
    for found, expected in zip(tilted.dynamics(q, v), Tree(below).dynamics(q, v), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_payload_and_tip_force_of_a_pendulum_in_closed_form():
    """`I + m r^2`, `m g r sin q`, and a force that works along the path of the tool."""
    mass, x, z = 0.7, 0.1, -0.4
    tree = Tree(pendulum(), payload_mass=mass, payload_x=x, payload_z=z, tip_fx=3.0, tip_fz=-2.0)
    q = 0.6
    inverse_mass, force = tree.dynamics(np.array([q]), np.zeros(1))
    own = 0.1 + 2.0 * 0.5**2
    np.testing.assert_allclose(1.0 / inverse_mass[0, 0], own + mass * (x**2 + z**2), rtol=1e-9)
    gravity = -2.0 * GRAVITY * 0.5 * np.sin(q)
    gravity += mass * GRAVITY * (x * np.cos(q) + z * np.sin(q))
    along_x, along_z = -np.cos(q), np.sin(q)
    expected = gravity + 3.0 * along_x - 2.0 * along_z
    np.testing.assert_allclose(force[0], expected, rtol=1e-9)


def _swapped(urdf):
    """Return an arm whose file names the outer joint first."""
    start = urdf.index('  <joint name="shoulder"')
    middle, end = urdf.index('  <joint name="elbow"'), urdf.index('  <link name="tool0"')
    return urdf[:start] + urdf[middle:end] + urdf[start:middle] + urdf[end:]


def test_joints_keep_the_order_of_the_file():
    """A file that names the outer joint first gets its numbers first."""
    q, v = np.array([0.4, -0.8]), np.array([1.0, 2.0])
    plain, turned = Tree(arm()), Tree(_swapped(arm()))
    assert [joint.name for joint in turned.text.joints] == ['elbow', 'shoulder']
    A, h = plain.dynamics(q, v)
    B, g = turned.dynamics(q[::-1].copy(), v[::-1].copy())
    np.testing.assert_allclose(B, A[::-1, ::-1], rtol=1e-12)
    np.testing.assert_allclose(g, h[::-1], rtol=1e-12)


def test_last_joint_carries_the_tool():
    """Fixed joints between the last link and `tool0` do not matter."""
    assert read_tree(pendulum()).last_joint == 'hinge'
    assert read_tree(arm()).last_joint == 'elbow'
    assert read_tree(arm()).command_joints == ('shoulder', 'elbow')
    turned = read_tree(_swapped(arm()).replace('tool0', 'hand'))
    assert [joint.name for joint in turned.joints] == ['elbow', 'shoulder']
    assert turned.last_joint == 'elbow'
    assert turned.tool_link == read_tree(arm()).last_link


@pytest.mark.parametrize(
    ('text', 'part'),
    [
        ('<robot', 'not XML'),
        ('<model/>', '<model>'),
        ('<robot name="r"><link name="a"/></robot>', 'no joint that moves'),
        ('<!DOCTYPE robot><robot name="r"/>', 'document type'),
        (pendulum().replace('"continuous"', '"floating"'), 'floating'),
        (pendulum(mass=0.0, inertia=0.0), 'mass'),
        (pendulum().replace('child link="bob"', 'child'), 'joint hinge names the links'),
    ],
)
def test_texts_that_are_no_tree_are_refused_in_one_line(text, part):
    """It says what was found and what was expected."""
    with pytest.raises(ConfigError, match=part) as caught:
        tree_simulator(text)
    assert '\n' not in str(caught.value)
    assert caught.value.expected


def test_missing_library_is_said_with_its_remedy(monkeypatch):
    """MuJoCo is an optional part of the package."""
    monkeypatch.setitem(sys.modules, 'mujoco', None)
    with pytest.raises(ConfigError, match=r'sgp_ros\[simulate\]'):
        Tree(pendulum())


def test_the_library_leaves_no_log_where_the_user_is(tmp_path, monkeypatch):
    """MuJoCo's own handler of warnings writes MUJOCO_LOG.TXT into the current folder."""
    monkeypatch.chdir(tmp_path)
    Tree(pendulum())
    body = '<body><joint type="slide"/><geom size="0.1"/></body>'
    model = mujoco.MjModel.from_xml_string(f'<mujoco><worldbody>{body}</worldbody></mujoco>')
    state = mujoco.MjData(model)
    state.qpos[0] = np.nan
    mujoco.mj_step(model, state)
    assert [warning.number for warning in state.warning if warning.number]
    assert not list(tmp_path.iterdir())
