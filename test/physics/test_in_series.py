"""Drives in series: together they are the torque behind all of them."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt, in_series
from sgp_ros.physics.place import PLACES, Place
from test.physics.test_effects import MOTION

DELAY, WIDTH, LIMIT, GAIN, LAG = 0.023, 0.3, 1.1, 0.8, 0.05


def _at(name, *shape, joint=0, coefficient=1.0):
    place = Place(PLACES['all'] if joint is None else joint)
    return EffectAt(EFFECTS[name], place, np.array(shape), np.array([coefficient]))


@pytest.mark.parametrize('joint', [0, None], ids=['one motor', 'all motors'])
def test_the_changes_of_drives_add_up_to_what_is_behind_all(joint):
    """In whatever order they are listed: `gain C(D u)` behind a lag, less u."""
    drives = (
        _at('torque_gain', coefficient=GAIN - 1.0),
        _at('saturation', LIMIT),
        _at('actuator_lag', LAG),
        _at('command_delay', DELAY, joint=joint),
        _at('dead_zone', WIDTH),
    )
    found = sum(s.force(MOTION)[:, 0] for s in in_series(drives))
    behind = MOTION.drive.effort(
        0, delay=DELAY, time_constant=LAG,
        characteristic=lambda u: np.clip(u - np.clip(u, -WIDTH, WIDTH), -LIMIT, LIMIT),
    )  # fmt: skip
    np.testing.assert_allclose(found, GAIN * behind - MOTION.effort[:, 0], atol=1e-12)
    whole = sum(s.whole(MOTION).reshape(len(behind), -1)[:, 0] for s in in_series(drives))
    np.testing.assert_allclose(whole, found, atol=1e-12)
    alone = sum(s.force(MOTION)[:, 0] for s in drives)
    assert np.abs(alone - found).max() > 0.1


def test_what_the_robot_states_stands_before_what_is_found():
    """A second delay adds to that of the file; drives of other motors are not in the way."""
    stated = _at('command_delay', DELAY)
    (found,) = in_series((_at('command_delay', 0.01),), (stated, _at('dead_zone', WIDTH, joint=2)))
    total = stated.force(MOTION) + found.force(MOTION)
    np.testing.assert_allclose(
        total[:, 0], MOTION.drive.effort(0, delay=DELAY + 0.01) - MOTION.effort[:, 0], atol=1e-12
    )


def test_a_torque_constant_is_found_beside_the_one_that_is_stated():
    """Their gains multiply."""
    stated = _at('torque_gain', coefficient=GAIN - 1.0)
    (found,) = in_series((_at('torque_gain', coefficient=0.5),), (stated,))
    total = stated.force(MOTION) + found.force(MOTION)
    np.testing.assert_allclose(total[:, 0], (1.5 * GAIN - 1.0) * MOTION.effort[:, 0], atol=1e-12)
