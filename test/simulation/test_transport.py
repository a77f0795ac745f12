"""Laws of the way from the sensors to the file."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.errors import ConfigError
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.recording import simulate
from sgp_ros.simulation.sensors import Sensors
from sgp_ros.simulation.transport import DeliveredCommand, DeliveredState, Transport, deliver


@pytest.fixture(scope='module')
def recording():
    """Twenty seconds of the reaction wheel with everything measured."""
    sensors = Sensors(measures_velocity=True, measures_effort=True, command_latency_s=1e-3)
    return simulate(make_simulation('reaction_wheel', sensors=sensors), 20.0)


def split(messages):
    states = [m for m in messages if isinstance(m, DeliveredState)]
    return states, [m for m in messages if isinstance(m, DeliveredCommand)]


def test_perfect_transport_changes_nothing(recording):
    """Every sample arrives with its own times, commands as late as they were given."""
    states, commands = split(deliver(recording, Transport()))
    np.testing.assert_array_equal([s.position for s in states], recording.position)
    np.testing.assert_array_equal([s.effort for s in states], recording.effort)
    np.testing.assert_array_equal([s.stamp_ns for s in states], recording.stamps_ns)
    np.testing.assert_array_equal([s.log_ns for s in states], recording.stamps_ns)
    np.testing.assert_array_equal([c.effort for c in commands], recording.command)
    np.testing.assert_array_equal([c.log_ns for c in commands], recording.stamps_ns + 1_000_000)


def test_dropped_share_is_the_one_that_was_asked_for(recording):
    """Within four standard deviations of the binomial law."""
    arrived = len(deliver(recording, Transport(drop=0.1), seed=5))
    asked = 2 * len(recording.stamps_ns)
    assert abs(arrived - 0.9 * asked) < 4.0 * np.sqrt(0.09 * asked)


def test_logs_are_late_by_up_to_the_latency_and_in_order(recording):
    """Also with noisy stamps; an array without header is logged when it begins to hold."""
    transport = Transport(log_latency_s=2e-3, stamp_noise_s=1e-4)
    messages = deliver(recording, transport)
    logs = [m.log_ns for m in messages]
    assert logs == sorted(logs)
    states, commands = split(messages)
    lags = np.array([s.log_ns - s.stamp_ns for s in states])
    assert lags.min() >= 0
    assert 1.8e6 < lags.max() <= 2e6
    np.testing.assert_array_equal([c.log_ns for c in commands], recording.command_stamps_ns)
    errors = np.sort([s.stamp_ns for s in states]) - recording.stamps_ns
    assert np.std(errors) == pytest.approx(1e5, rel=0.1)


def test_joints_in_another_order_keep_their_numbers(recording):
    """The same permutation for names, positions, velocities and efforts."""
    orders = set()
    for seed in range(8):
        state = split(deliver(recording, Transport(is_permuted=True), seed))[0][100]
        index = [recording.joint_names.index(name) for name in state.names]
        np.testing.assert_array_equal(state.position, recording.position[100][index])
        np.testing.assert_array_equal(state.velocity, recording.velocity[100][index])
        np.testing.assert_array_equal(state.effort, recording.effort[100][index])
        orders.add(state.names)
    assert len(orders) == 2


def test_named_commands_carry_their_own_stamp(recording):
    """The log may be late, the stamp is the time from which the command holds."""
    transport = Transport(has_named_commands=True, log_latency_s=5e-3)
    commands = split(deliver(recording, transport))[1]
    assert {c.names for c in commands} == {('wheel',)}
    stamps = np.sort([c.stamp_ns for c in commands])
    np.testing.assert_array_equal(stamps, recording.command_stamps_ns)
    assert max(c.log_ns - c.stamp_ns for c in commands) > 4_000_000


def test_equal_seeds_deliver_equally(recording):
    """The noise of the transport is a function of the seed."""
    transport = Transport(stamp_noise_s=1e-4, log_latency_s=1e-3, drop=0.05)
    logs = [[m.log_ns for m in deliver(recording, transport, seed)] for seed in (1, 1, 2)]
    assert logs[0] == logs[1]
    assert logs[0] != logs[2]


@pytest.mark.parametrize('wrong', [{'drop': 1.0}, {'drop': -0.1}, {'stamp_noise_s': -1.0}])
def test_impossible_transport_is_refused(wrong):
    """All messages lost, or time that runs backwards."""
    with pytest.raises(ConfigError):
        Transport(**wrong).checked()
