"""Parameters that robots can show, and those that motions showed."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.batch.excitation import judge_excitation, structural_base
from sgp_ros.robots.registry import load_robot
from test.batch.chains import chain, recorded_motion, states

LINK = ('mass', 'mx', 'my', 'mz', 'Ixx', 'Ixy', 'Iyy', 'Ixz', 'Iyz', 'Izz')


def test_a_link_about_a_vertical_axis_shows_one_parameter():
    """Gravity does nothing on it: only the moment about the axis is seen."""
    robot = chain([(0, 0, 1)], [(0, 0, 0)])
    base = structural_base(robot, np.random.default_rng(0))
    assert base.texts == ('j1.Izz',)
    assert [n for n, seen in zip(LINK, base.identifiable, strict=True) if seen] == ['Izz']


def test_a_pendulum_shows_three_parameters():
    """About a horizontal axis gravity shows the first moments, inertia the moment."""
    robot = chain([(0, 1, 0)], [(0, 0, 0)])
    base = structural_base(robot, np.random.default_rng(0))
    assert [n for n, seen in zip(LINK, base.identifiable, strict=True) if seen] == [
        'mx', 'mz', 'Iyy',
    ]  # fmt: skip


def test_two_parallel_joints_regroup_the_distal_mass():
    """Planar arm with links of 0.5 m: `I1 + m2 l^2` and `mx1 + m2 l` (Khalil and Dombre 2002)."""
    robot = chain([(0, 1, 0), (0, 1, 0)], [(0, 0, 0), (0.5, 0, 0)])
    base = structural_base(robot, np.random.default_rng(0))
    names = list(base.names)
    w = np.random.default_rng(1).normal(size=20)
    assert base.rank == 6
    expected = np.zeros((2, 20))
    expected[0, [names.index('j1.mx'), names.index('j2.mass')]] = 1.0, 0.5
    expected[1, [names.index('j1.Iyy'), names.index('j2.mass')]] = 1.0, 0.25
    assert base.determines(expected).all()
    assert not base.determines(np.eye(20)[[names.index('j2.mass')]]).any()
    assert np.isfinite(base.combinations @ w).all()


@pytest.mark.parametrize('name', ['reaction_wheel', 'linear_axis', 'toy_pendulum'])
def test_built_in_robots_can_show_all_their_parameters(name):
    """None of their terms repeats another."""
    assert structural_base(load_robot(name), np.random.default_rng(0)).identifiable.all()


def test_a_random_motion_leaves_nothing_to_wish_for():
    """Then each parameter is identifiable or structurally not, and nothing is suggested."""
    robot = chain([(0, 0, 1), (0, 1, 0)], [(0, 0, 0), (0.3, 0, 0.1)])
    recorded = recorded_motion(robot, *states(3, 2))
    found = judge_excitation(structural_base(robot, np.random.default_rng(0)), recorded)
    assert found.missing == 0
    assert found.unexcited == ()
    assert set(found.status) == {'identifiable', 'structural'}


def test_a_still_joint_is_told_from_one_that_cannot_be_seen():
    """With the second joint at rest in line with the first, mx only joins Izz in the torques.

    Its row shows `Izz + l mx` and `l my` by acceleration and speed of the first joint, whose own
    row adds `Izz + 2 l mx` to an unknown moment.
    """
    robot = chain([(0, 0, 1), (0, 0, 1)], [(0, 0, 0), (0.3, 0, 0)])
    q, v, a = states(4, 2)
    q[:, 1] = v[:, 1] = a[:, 1] = 0.0
    recorded = recorded_motion(robot, q, v, a)
    found = judge_excitation(structural_base(robot, np.random.default_rng(0)), recorded)
    status = dict(zip(found.structural.names, found.status, strict=True))
    assert status['j2.mx'] == status['j2.Izz'] == 'not_excited'
    assert status['j2.my'] == 'identifiable'
    assert status['j2.mass'] == status['j1.Ixx'] == 'structural'
    assert found.missing == 1


def test_structure_does_not_depend_on_the_sample():
    """Rank and flags are properties of the robot."""
    robot = chain(np.eye(3), 0.2 * np.eye(3)[::-1])
    one, other = (structural_base(robot, np.random.default_rng(s)) for s in (0, 1))
    assert one.rank == other.rank
    assert list(one.identifiable) == list(other.identifiable)
