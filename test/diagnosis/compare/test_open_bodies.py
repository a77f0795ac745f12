"""Bodies that a robot file leaves open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.diagnosis.compare.bodies import body_directions
from sgp_ros.diagnosis.compare.open_bodies import open_bodies, with_open_bodies
from sgp_ros.diagnosis.compare.trajectory import collect
from sgp_ros.diagnosis.pipeline import diagnose
from sgp_ros.errors import ConfigError
from sgp_ros.rigid.pseudo_inertia import is_consistent
from test.diagnosis.worlds import CHAINS, events_of, simulate


def _hollow(tree, *bodies):
    parameters = tree.parameters.copy()
    parameters[list(bodies)] = 0.0
    return replace(tree, parameters=parameters)


def test_only_bodies_that_leave_a_joint_without_inertia_are_open(robots):
    """A hollow first link is carried along with the second; a point on the axis is no inertia."""
    _, tree = robots[2]
    assert open_bodies('chain', tree) == ()
    assert open_bodies('chain', _hollow(tree, 1)) == (1,)
    assert open_bodies('chain', _hollow(tree, 0, 1)) == (0, 1)
    assert open_bodies('chain', _hollow(tree, 0)) == ()
    point = tree.parameters.copy()
    point[1] = [0.2, *np.zeros(9)]
    assert open_bodies('chain', replace(tree, parameters=point)) == (1,)


def test_a_singular_robot_of_whole_bodies_is_refused(robots):
    """There is no link to blame: no estimate would mend it."""
    _, tree = robots[1]
    flat = tree.parameters.copy()
    flat[0] = [1.0, 0, 0, 0, 1.0, 0, 0, 0, 0, 1.0]  # nothing about the joint's own axis
    with pytest.raises(ConfigError, match='singular'):
        open_bodies('chain', replace(tree, parameters=flat))


def test_open_bodies_are_found_beside_friction(robots):
    """Gravity and acceleration show first moment and inertia of the last link."""
    robot, tree = robots[2]
    world = simulate(CHAINS[2], 5, 8.0, force=lambda t, q, v: (-0.2 * v[0], -0.1 * v[1]))
    raw = collect(events_of(world), robot)
    filled = with_open_bodies(raw, _hollow(tree, 1), (1,))
    np.testing.assert_array_equal(filled.parameters[0], tree.parameters[0])
    assert np.all(is_consistent(filled.parameters))
    np.testing.assert_allclose(filled.parameters[1, [3, 6]], tree.parameters[1, [3, 6]], rtol=0.03)


@pytest.mark.long
def test_a_robot_without_inertia_is_diagnosed_and_its_links_are_named(robots):
    """Friction is still told from inertia, and no body is called wrong that was never stated."""
    robot, tree = robots[1]
    world = simulate(CHAINS[1], 11, 8.0, dry=lambda t, q, s: 0.4)
    found = diagnose(events_of(world), robot, _hollow(tree, 0), {})
    assert any('link0' in remark and '--bodies' in remark for remark in found.remarks)
    named = {f.effect: f.parameters for f in found.findings}
    assert named['coulomb_friction']['level'].value == pytest.approx(0.4, rel=0.05)
    assert found.parameter_errors == ()
    assert np.all(is_consistent(found.bodies))


def test_directions_of_open_bodies_are_as_wide_as_the_bodies(robots):
    _, tree = robots[2]
    narrow, wide = body_directions(tree), body_directions(tree, (1,))
    np.testing.assert_array_equal(narrow[:10], wide[:10])
    np.testing.assert_allclose(wide[10], tree.parameters.ravel() * ([0.0] * 10 + [1.0] * 10))
