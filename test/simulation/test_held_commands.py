"""Commands that hold until the next one arrives."""

import numpy as np

from sgp_ros.simulation.held_commands import HeldCommands


def test_before_the_first_command_there_is_nothing():
    assert HeldCommands([0, 0]).arrived(5).tolist() == [0.0, 0.0]


def test_a_command_given_ahead_of_its_time_leaves_the_one_before_in_force():
    commands = HeldCommands([0])
    commands.hold(0, np.array([1.0]))
    commands.hold(10, np.array([2.0]))
    assert commands.arrived(9).tolist() == [1.0]
    assert commands.switches(5, 20) == [10]
    assert commands.arrived(10).tolist() == [2.0]


def test_each_channel_waits_for_its_own_delay():
    commands = HeldCommands([0, 30])
    for time_ns in range(0, 100, 10):
        commands.hold(time_ns, np.array([time_ns, time_ns], dtype=float))
        assert commands.arrived(time_ns).tolist() == [time_ns, max(time_ns - 30, 0)]
