"""The compiled dynamics of a tree, beside Pinocchio's on random trees."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pinocchio
import pytest

from sgp_ros.errors import NumericalError
from sgp_ros.rigid.rigid_body import (
    forward_dynamics,
    inverse_dynamics,
    mass_matrix,
    torque_regressor,
)
from sgp_ros.rigid.tree import read_urdf
from test.rigid.random_urdf import random_urdf

TOLERANCE = 1e-11
"""Of the largest entry: 1e4 roundings along a tree of eight bodies."""
TREES = [(seed, 1 + seed % 8, 0) for seed in range(24)] + [
    (seed, 4 + seed % 5, 1 + seed % 3) for seed in range(100, 112)
]


class Reference:
    """Pinocchio's model of the same text; mimic joints are free there and folded by hand."""

    def __init__(self, text, tree):
        # a continuous joint has two coordinates in Pinocchio, a revolute one has one
        plain = re.sub('type="continuous"', 'type="revolute"', text)
        self.model = pinocchio.buildModelFromXML(re.sub('<mimic [^>]*/>', '', plain))
        self.data = self.model.createData()
        ids = [self.model.getJointId(name) for name in tree.joint_names]
        self.order = np.array([self.model.joints[i].idx_v for i in ids])
        self.fold = np.zeros((len(ids), tree.size))
        self.fold[np.arange(len(ids)), tree.follows] = tree.multipliers
        self.start = tree.offsets

    def full(self, x, start=0.0):
        full = np.empty(self.model.nv)
        full[self.order] = self.fold @ x + start
        return full

    def regressor(self, q, v, a):
        Y = pinocchio.computeJointTorqueRegressor(
            self.model, self.data, self.full(q, self.start), self.full(v), self.full(a)
        )
        b = len(self.order)
        return self.fold.T @ Y.reshape(b, b, 10)[self.order][:, self.order].reshape(b, 10 * b)

    def torque(self, q, v, a):
        tau = pinocchio.rnea(
            self.model, self.data, self.full(q, self.start), self.full(v), self.full(a)
        )
        return self.fold.T @ tau[self.order]

    def mass(self, q):
        M = np.triu(pinocchio.crba(self.model, self.data, self.full(q, self.start)))
        M = (M + np.triu(M, 1).T)[np.ix_(self.order, self.order)]
        return self.fold.T @ M @ self.fold


def _world(seed, joints, mimics, n=5):
    text = random_urdf(seed, joints, mimics)
    tree = read_urdf(text)
    q, v, a = np.random.default_rng(seed).normal(size=(3, n, tree.size))
    return tree, Reference(text, tree), q, v, a


def _assert_close(found, expected):
    np.testing.assert_allclose(found, expected, rtol=0, atol=TOLERANCE * np.abs(expected).max())


@pytest.mark.parametrize('world', TREES)
def test_regressor_equals_pinocchio(world):
    """On branches, sliding and rotated joints, and joints that follow others."""
    tree, reference, q, v, a = _world(*world)
    expected = [reference.regressor(*x) for x in zip(q, v, a, strict=True)]
    _assert_close(torque_regressor(tree, q, v, a), expected)


@pytest.mark.parametrize('world', TREES)
def test_inverse_dynamics_and_mass_matrix_equal_pinocchio(world):
    """With the inertias of the file."""
    tree, reference, q, v, a = _world(*world)
    expected = [reference.torque(*x) for x in zip(q, v, a, strict=True)]
    _assert_close(inverse_dynamics(tree, tree.parameters, q, v, a), expected)
    _assert_close(mass_matrix(tree, tree.parameters, q), [reference.mass(x) for x in q])


@pytest.mark.parametrize('world', TREES[::3])
def test_regressor_times_parameters_is_inverse_dynamics(world):
    """The same torque by two passes, also for parameters that no body can have."""
    tree, _, q, v, a = _world(*world)
    w = np.random.default_rng(1).normal(size=tree.parameters.size)
    _assert_close(torque_regressor(tree, q, v, a) @ w, inverse_dynamics(tree, w, q, v, a))


@pytest.mark.parametrize('world', TREES[::3])
def test_forward_dynamics_inverts_inverse_dynamics(world):
    """Accelerations come back, to the condition of the mass matrix."""
    tree, _, q, v, a = _world(*world)
    tau = inverse_dynamics(tree, tree.parameters, q, v, a)
    condition = np.linalg.cond(mass_matrix(tree, tree.parameters, q)).max()
    found = forward_dynamics(tree, tree.parameters, q, v, tau)
    np.testing.assert_allclose(found, a, rtol=0, atol=1e-12 * condition)


def test_samples_do_not_see_one_another():
    """One by one equals all at once, bit for bit."""
    tree, _, q, v, a = _world(3, 6, 0, n=9)
    alone = [torque_regressor(tree, q[[i]], v[[i]], a[[i]])[0] for i in range(9)]
    np.testing.assert_array_equal(torque_regressor(tree, q, v, a), alone)


def test_memory_that_was_used_before_gives_the_same():
    """The earlier content of `out` does not matter; another shape is refused."""
    tree, _, q, v, a = _world(5, 6, 2)
    expected = torque_regressor(tree, q, v, a)
    out = np.full_like(expected, 7.0)
    assert torque_regressor(tree, q, v, a, out) is out
    np.testing.assert_array_equal(out, expected)
    for wrong in (out[1:], out.astype(np.float32), np.asfortranarray(out)):
        with pytest.raises(ValueError, match='out'):
            torque_regressor(tree, q, v, a, wrong)


def test_a_body_acts_on_the_joints_it_hangs_on_alone():
    """Torques of other branches and of joints further out have no column entry."""
    tree, _, q, v, a = _world(6, 7, 0)
    Y = torque_regressor(tree, q, v, a).reshape(len(q), tree.size, -1, 10)
    for body in range(tree.size):
        path, i = set(), body
        while i >= 0:
            path.add(i)
            i = int(tree.parents[i])
        others = [j for j in range(tree.size) if j not in path]
        assert not np.any(Y[:, others, body])
        assert all(np.any(Y[:, j, body]) for j in path)


def test_parameters_of_no_body_have_no_forward_dynamics():
    """A negative mass is refused by name."""
    tree, _, q, v, a = _world(2, 3, 0)
    with pytest.raises(NumericalError, match='tree_2'):
        forward_dynamics(tree, -tree.parameters, q, v, a)


def test_motions_of_another_shape_are_refused():
    """As many columns as joints that move on their own."""
    tree, _, q, v, a = _world(2, 3, 0)
    with pytest.raises(ValueError, match='3 joints'):
        torque_regressor(tree, q[:, :2], v[:, :2], a[:, :2])
    with pytest.raises(ValueError, match='3 joints'):
        torque_regressor(tree, q, v[1:], a)


def test_a_joint_that_nothing_resists_has_no_inertia():
    """A point mass on the axis of the last joint: zero without rounding, as its file states it."""
    tree, _, q, _, _ = _world(3, 6, 0)
    tree, parameters = replace(tree, is_prismatic=np.zeros(6, bool)), tree.parameters.copy()
    last = int(np.flatnonzero(~np.isin(np.arange(6), tree.parents))[0])
    on_axis = 0.3 * tree.axes[last]
    moments = 2.0 * (np.eye(3) * (on_axis @ on_axis) - np.outer(on_axis, on_axis))
    parameters[last] = [2.0, *(2.0 * on_axis), *moments[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]]
    M = mass_matrix(tree, parameters, q)
    assert np.abs(M[:, last, last]).max() <= 1e-15
    assert np.abs(M[:, last]).max() <= 1e-15
