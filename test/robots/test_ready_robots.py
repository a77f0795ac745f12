"""The robot files that come with the package describe the robots they are named after."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sgp_ros.rigid.inertial import PARAMETERS
from sgp_ros.rigid.rigid_body import inverse_dynamics, torque_regressor
from sgp_ros.rigid.tree import read_urdf
from sgp_ros.robots.registry import load_robot, robot_names

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / 'config' / 'robots'
TIAGO = ROOT.parent / 'shared' / 'data' / 'tiago' / 'tiago_48_schunk.urdf'
READY = {
    'emps_symmetric': ('axis',),
    'emps_viscous': ('axis',),
    'panda': tuple(f'panda_joint{i}' for i in range(1, 8)),
    'tiago_arm': tuple(f'arm_{i}_joint' for i in range(1, 5)),
}
TIAGO_CHAIN = ('torso_lift_joint', *(f'arm_{i}_joint' for i in range(1, 8)))
# a, alpha / (pi / 2), d of the Panda in modified Denavit-Hartenberg form (Gaz et al., 2019)
DH = [
    (0.0, 0, 0.333), (0.0, -1, 0.0), (0.0, 1, 0.316), (0.0825, 1, 0.0),
    (-0.0825, -1, 0.384), (0.0, 1, 0.0), (0.088, 1, 0.0),
]  # fmt: skip


def _dh_axes(q):
    """Return origin and axis of each joint and the pose of the last frame, after Craig (1986)."""
    pose, origins, axes = np.eye(4), [], []
    for (a, quarter_turns, d), angle in zip(DH, q, strict=True):
        c, s = np.cos(angle), np.sin(angle)
        ca, sa = [(1.0, 0.0), (0.0, 1.0), (0.0, -1.0)][quarter_turns]
        step = [[c, -s, 0, a], [s * ca, c * ca, -sa, -d * sa], [s * sa, c * sa, ca, d * ca]]
        pose = pose @ np.array([*step, [0, 0, 0, 1]])
        origins.append(pose[:3, 3])
        axes.append(pose[:3, 2])
    return np.array(origins), np.array(axes), pose


@pytest.mark.parametrize('name', READY)
def test_ready_robot_has_the_joints_of_its_recording(name):
    robot = load_robot(str(FOLDER / f'{name}.yaml'))
    assert robot.name == name
    assert robot.joint_names == READY[name]
    assert robot.target == 'effort'
    assert all(joint.is_actuated for joint in robot.joints)


def test_every_robot_from_a_urdf_is_tested_here():
    from_urdf = {name for name in robot_names() if load_robot(name).bodies is None}
    assert from_urdf == set(READY)


def test_panda_carries_a_weight_as_its_denavit_hartenberg_table_says():
    """Static torques are the transposed Jacobian of the mass times its weight."""
    tree = read_urdf(FOLDER / 'panda.urdf')
    rng = np.random.default_rng(0)
    mass, centre = 2.0, np.array([0.1, -0.2, 0.107])
    parameters = np.zeros((tree.size, len(PARAMETERS)))
    parameters[-1, :4] = [mass, *(mass * centre)]
    for q in rng.uniform(tree.lower, tree.upper, (5, 7)):
        origins, axes, pose = _dh_axes(q)
        arm = pose[:3, :3] @ centre + pose[:3, 3] - origins
        expected = mass * 9.81 * np.cross(axes, arm)[:, 2]
        still = np.zeros((1, 7))
        torque = inverse_dynamics(tree, parameters.ravel(), q[None], still, still)[0]
        assert torque == pytest.approx(expected, abs=1e-9)


def test_tiago_moves_like_the_description_of_its_maker():
    """Same columns for every body beyond rounding of the maker's pi; only the base is left out."""
    ours = read_urdf(FOLDER / 'tiago_arm.urdf', joints=TIAGO_CHAIN)
    theirs = read_urdf(TIAGO, joints=TIAGO_CHAIN)
    q, v, a = np.random.default_rng(1).normal(size=(3, 20, 8))
    expected = torque_regressor(theirs, q, v, a)
    assert torque_regressor(ours, q, v, a) == pytest.approx(expected, abs=1e-8)
    for limit in ('lower', 'upper', 'velocity_limit', 'effort_limit'):
        assert getattr(ours, limit) == pytest.approx(getattr(theirs, limit))
