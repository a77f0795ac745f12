"""Bodies that a diagnosis ends with."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sgp_ros.diagnosis.compare.equations import make_equations
from sgp_ros.diagnosis.compare.trajectory import choose_bandwidth, collect
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.suspects import Columns
from sgp_ros.diagnosis.prove.bodies import diagnosed_bodies
from sgp_ros.recordings.reader import open_recording
from sgp_ros.rigid.pseudo_inertia import is_consistent
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.urdf_robot import nominal_tree

CASE = Path(__file__).parents[3].parent / 'shared' / 'practice' / 'cases' / 'case_32'

pytestmark = pytest.mark.skipif(not CASE.exists(), reason='needs the practice cases')


@pytest.fixture(scope='module')
def equations():
    robot = load_robot(str(CASE / 'robot.urdf'))
    tree = nominal_tree(robot)
    raw = collect(open_recording(CASE / 'real_test.mcap').events(), robot)
    return make_equations(raw, tree, choose_bandwidth(raw, tree))


def _model(equations, *, is_free):
    start = np.sqrt((equations.d**2).mean(axis=0)) + 1e-9
    return fit(Columns(equations), (), start, is_free=is_free, rounds=1)


def test_bodies_that_were_not_free_are_the_nominal_ones(equations):
    assert diagnosed_bodies(equations, _model(equations, is_free=False)) is None


def test_bodies_that_can_exist_are_those_of_the_model(equations):
    model = _model(equations, is_free=True)
    small = replace(model, w=np.full(len(model.w), 0.01))
    nominal = equations.motion.tree.parameters
    expected = nominal + (small.w @ equations.directions).reshape(nominal.shape)
    np.testing.assert_allclose(diagnosed_bodies(equations, small), expected, atol=1e-12)


def test_bodies_that_cannot_exist_are_replaced_by_such_as_can(equations):
    """Near in what the data show: the projection costs less than nominal bodies would."""
    model = _model(equations, is_free=True)
    wild = replace(model, w=model.w + 0.0)
    wild.w[0] = -6.0  # a negative mass: six times a quarter less
    found = diagnosed_bodies(equations, wild)
    assert np.all(is_consistent(found))
    change = (found - equations.motion.tree.parameters).ravel()
    w = np.linalg.solve(equations.directions.T, change)
    R = model.frame.R
    assert np.linalg.norm(R @ (w - wild.w)) < np.linalg.norm(R @ wild.w)
