"""Joints of a recording that are not those of the robot."""

from __future__ import annotations

import pytest

from sgp_ros.batch.acceptance import require_joints
from sgp_ros.engine.samples import JointSample, frozen_array
from sgp_ros.errors import RecordingError
from sgp_ros.robots.registry import load_robot

ROBOT = load_robot('double_pendulum')


def _state(*names):
    return JointSample(1, names, frozen_array([0.0] * len(names)), None, None)


def test_other_joints_are_named_with_the_nearest_of_each():
    other = _state('fer_shoulder', 'fer_elbow')
    with pytest.raises(RecordingError) as caught:
        require_joints([other], ROBOT, 'a.mcap')
    text = str(caught.value)
    assert "a.mcap contains the joints ['fer_elbow', 'fer_shoulder']" in text
    assert "the joints ['shoulder', 'elbow'] of double_pendulum" in text
    assert 'shoulder is closest to fer_shoulder, elbow is closest to fer_elbow' in text


def test_joints_that_come_apart_are_refused_and_further_ones_are_not():
    with pytest.raises(RecordingError, match='no message in x contains all joints'):
        require_joints([_state('shoulder'), _state('elbow')], ROBOT, 'x')
    require_joints([_state('gripper'), _state('elbow', 'gripper', 'shoulder')], ROBOT)
    require_joints([], ROBOT)


def test_joints_that_a_recording_lacks_are_left_out_as_the_message_says():
    """Such as a gripper that is in the URDF and not in the bag."""
    with pytest.raises(RecordingError) as caught:
        require_joints([_state('shoulder')], ROBOT, 'a.mcap')
    assert 'a.mcap lacks elbow of double_pendulum' in str(caught.value)
    assert '"joints: [shoulder]"' in str(caught.value)


def test_a_gripper_of_another_name_is_left_out_or_renamed():
    """The nearest of all other names, such as that of a wheel, says nothing."""
    with pytest.raises(RecordingError) as caught:
        require_joints([_state('shoulder', 'gripper_width', 'wheel')], ROBOT, 'a.mcap')
    assert 'a.mcap lacks elbow of double_pendulum' in str(caught.value)
    assert '"joints: [shoulder]"' in str(caught.value)
    assert 'if one of gripper_width, wheel is meant, rename it' in str(caught.value)
