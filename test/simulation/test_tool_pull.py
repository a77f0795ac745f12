"""Forces on the tool in the simulation, against the columns of a diagnosis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.errors import ConfigError
from sgp_ros.robots.observed_motion import ObservedMotion
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.reaction_wheel import REACTION_WHEEL
from sgp_ros.simulation.recording import simulate
from sgp_ros.simulation.tool_pull import ToolPull
from sgp_ros.simulation.tree import pulled
from sgp_ros.simulation.tree_simulator import tree_simulator
from test.physics.test_tool_law import PATHS, TREE, URDF, stated

SIMULATOR = tree_simulator(URDF)


@pytest.mark.parametrize('path', PATHS)
def test_a_force_on_the_tool_moves_the_robot_as_its_columns_say(path):
    """The law is written twice: with MuJoCo's Jacobian here, with that of the tree there."""
    (law,), _ = stated(path)
    found = simulate(make_simulation(SIMULATOR, effects=[law], seed=1), 2.0)
    free = simulate(make_simulation(SIMULATOR, seed=1), 2.0)
    assert np.abs(found.true_position - free.true_position).max() > 1e-3
    time = 1e-9 * (found.stamps_ns - found.stamps_ns[0])
    motion = ObservedMotion(
        TREE, time, time[1], found.true_position, found.true_velocity, found.true_acceleration,
        np.zeros_like(found.true_position), None,
    )  # fmt: skip
    needed = motion.nominal_effort - law.force(motion)
    np.testing.assert_allclose(needed, found.command, atol=1e-9)


def test_where_a_direction_has_no_meaning_there_is_no_force():
    """At the point of the world itself, and at rest."""
    (law,), _ = stated('distance')
    pull = ToolPull.of(law.effect, law.parameters)
    anchor = np.array([pull.numbers[n] for n in ('px', 'py', 'pz')])
    assert not pull.force(anchor, np.ones(3)).any()
    drag = ToolPull.of(*((x := stated('motion')[0][0]).effect, x.parameters))
    assert not drag.force(anchor, np.zeros(3)).any()


def test_a_robot_without_a_link_for_the_tool_is_refused():
    (law,), _ = stated('x')
    pull = ToolPull.of(law.effect, law.parameters)
    with pytest.raises(ConfigError, match='a robot from a URDF'):
        pulled(REACTION_WHEEL.mechanism, pull)
    assert pulled(replace(SIMULATOR.mechanism), pull).pulls == (pull,)
