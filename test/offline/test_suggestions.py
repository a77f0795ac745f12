"""Motions that would show what a recording did not."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.core.base_parameters import RegressorFactor
from sgp_ros.errors import ConfigError
from sgp_ros.offline.excitation import JointRange, judge_excitation, structural_base
from sgp_ros.offline.suggestions import suggest_motions
from sgp_ros.robots.registry import ROBOTS
from sgp_ros.robots.robot import Motion
from test.offline.chains import chain, recorded_motion, states


def test_nothing_is_suggested_where_nothing_is_missing():
    """A random motion has shown all that the robot can show."""
    robot = chain([(0, 0, 1), (0, 1, 0)], [(0, 0, 0), (0.3, 0, 0.1)])
    recorded = recorded_motion(robot, *states(3, 2))
    assert suggest_motions(robot, recorded, np.random.default_rng(1)) == ()


def test_suggestions_excite_what_was_missing():
    """Doing what they say raises the rank by what they promise."""
    robot = chain([(0, 0, 1), (0, 1, 0)], [(0, 0, 0), (0.3, 0, 0.1)])
    recorded = RegressorFactor.nothing(20)
    structural = structural_base(robot, np.random.default_rng(0))
    suggestions = suggest_motions(robot, recorded, np.random.default_rng(1), limit=5)
    assert sum(s.gained for s in suggestions) == structural.rank
    time = np.linspace(0.0, 20.0, 200)
    for suggestion in suggestions:
        q, v, a = np.zeros((3, 200, 2))
        for j, name in enumerate(robot.joint_names):
            q[:, j] = suggestion.held.get(name, 0.0)
        for s in suggestion.moving:
            j = robot.joint_names.index(s.joint)
            q[:, j] = s.centre + s.amplitude * np.sin(s.frequency * time)
            v[:, j] = s.amplitude * s.frequency * np.cos(s.frequency * time)
            a[:, j] = -s.amplitude * s.frequency**2 * np.sin(s.frequency * time)
        motion = Motion(q, v, a, np.zeros_like(q))
        recorded = recorded.with_rows(robot.regressor(motion))
    assert judge_excitation(structural, recorded).missing == 0


def test_suggestions_name_the_joint_that_stood_still():
    """The first of a parallel pair moved; the second has to, and the words say so."""
    robot = chain([(0, 0, 1), (0, 0, 1)], [(0, 0, 0), (0.3, 0, 0)])
    q, v, a = states(4, 2)
    q[:, 1] = v[:, 1] = a[:, 1] = 0.0
    recorded = recorded_motion(robot, q, v, a)
    ranges = {'j2': JointRange(-0.4, 0.6, 1.0, 3.0)}
    first = suggest_motions(robot, recorded, np.random.default_rng(0), ranges=ranges)[0]
    assert 'j2' in {s.joint for s in first.moving}
    assert 'j2 by 0.45 rad about 0.1 rad' in first.text
    for s in first.moving:
        if s.joint == 'j2':
            assert s.amplitude * s.frequency <= 1.0
            assert s.amplitude * s.frequency**2 <= 3.0


def test_a_forward_model_gets_no_suggestions():
    """Its regressor needs efforts, which a motion does not prescribe."""
    robot = ROBOTS['reaction_wheel']
    with pytest.raises(ConfigError, match='acceleration'):
        suggest_motions(robot, RegressorFactor.nothing(10), np.random.default_rng(0))
