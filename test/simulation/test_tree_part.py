"""Laws of a part of a URDF: what stands still, follows or is carried, and the unit of efforts."""

from __future__ import annotations

import re

import numpy as np
import pytest

from sgp_ros.errors import ConfigError
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.recording import simulate
from sgp_ros.simulation.sensors import Sensors
from sgp_ros.simulation.tree import Tree
from sgp_ros.simulation.tree_simulator import tree_simulator
from sgp_ros.simulation.tree_text import Follower, Load, TreePart, read_tree
from test.simulation.test_tree import random_urdf
from test.simulation.trees import arm, pendulum

Q, V = np.array([0.4, -0.8]), np.array([1.0, 2.0])
MIMIC = '<mimic joint="shoulder" multiplier="-1.5" offset="0.3"/></joint>'


def geared(extra=MIMIC):
    """Return the arm whose elbow follows its shoulder."""
    head, tail = arm().split('<joint name="elbow"', 1)
    return head + '<joint name="elbow"' + tail.replace('</joint>', extra, 1)


def by_control():
    """Return the same, as parameters of ros2_control."""
    words = {'mimic': 'shoulder', 'multiplier': '-1.5', 'offset': '0.3'}
    said = ''.join(f'<param name="{name}">{word}</param>' for name, word in words.items())
    block = f'<ros2_control><joint name="elbow">{said}</joint></ros2_control></robot>'
    return arm().replace('</robot>', block)


def dynamics(tree, q, v):
    """Return mass matrix and forces."""
    inverse_mass, force = tree.dynamics(np.array(q), np.array(v))
    return np.linalg.inv(inverse_mass), force


def names_of(tree):
    return tuple(joint.name for joint in tree.text.joints)


