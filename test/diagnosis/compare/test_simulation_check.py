"""Whether a robot describes its simulation."""

from __future__ import annotations

from sgp_ros.diagnosis.compare.simulation_check import disagreement, nominal_shares
from sgp_ros.diagnosis.decide.decision import LEAST_SHARE
from test.diagnosis.worlds import events_of


def test_a_simulation_of_the_nominal_robot_leaves_nothing_to_say(robots, perfect):
    """Its errors are those of filters and encoders."""
    shares = nominal_shares(events_of(perfect[2]), *robots[2])
    assert list(shares) == ['joint0', 'joint1']
    assert max(shares.values()) < 0.1 * LEAST_SHARE
    assert disagreement(shares, 'sim.mcap') == ''


def test_a_simulation_of_another_robot_is_told_with_its_joint_and_number(robots, heavy):
    """A last link that is heavier by 30 % shows most in the last joint."""
    shares = nominal_shares(events_of(heavy[2]), *robots[2])
    said = disagreement(shares, 'sim.mcap')
    assert 'sim.mcap' in said
    assert f'{100.0 * shares["joint1"]:.2g} % of the mean squared effort of joint1' in said
