"""Recordings that several tests look at, made once."""

from __future__ import annotations

import pytest

from sgp_ros.diagnosis.compare.bandwidth import choose_bandwidth
from sgp_ros.diagnosis.compare.equations import make_equations
from sgp_ros.diagnosis.compare.trajectory import collect
from test.diagnosis.worlds import CHAINS, events_of, heavier, robot_of, simulate


@pytest.fixture(scope='session')
def robots(tmp_path_factory):
    """Robot and nominal tree by the number of links."""
    return {k: robot_of(tmp_path_factory.mktemp('urdf'), chain) for k, chain in CHAINS.items()}


@pytest.fixture(scope='session')
def equations_for(robots):
    """From a world to its raw trajectory and equations."""

    def make(world, **options):
        robot, tree = robots[world.position.shape[1]]
        raw = collect(events_of(world, **options), robot)
        return raw, make_equations(raw, tree, choose_bandwidth(raw, tree))

    return make


@pytest.fixture(scope='session')
def perfect():
    """The nominal chains in motion, by the number of links."""
    return {k: simulate(chain, 1, 10.0) for k, chain in CHAINS.items()}


@pytest.fixture(scope='session')
def heavy():
    """Chains whose last link is heavier by 30 %, by the number of links."""
    return {k: simulate(heavier(chain, k - 1, 1.3), 2, 10.0) for k, chain in CHAINS.items()}


@pytest.fixture(scope='session')
def viscous():
    """One link with more damping."""
    return simulate(CHAINS[1], 3, 10.0, force=lambda t, q, v: (-0.3 * v[0],))


@pytest.fixture(scope='session')
def dry():
    """One link with dry friction that holds it at times."""
    return simulate(CHAINS[1], 4, 10.0, dry=lambda t, q, s: 1.2, reach=1.0)