@pytest.mark.parametrize('seed', range(8))
def test_a_locked_joint_is_one_at_rest_where_it_is_locked(seed):
    """Rows and columns of those that move stay, on branches and prismatic joints too."""
    urdf, _ = random_urdf(seed)
    whole = Tree(urdf)
    names, rng = names_of(whole), np.random.default_rng(seed)
    kept = sorted(rng.permutation(len(names))[: max(1, len(names) // 2)].tolist())
    q, v = rng.normal(size=(2, len(names)))
    v[[i for i in range(len(names)) if i not in kept]] = 0.0
    locked = {name: float(q[i]) for i, name in enumerate(names) if i not in kept}
    part = Tree(urdf, TreePart(tuple(names[i] for i in kept), locked))
    M, force = dynamics(whole, q, v)
    N, rest = dynamics(part, q[kept], v[kept])
    np.testing.assert_allclose(N, M[np.ix_(kept, kept)], atol=1e-9 * np.abs(M).max())
    np.testing.assert_allclose(rest, force[kept], atol=1e-9 * np.abs(force).max())


@pytest.mark.parametrize('seed', range(6))
def test_a_joint_may_be_locked_where_roll_and_yaw_are_one(seed):
    """A pitch of a right angle has no unique roll and yaw; a tilted base feels the sum."""
    roll, yaw = np.random.default_rng(seed).uniform(-3.0, 3.0, 2).tolist()
    urdf = pendulum().replace('parent link="world"', 'parent link="stand"').replace(
        '<link name="bob">',
        '<link name="stand"/><joint name="turn" type="revolute"><parent link="world"/>'
        f'<child link="stand"/><origin rpy="0 {0.5 * np.pi!r} {yaw!r}"/><axis xyz="1 0 0"/>'
        '</joint><link name="bob">',
    )  # fmt: skip
    part, tilt = TreePart(('hinge',), {'turn': roll}), {'base_roll': 0.5, 'base_pitch': 0.3}
    M, force = dynamics(Tree(urdf, **tilt), [roll, 0.7], [0.0, 2.0])
    N, rest = dynamics(Tree(urdf, part, **tilt), [0.7], [2.0])
    np.testing.assert_allclose(N, M[1:, 1:], rtol=1e-9)
    np.testing.assert_allclose(rest, force[1:], atol=1e-9)


def test_joints_take_the_order_wanted():
    turned = Tree(arm(), TreePart(('elbow', 'shoulder'), motors=('elbow', 'shoulder')))
    assert names_of(turned) == turned.text.command_joints == ('elbow', 'shoulder')
    assert turned.text.last_joint == 'elbow'
    M, force = dynamics(Tree(arm()), Q, V)
    N, other = dynamics(turned, Q[::-1], V[::-1])
    np.testing.assert_allclose(N, M[::-1, ::-1], rtol=1e-9)
    np.testing.assert_allclose(other, force[::-1], rtol=1e-9)


@pytest.mark.parametrize('urdf', [geared(), by_control()], ids=['mimic', 'ros2_control'])
def test_a_follower_moves_with_its_leader_and_leaves_its_force_there(urdf):
    """`M = G^T M G` and `G^T h`, by virtual work."""
    tree = Tree(urdf)
    assert names_of(tree) == ('shoulder',)
    G = np.array([[1.0], [-1.5]])
    M, force = dynamics(Tree(arm()), [0.4, -1.5 * 0.4 + 0.3], [2.0, -3.0])
    N, geared_force = dynamics(tree, [0.4], [2.0])
    np.testing.assert_allclose(N, G.T @ M @ G, rtol=1e-12)
    np.testing.assert_allclose(geared_force, G.T @ force, rtol=1e-12)


def test_who_follows_a_follower_follows_its_leader():
    """`-3 (2 q + 0.5) + 1 = -6 q - 0.5`."""
    joints = {'a': '', 'b': 'joint="a" multiplier="2" offset="0.5"',
              'c': 'joint="b" multiplier="-3" offset="1"'}  # fmt: skip
    text = '<link name="base"/>' + ''.join(
        f'<link name="{name}"/><joint name="{name}" type="continuous"><parent link="base"/>'
        f'<child link="{name}"/>{f"<mimic {said}/>" if said else ""}</joint>'
        for name, said in joints.items()
    )
    _, last = read_tree(f'<robot name="r">{text}</robot>').followers
    assert last == Follower('c', 'a', -6.0, -0.5)


def test_dry_friction_of_a_follower_is_felt_by_its_leader():
    """Per way of the leader."""
    urdf = re.sub('friction="[^"]*"', 'friction="0.2"', geared())
    assert read_tree(urdf).friction == (pytest.approx(0.2 + 1.5 * 0.2),)


@pytest.mark.parametrize('leader', ['elbow', 'wrist'])
def test_a_follower_of_nothing_that_moves_is_refused(leader):
    with pytest.raises(ConfigError, match='elbow'):
        Tree(geared(MIMIC.replace('shoulder', leader)))


def test_a_load_is_a_body_on_its_link():
    """A point on the last link is its payload; a tensor adds to the inertia about the axis."""
    place = (0.1, 0.0, -0.2)
    point = Tree(arm(), TreePart(('shoulder', 'elbow'), loads=(Load('elbow_link', 0.7, place),)))
    known = Tree(arm(), payload_mass=0.7, payload_x=0.1, payload_z=-0.2)
    for found, expected in zip(dynamics(point, Q, V), dynamics(known, Q, V), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-9)
    tensor = (0.02, 0.0, 0.03, 0.0, 0.0, 0.04)
    load = Load('bob', 0.5, (0.0, 0.0, -0.4), tensor)
    M, _ = dynamics(Tree(pendulum(), TreePart(('hinge',), loads=(load,))), [0.3], [0.0])
    np.testing.assert_allclose(M, [[0.1 + 2.0 * 0.5**2 + 0.5 * 0.4**2 + 0.03]], rtol=1e-9)


def test_two_loads_may_sit_on_one_link():
    place = (0.0, 0.0, -0.4)
    both = TreePart(('hinge',), loads=(Load('bob', 0.2, place), Load('bob', 0.3, place)))
    one = TreePart(('hinge',), loads=(Load('bob', 0.5, place),))
    expected, _ = dynamics(Tree(pendulum(), one), [0.3], [0.0])
    np.testing.assert_allclose(dynamics(Tree(pendulum(), both), [0.3], [0.0])[0], expected)


@pytest.mark.parametrize('gain', [13.6, -0.03])
def test_a_gain_scales_command_and_measured_effort_and_no_motion(gain):
    """The controller knows it: the forces, and so the motion, are those without."""
    names, sensors = ('shoulder', 'elbow'), Sensors(measures_velocity=True, measures_effort=True)
    plain, scaled = (
        simulate(
            make_simulation(
                tree_simulator(arm(), TreePart(names, motors=names, effort_gain=gains)),
                seed=3, sensors=sensors,
            ),
            1.0,
        )
        for gains in ({}, {'elbow': gain})
    )  # fmt: skip
    np.testing.assert_allclose(scaled.true_position, plain.true_position, atol=1e-9)
    unit = np.array([1.0, gain])
    np.testing.assert_allclose(scaled.command * unit, plain.command, atol=1e-6)
    np.testing.assert_allclose(scaled.effort, scaled.command, rtol=1e-12)


def test_effects_of_a_drive_act_on_forces_not_on_what_is_commanded():
    """A saturation of 1 N m with 0.5 N m per unit lets two units through."""
    part = TreePart(('shoulder', 'elbow'), motors=('elbow',), effort_gain={'elbow': 0.5})
    simulation = make_simulation(
        tree_simulator(arm(), part), controller='external',
        effects=['saturation:joint=elbow,limit=1'], sensors=Sensors(measures_effort=True),
    )  # fmt: skip
    simulation.step()
    simulation.hold([3.0])
    assert simulation.step().effort.tolist() == [0.0, 2.0]


def test_without_motors_the_robot_is_let_go_where_it_does_not_rest():
    """At the middle an upright pendulum would stand still for ever."""
    simulator = tree_simulator(pendulum(), TreePart(('hinge',)))
    assert list(simulator.controllers) == ['zero', 'external']
    recording = simulate(make_simulation(simulator), 1.0)
    assert recording.command.shape == (200, 0)
    assert np.ptp(recording.position) > 0.5


def test_motors_of_a_file_without_effort_interfaces_are_those_it_commands():
    """A position interface says too that a motor is there; a limit of 0 says nothing."""
    one = arm().replace('<command_interface name="effort"/>', '', 1)
    text = one.replace(
        '<command_interface name="effort"/>', '<command_interface name="position"/>'
    )
    assert read_tree(text).command_joints == ('elbow',)
    free = re.sub('effort="[^"]*"', 'effort="0"', arm())
    assert [joint.effort for joint in read_tree(free).joints] == [np.inf, np.inf]


def test_links_without_mass_move_what_hangs_on_them():
    """A joint with two axes is modelled by such a link; its inertia is that of what it carries."""
    between = pendulum().replace(
        '<link name="bob">', '<link name="cross"/><link name="bob">'
    ).replace(
        '<joint name="hinge" type="continuous"><parent link="world"/><child link="bob"/>',
        '<joint name="swing" type="continuous"><parent link="world"/><child link="cross"/>'
        '<axis xyz="1 0 0"/></joint>'
        '<joint name="hinge" type="continuous"><parent link="cross"/><child link="bob"/>',
    )  # fmt: skip
    M, _ = dynamics(Tree(between), [0.0, 0.0], [0.0, 0.0])
    np.testing.assert_allclose(M, 0.6 * np.eye(2), atol=1e-12)
