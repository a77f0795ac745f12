"""The choice of topics is unambiguous or asks the user."""

from __future__ import annotations

import pytest

from sgp_ros.errors import RecordingError
from sgp_ros.recordings.topics import Topic, choose_command, choose_joint_states

STATE, ARRAY, NUMBER = 'sensor_msgs/JointState', 'std_msgs/Float64MultiArray', 'std_msgs/Float64'
TRAJECTORY = 'trajectory_msgs/JointTrajectory'


def _topics(**kinds: str) -> list[Topic]:
    return [Topic('/' + name.replace('__', '/'), kind, 1) for name, kind in kinds.items()]


def _command(topics: list[Topic], wanted: str | None = None) -> str | None:
    topic = choose_command(topics, topics[0], wanted)
    return topic.name if topic else None


@pytest.mark.parametrize(
    ('topics', 'chosen'),
    [
        (_topics(robot__measured=STATE), '/robot/measured'),
        (_topics(other=STATE, arm__joint_states=STATE), '/arm/joint_states'),
        (_topics(arm__joint_states=STATE, joint_states=STATE), '/joint_states'),
        (_topics(state=STATE, sgp__predicted_joint_states=STATE), '/state'),
        (_topics(state=STATE, effort__commands=STATE), '/state'),
    ],
)
def test_joint_states_are_chosen_by_being_alone_or_by_name(topics, chosen):
    assert choose_joint_states(topics, None).name == chosen


def test_predictions_are_never_taken_for_measurements():
    with pytest.raises(RecordingError, match='no sensor_msgs/JointState'):
        choose_joint_states(_topics(sgp__predicted_joint_states=STATE), None)


def test_ambiguous_joint_states_list_the_candidates_and_the_option():
    topics = _topics(left__joint_states=STATE, right__joint_states=STATE)
    with pytest.raises(RecordingError, match=r'/left.*/right.*--joint-states'):
        choose_joint_states(topics, None)


def test_named_joint_states_win_over_the_choice():
    topics = _topics(joint_states=STATE, sgp__predicted_joint_states=STATE)
    assert choose_joint_states(topics, 'sgp/predicted_joint_states') == topics[1]


@pytest.mark.parametrize('wanted', ['/nothing', '/text'])
def test_named_topic_must_exist_with_the_right_type(wanted):
    topics = _topics(joint_states=STATE, text='std_msgs/String')
    with pytest.raises(RecordingError, match=wanted):
        choose_joint_states(topics, wanted)
    with pytest.raises(RecordingError, match=wanted):
        choose_command(topics, topics[0], wanted)


@pytest.mark.parametrize(
    ('others', 'chosen'),
    [
        ({}, None),
        ({'effort_controller__commands': ARRAY}, '/effort_controller/commands'),
        ({'effort__commands': STATE, 'temperature': NUMBER}, '/effort/commands'),
        ({'torque': NUMBER}, '/torque'),
        ({'torque': NUMBER, 'temperature': NUMBER}, None),
        ({'arm__commands': ARRAY, 'command': ARRAY}, '/command'),
        ({'sgp__prediction': TRAJECTORY, 'sgp__prediction_variance': TRAJECTORY}, None),
        ({'arm__joint_trajectory': TRAJECTORY}, '/arm/joint_trajectory'),
        ({'arm__joint_trajectory': TRAJECTORY, 'hand__joint_trajectory': TRAJECTORY}, None),
    ],
)
def test_command_is_chosen_by_name_or_as_the_only_one_of_its_kind(others, chosen):
    assert _command(_topics(joint_states=STATE, **others)) == chosen


def test_ambiguous_commands_list_the_candidates_and_the_option():
    topics = _topics(joint_states=STATE, left__commands=ARRAY, right__commands=ARRAY)
    with pytest.raises(RecordingError, match=r'/left.*/right.*--command'):
        _command(topics)


def test_none_takes_no_command():
    assert _command(_topics(joint_states=STATE, command=ARRAY), 'none') is None
