"""Laws of holding out stretches of time."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.batch.blocks import distance_to, holdout
from sgp_ros.batch.regression_data import FilterPlan, filtered_data
from sgp_ros.errors import ConfigError
from sgp_ros.robots.registry import load_robot
from test.batch.worlds import moved_axis

LINEAR_AXIS = load_robot('linear_axis')


@pytest.fixture(scope='module')
def data():
    """A minute of an axis at 20 Hz."""
    return filtered_data(moved_axis(0, duration=62.0), LINEAR_AXIS, FilterPlan(10.0, 50.0, 10))


@pytest.mark.parametrize('kind', ['tail', 'alternate'])
@pytest.mark.parametrize('share', [0.25, 0.4, 0.5])
def test_every_row_is_on_one_side(data, kind, share):
    """Nothing is lost, nothing is used twice, and the share is met."""
    train, test = holdout(data, kind, share)
    times = np.sort(np.concatenate([train.time, test.time]))
    assert np.array_equal(times, data.time)
    assert len(test.time) / len(times) == pytest.approx(share, abs=0.1)


def test_the_tail_is_the_end(data):
    """All that is held out comes after all that is learned."""
    train, test = holdout(data)
    assert train.time.max() < test.time.min()


def test_stretches_are_whole(data):
    """A held-out stretch lasts its length, and rows on both sides of it are no neighbours."""
    train, test = holdout(data, 'alternate', 0.4, 6.0)
    lengths = np.bincount(test.block)
    assert set(lengths[:-1] % 120) == {0}
    assert train.block.max() >= 3
    for number in range(train.block.max() + 1):
        assert np.diff(train.time[train.block == number]) == pytest.approx(0.05)


def test_distance_is_counted_in_standard_deviations(data):
    """Zero to itself; one where every coordinate is one standard deviation outside."""
    assert distance_to(data, data).max() == 0.0
    single = data.rows(np.arange(1))
    state = np.array([data.motion.position.max(), data.motion.velocity.max()])
    spread = np.array([data.motion.position.std(), data.motion.velocity.std()])
    outside = state + 100.0 * spread
    single.motion.position[:], single.motion.velocity[:] = outside
    assert distance_to(data, single)[0] == pytest.approx(100.0, rel=0.05)


@pytest.mark.parametrize(
    ('kind', 'share', 'length'),
    [('random', 0.4, 6.0), ('tail', 0.0, 6.0), ('tail', 1.0, 6.0), ('alternate', 0.4, 600.0),
     ('alternate', 0.4, 0.0)],
)  # fmt: skip
def test_an_impossible_split_is_refused(data, kind, share, length):
    """A side without rows would be found out much later."""
    with pytest.raises(ConfigError):
        holdout(data, kind, share, length)
