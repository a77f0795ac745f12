"""Messages of any library become the same samples; wrong ones are refused with a reason."""

from __future__ import annotations

import numpy as np
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from sgp_ros.engine.samples import CommandSample
from sgp_ros.errors import MessageError
from sgp_ros.recordings.command_types import COMMAND_TYPES
from sgp_ros.recordings.messages import joint_sample
from sgp_ros.recordings.typestore import decoder, new_message, serialize
from test.recordings.worlds import exact


def _state(names=('a', 'b'), position=(1.0, 2.0), velocity=(), effort=(), sec=3) -> JointState:
    message = JointState()
    message.header.stamp.sec = sec
    message.header.stamp.nanosec = 4 if sec else 0
    message.name = list(names)
    message.position = list(position)
    message.velocity = list(velocity)
    message.effort = list(effort)
    return message


def _trajectory(names=('a', 'b'), effort=(5.0, 6.0)) -> JointTrajectory:
    message = JointTrajectory()
    message.header.stamp.sec = 3
    message.joint_names = list(names)
    message.points = [JointTrajectoryPoint(effort=list(effort))]
    return message


COMMANDS = {
    'std_msgs/Float64MultiArray': Float64MultiArray(data=[5.0, 6.0]),
    'std_msgs/Float64': Float64(data=5.0),
    'sensor_msgs/JointState': _state(position=(), effort=(5.0, 6.0)),
    'trajectory_msgs/JointTrajectory': _trajectory(),
}


def test_joint_sample_takes_the_header_stamp():
    assert joint_sample(_state(), 7).stamp_ns == 3_000_000_004


def test_joint_sample_takes_the_receipt_where_the_stamp_is_zero():
    assert joint_sample(_state(sec=0), 7).stamp_ns == 7


def test_empty_velocity_and_effort_mean_none():
    sample = joint_sample(_state(), 7)
    assert sample.velocity is None
    assert sample.effort is None


def test_nan_stays_in_the_sample():
    """The engine refuses and counts it; dropping it here would hide it."""
    sample = joint_sample(_state(position=(1.0, float('nan'))), 7)
    assert np.isnan(sample.position[1])


@pytest.mark.parametrize(
    'message',
    [
        _state(position=(1.0,)),
        _state(velocity=(1.0,)),
        _state(effort=(1.0, 2.0, 3.0)),
        _state(names=('a', 'a')),
        _state(names=(), position=()),
    ],
)
def test_joint_state_with_unequal_lengths_or_names_is_refused(message):
    with pytest.raises(MessageError):
        joint_sample(message, 7)


def test_samples_do_not_share_memory_with_the_message():
    """A middleware may reuse its buffers."""
    message = _state()
    sample = joint_sample(message, 7)
    message.position[0] = 9.0
    assert sample.position[0] == 1.0
    assert not sample.position.flags.writeable


def test_every_converter_has_an_example_here():
    assert set(COMMANDS) == set(COMMAND_TYPES)


@pytest.mark.parametrize('kind', COMMANDS)
def test_converter_keeps_numbers_names_and_time(kind):
    sample = COMMAND_TYPES[kind].decode(COMMANDS[kind], 7)
    assert sample.effort.tolist() == [5.0, 6.0][: len(sample.effort)]
    has_header = kind in {'sensor_msgs/JointState', 'trajectory_msgs/JointTrajectory'}
    assert sample.names == (('a', 'b') if has_header else None)
    assert sample.stamp_ns // 10**9 == (3 if has_header else 0)


@pytest.mark.parametrize('kind', COMMANDS)
def test_rclpy_and_rosbags_messages_give_the_same_sample(kind):
    live = COMMAND_TYPES[kind].decode(COMMANDS[kind], 7)
    replayed = decoder(kind, 'cdr')(
        serialize(kind, COMMAND_TYPES[kind].message(new_message, live))
    )
    assert exact(COMMAND_TYPES[kind].decode(replayed, 7)) == exact(live)


@pytest.mark.parametrize(
    ('kind', 'message'),
    [
        ('std_msgs/Float64MultiArray', Float64MultiArray()),
        ('sensor_msgs/JointState', _state(position=())),
        ('sensor_msgs/JointState', _state(effort=(1.0,))),
        ('trajectory_msgs/JointTrajectory', _trajectory(effort=())),
        ('trajectory_msgs/JointTrajectory', JointTrajectory(joint_names=['a'])),
    ],
)
def test_command_without_one_effort_per_joint_is_refused(kind, message):
    with pytest.raises(MessageError):
        COMMAND_TYPES[kind].decode(message, 7)


def test_command_that_the_type_cannot_hold_is_a_mistake_of_the_caller():
    for kind, command, said in (
        ('sensor_msgs/JointState', CommandSample(1, np.ones(1)), 'without joint names'),
        ('std_msgs/Float64', CommandSample(1, np.ones(1), ('a',)), 'with joint names'),
        ('std_msgs/Float64', CommandSample(1, np.ones(2)), '2 numbers'),
    ):
        with pytest.raises(ValueError, match=said):
            COMMAND_TYPES[kind].message(new_message, command)


def test_bytes_that_are_no_message_are_refused():
    with pytest.raises(MessageError):
        decoder('sensor_msgs/JointState', 'cdr')(b'\x00\x01\x00\x00\x07')
