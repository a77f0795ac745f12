"""Motions that would show what a recording did not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.batch.excitation import JointRange, judge_excitation, structural_base
from sgp_ros.batch.suggestions import suggest_motions
from sgp_ros.errors import ConfigError
from sgp_ros.physics.term import Joint, Motion
from sgp_ros.rigid.base_parameters import RegressorFactor
from sgp_ros.robots.registry import load_robot
from test.batch.chains import chain, recorded_motion, states


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


def test_suggestions_stay_within_the_limits_of_the_file():
    """Positions and speeds of every moving and every held joint; open limits turn once around."""
    robot = chain([(0, 0, 1), (0, 1, 0)], [(0, 0, 0), (0.3, 0, 0.1)])
    limited = replace(robot.joints[0], lower=0.2, upper=0.5, velocity_limit=0.3)
    robot = replace(robot, joints=(limited, robot.joints[1]))
    recorded = RegressorFactor.nothing(len(robot.coefficients))
    for suggestion in suggest_motions(robot, recorded, np.random.default_rng(0), limit=5):
        assert 0.2 <= suggestion.held.get(limited.name, 0.3) <= 0.5
        for s in suggestion.moving:
            if s.joint == limited.name:
                assert 0.2 <= s.centre - s.amplitude < s.centre + s.amplitude <= 0.5
                assert s.amplitude * s.frequency <= 0.3
    assert JointRange.of(robot.joints[1]) == JointRange()


@pytest.mark.parametrize(
    ('limits', 'expected'),
    [
        ((-1.0, math.inf), (-1.0, math.pi)),
        ((5.0, math.inf), (5.0, 5.0 + math.pi)),
        ((-math.inf, -5.0), (-5.0 - math.pi, -5.0)),
        ((0.0, 0.0), (-math.pi, math.pi)),
    ],
)
def test_half_open_limits_leave_room_and_zeros_are_none(limits, expected):
    joint = Joint('j', lower=limits[0], upper=limits[1])
    found = JointRange.of(joint)
    assert (found.lower, found.upper) == expected


def test_a_forward_model_gets_no_suggestions():
    """Its regressor needs efforts, which a motion does not prescribe."""
    robot = load_robot('reaction_wheel')
    with pytest.raises(ConfigError, match='acceleration'):
        suggest_motions(robot, RegressorFactor.nothing(10), np.random.default_rng(0))
