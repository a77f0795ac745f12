"""Where joints rest."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from sgp_ros.diagnosis.compare.rest import resting
from sgp_ros.diagnosis.compare.trajectory import Bandwidth

STEP = 0.005
BANDWIDTH = Bandwidth(4.0, 10.0)


def rests(velocity):
    """Return where a joint of these speeds rests, with next to no noise."""
    motion = SimpleNamespace(
        velocity=velocity[:, None], position=STEP * np.cumsum(velocity)[:, None]
    )
    raw = SimpleNamespace(step=STEP, noise_density=np.full(1, 1e-20))
    return resting(raw, motion, BANDWIDTH)[:, 0]


def swings(middle):
    """Return the speeds of a joint that swings before and after others, and where those are."""
    swing = np.sin(2.0 * np.pi * 0.5 * STEP * np.arange(800))
    return np.concatenate([swing, middle, swing]), slice(800, 800 + len(middle))


def test_a_joint_that_creeps_within_its_friction_rests():
    """Half a hundredth of its usual speed, while an elastic friction takes up what is needed."""
    speed, creeping = swings(np.full(60, 0.002))
    found = rests(speed)
    assert found[creeping].all()
    assert not found[:780].any()


def test_a_slow_motion_over_part_of_the_range_is_no_rest():
    speed, slow = swings(np.full(2000, 0.002))
    assert not rests(speed)[slow].any()


def test_a_reversal_is_no_rest_and_a_still_joint_is():
    speed, still = swings(np.zeros(40))
    found = rests(speed)
    assert found[still].all()
    assert not found[190:210].any()
