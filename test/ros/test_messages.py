"""Messages of an estimate, built without a graph."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from sgp_ros.engine.results import Channel, Estimate, ParameterEstimate
from sgp_ros.recordings.messages import (
    Status,
    diagnostics_message,
    joint_sample,
    joint_state_message,
    trajectory_message,
)
from sgp_ros.recordings.predictions import outputs
from sgp_ros.ros.messages import new_message
from sgp_ros.ros.publishers import parameter_status

STAMP_NS = 1_700_000_000_123_456_789
NAN = float('nan')


def _channel(mean: Sequence[float]) -> Channel:
    variance = np.abs(np.array(mean))
    return Channel(np.array([9.0, 9.0]), np.array(mean), variance, 0.25 * variance)


def _estimate(acceleration: Sequence[float], effort: Sequence[float]) -> Estimate:
    state = np.array([0.1, 0.2]), np.array([1.0, 2.0])
    channels = _channel(acceleration), _channel(effort)
    return Estimate(
        STAMP_NS, ('pole', 'wheel'), *state, *channels, is_scored=True, is_learned=True
    )


def test_a_prediction_holds_query_and_means_at_the_stamp_of_its_sample() -> None:
    found = outputs(_estimate([3.0, 4.0], [NAN, 5.0]))
    assert found is not None
    message = trajectory_message(new_message, found.stamp_ns, found.names, found.prediction)
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (1_700_000_000, 123_456_789)
    assert list(message.joint_names) == ['pole', 'wheel']
    (point,) = message.points
    assert list(point.positions) == [0.1, 0.2]
    assert list(point.velocities) == [1.0, 2.0]
    assert list(point.accelerations) == [3.0, 4.0]
    np.testing.assert_array_equal(point.effort, [NAN, 5.0])


def test_a_variance_has_no_query() -> None:
    found = outputs(_estimate([3.0, 4.0], [0.5, 5.0]))
    assert found is not None
    (point,) = trajectory_message(new_message, found.stamp_ns, found.names, found.variance).points
    assert [len(point.positions), len(point.velocities)] == [0, 0]
    assert list(point.accelerations) == [3.0, 4.0]
    assert list(point.effort) == [0.5, 5.0]
    assert list(found.raw_variance.accelerations) == [0.75, 1.0]
    assert list(found.raw_variance.effort) == [0.125, 1.25]


def test_a_channel_that_the_robot_lacks_stays_empty() -> None:
    found = outputs(_estimate([3.0, 4.0], [NAN, NAN]))
    assert found is not None
    assert len(found.prediction.effort) == len(found.variance.effort) == 0
    assert len(joint_state_message(new_message, found.joint_state).effort) == 0


def test_nothing_is_published_before_there_is_a_model() -> None:
    assert outputs(_estimate([NAN, NAN], [NAN, NAN])) is None


def test_a_published_state_reads_back_as_the_same_sample() -> None:
    found = outputs(_estimate([3.0, 4.0], [1.5, 5.0]))
    assert found is not None
    again = joint_sample(joint_state_message(new_message, found.joint_state), 0)
    assert (again.stamp_ns, again.names) == (STAMP_NS, ('pole', 'wheel'))
    np.testing.assert_array_equal(again.velocity, found.joint_state.velocity)
    np.testing.assert_array_equal(again.effort, [1.5, 5.0])


def test_diagnostics_keep_level_and_values() -> None:
    (status,) = diagnostics_message(
        new_message, STAMP_NS, [Status('a', 2, 'b', 'c', {'d': '1'})]
    ).status
    assert (status.level, status.name, status.message) == (b'\x02', 'a', 'b')
    assert [(entry.key, entry.value) for entry in status.values] == [('d', '1')]


@pytest.mark.parametrize('std', [0.5, None])
def test_a_parameter_is_a_number_that_tools_can_plot(std: float | None) -> None:
    estimate = ParameterEstimate('w1', 'pole', 43.1, std, 'rad/s^2', std is not None)
    status = parameter_status(estimate, 'a robot')
    assert float(status.values['value']) == 43.1
    assert ('std' in status.values) is (std is not None)
    assert status.values['unit'] == 'rad/s^2'
