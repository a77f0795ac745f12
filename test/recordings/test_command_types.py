"""A command type is one entry: reading, writing and what the node offers follow from it."""

from __future__ import annotations

import doctest

import numpy as np
import pytest
from std_msgs.msg import Float32MultiArray

from sgp_ros.engine.samples import CommandSample
from sgp_ros.recordings import command_types
from sgp_ros.recordings.command_types import COMMAND_TYPES, CommandType
from sgp_ros.recordings.reader import open_recording
from sgp_ros.recordings.table_map import check_map
from sgp_ros.recordings.topics import Topic, choose_command
from sgp_ros.ros.messages import message_class, new_message
from sgp_ros.ros.settings import node_settings
from sgp_ros.ros.simulated_robot import simulator_settings
from test.recordings import worlds

NAME = 'std_msgs/Float32MultiArray'
DUMMY = CommandType(
    NAME,
    has_names=False,
    decode=lambda message, receipt_ns: CommandSample(
        receipt_ns, np.asarray(message.data, np.float64)
    ),
    encode=lambda make, command: make(
        NAME,
        layout=make('std_msgs/MultiArrayLayout', dim=[], data_offset=0),
        data=command.effort.astype(np.float32),
    ),
)


@pytest.fixture
def dummy(monkeypatch):
    """Another type of commands, registered in the one place there is."""
    monkeypatch.setitem(COMMAND_TYPES, NAME, DUMMY)


@pytest.mark.usefixtures('dummy')
def test_a_registered_type_is_written_found_and_read(tmp_path):
    events = [worlds.swing(1)[1], CommandSample(1_700_000_000 * 10**9, np.array([0.5, -2.0]))]
    path = worlds.write(tmp_path / 'x.mcap', events, command_type=NAME)
    expected = sorted(map(worlds.exact, events))
    assert sorted(worlds.everything(open_recording(path))) == expected


@pytest.mark.usefixtures('dummy')
def test_a_registered_type_is_chosen_by_the_rules_of_the_others():
    topics = [Topic('/joint_states', 'sensor_msgs/JointState', 1), Topic('/torque', NAME, 1)]
    assert choose_command(topics, topics[0], None) == topics[1]


@pytest.mark.usefixtures('dummy')
def test_a_registered_type_may_be_imported_from_a_table():
    quantity = {'column': 'a', 'unit': 'N'}
    content = {
        'time': {'rate': 1.0}, 'joints': {'j': {'position': {'column': 'a', 'unit': 'm'}}},
        'commands': {'j': quantity}, 'command_type': NAME,
    }  # fmt: skip
    assert check_map(content, {'a': np.zeros(3)}).command_type == NAME


@pytest.mark.usefixtures('dummy')
def test_the_nodes_offer_and_understand_a_registered_type():
    """Their settings follow from the table, and the class of a message from its name."""
    for settings in (node_settings(), simulator_settings()):
        (setting,) = (s for s in settings if s.name == 'command.type')
        assert NAME in setting.choices
    assert message_class(NAME) is Float32MultiArray
    command = CommandSample(7, np.array([0.5, -2.0]))
    message = DUMMY.message(new_message, command)
    assert worlds.exact(DUMMY.decode(message, 7)) == worlds.exact(command)


@pytest.mark.parametrize('kind', COMMAND_TYPES)
def test_every_type_is_the_same_for_rosbags_and_rclpy(kind):
    """A message of the encoder for a node reads back as the command that it was made of."""
    names = ('a',) if COMMAND_TYPES[kind].has_names else None
    command = CommandSample(7, np.array([0.25]), names)
    message = COMMAND_TYPES[kind].message(new_message, command)
    assert isinstance(message, message_class(kind))
    assert worlds.exact(COMMAND_TYPES[kind].decode(message, 7)) == worlds.exact(command)


def test_the_example_of_a_command_type_runs():
    found = doctest.testmod(command_types)
    assert found.attempted > 0
    assert found.failed == 0
