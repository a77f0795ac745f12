"""The rigid-body term, beside an independent Newton-Euler recursion."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_proof.paper.serial_arm import ArmLink, JointFriction, SerialArm
from sgp_ros.errors import ConfigError
from sgp_ros.physics.term import Motion
from sgp_ros.rigid.inertial import PARAMETERS, inertial_term, revolute_chain

NAMES = ('a', 'b', 'c', 'd')


def _arm(seed, k=4):
    """A chain with arbitrary axes, offsets and inertias."""
    rng = np.random.default_rng(seed)
    links = []
    for _ in range(k):
        axis = rng.normal(size=3)
        root = rng.normal(size=(3, 3))
        tensor = root @ root.T + np.eye(3)
        inertia = tensor[[0, 1, 1, 2, 2, 2], [0, 0, 1, 0, 1, 2]]
        links.append(
            ArmLink(
                tuple(axis / np.linalg.norm(axis)), tuple(rng.normal(size=3)),
                rng.uniform(1.0, 3.0), tuple(rng.normal(size=3)), tuple(inertia),
            )
        )  # fmt: skip
    return SerialArm(tuple(links), (JointFriction(0.0, 0.0),) * k, 0.02)


def _tree(arm):
    return revolute_chain(
        NAMES[: len(arm.links)], [x.axis for x in arm.links], [x.offset for x in arm.links]
    )


def _motion(seed, n=10, k=4):
    q, v, a = np.random.default_rng(seed).normal(size=(3, n, k))
    return Motion(q, v, a, np.zeros_like(q))


@pytest.mark.parametrize('seed', range(3))
def test_regressor_times_true_parameters_is_newton_euler(seed):
    """Two independent implementations, to 1e-9 of the torque."""
    arm, motion = _arm(seed), _motion(seed)
    F = inertial_term(_tree(arm)).columns(motion)
    w = np.concatenate([link.parameters() for link in arm.links])
    expected = arm.rigid_torque(motion.position, motion.velocity, motion.acceleration)
    assert np.allclose(F @ w, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())


def test_columns_are_affine_in_acceleration():
    """The filter of the engine relies on it."""
    term, one, other = inertial_term(_tree(_arm(0))), _motion(0), _motion(1)

    def at(acceleration):
        return term.columns(Motion(one.position, one.velocity, acceleration, one.effort))

    middle = at(0.3 * one.acceleration + 0.7 * other.acceleration)
    assert np.allclose(middle, 0.3 * at(one.acceleration) + 0.7 * at(other.acceleration))


def test_a_link_does_not_act_on_joints_behind_it():
    """The regressor is block upper triangular."""
    F = inertial_term(_tree(_arm(0))).columns(_motion(0))
    for joint in range(4):
        assert not np.any(F[:, joint, : 10 * joint])


def test_coefficients_are_named_by_link_with_units():
    """Ten of each link."""
    tree = _tree(_arm(0, k=2))
    names = [c.name for c in inertial_term(tree, ('link1', 'link2')).coefficients]
    assert names == [f'{link}.{p}' for link in ('link1', 'link2') for p, _ in PARAMETERS]
    assert inertial_term(tree).coefficients[10].name == 'b.mass'
    assert inertial_term(tree).coefficients[13].unit == 'kg m'


def test_columns_of_some_bodies_are_those_of_all():
    """A body that is left out takes its ten coefficients along."""
    tree = _tree(_arm(0))
    every, some = inertial_term(tree), inertial_term(tree, bodies=[2, 0])
    assert some.coefficients == every.coefficients[20:30] + every.coefficients[:10]
    columns = every.columns(_motion(0))
    np.testing.assert_array_equal(
        some.columns(_motion(0)), np.concatenate([columns[..., 20:30], columns[..., :10]], axis=2)
    )


def test_a_coefficient_belongs_to_the_joint_that_carries_it():
    """Also where links have names of their own."""
    term = inertial_term(_tree(_arm(0, k=2)), ('link1', 'link2'))
    assert [c.joint for c in term.coefficients] == ['a'] * 10 + ['b'] * 10


def test_every_link_has_a_name():
    """As many names as joints."""
    with pytest.raises(ConfigError, match='1 links'):
        inertial_term(_tree(_arm(0)), ('link1',))
