"""Points of a link and the efforts of forces on them, against differences and gravity."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.rigid.kinematics import LinkMotion
from sgp_ros.rigid.rigid_body import inverse_dynamics
from sgp_ros.rigid.tree import read_urdf
from test.rigid.random_urdf import random_urdf

AT = np.array([0.3, -0.2, 0.5])


@pytest.mark.parametrize(('seed', 'mimics'), [(0, 0), (1, 0), (2, 2), (3, 1)])
def test_a_force_on_a_point_takes_what_holds_a_mass_there(seed, mimics):
    """Turning, sliding and following joints; at rest, gravity of one unit along each axis."""
    tree = read_urdf(random_urdf(seed, 6, mimics))
    q = np.random.default_rng(seed).normal(size=(4, tree.size))
    for body in range(len(tree.parents)):
        mass = np.zeros_like(tree.parameters)
        mass[body, :4] = 1.0, *AT
        still = np.zeros_like(q)
        held = [inverse_dynamics(tree, mass, q, still, still, axis) for axis in np.eye(3)]
        found = LinkMotion.of(tree, q, body).columns(AT)
        np.testing.assert_allclose(found, -np.stack(held, axis=2), atol=1e-12)


@pytest.mark.parametrize('seed', [4, 5])
def test_efforts_are_those_of_virtual_work(seed):
    """A point moves with the joints as its force moves them."""
    tree, h = read_urdf(random_urdf(seed, 6, 2)), 1e-6
    q, body = np.random.default_rng(seed).normal(size=(3, tree.size)), len(tree.parents) - 1
    columns = LinkMotion.of(tree, q, body).columns(AT)
    for j, way in enumerate(np.eye(tree.size)):
        ahead, back = (LinkMotion.of(tree, q + s * h * way, body).points(AT) for s in (1.0, -1.0))
        np.testing.assert_allclose(columns[:, j], (ahead - back) / (2.0 * h), atol=1e-8)
