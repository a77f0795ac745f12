"""Where joints rest."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from sgp_ros.diagnosis.compare.rest import resting
from sgp_ros.diagnosis.compare.trajectory import Bandwidth

STEP = 0.005
BANDWIDTH = Bandwidth(4.0, 10.0)


def rests(velocity, noise_density=1e-20, jitter=0.0):
    """Return where a joint of these speeds rests, usually with next to no noise.

    With noise of its positions that has a density, and with jitter of its stamps [s].
    """
    position = STEP * np.cumsum(velocity)[:, None]
    acceleration = np.gradient(velocity)[:, None] / STEP
    motion = SimpleNamespace(
        velocity=velocity[:, None], position=position, acceleration=acceleration
    )
    spread = np.hypot(math.sqrt(0.5 * noise_density / STEP), jitter * velocity[:, None])
    rough = spread * np.random.default_rng(1).normal(0.0, 1.0, position.shape)
    density = 2.0 * STEP * np.full(1, rough.var())
    raw = SimpleNamespace(step=STEP, noise_density=density, position=position + rough)
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


@pytest.mark.parametrize('noise', [1e-9, 1e-7, 4e-7])
def test_a_joint_that_turns_many_times_and_reverses_does_not_rest_there(noise):
    """Where it reverses it is in a small part of its range, and slow beside a usual noise."""
    speed = 8.0 * np.cos(2.0 * np.pi * 0.05 * STEP * np.arange(8000))
    assert not rests(speed, noise).any()
    halts = np.concatenate([speed[:3000], np.zeros(60), speed[3000:]])
    assert rests(halts, noise)[3010:3050].all()


def test_a_joint_that_creeps_through_zero_within_its_friction_rests():
    """As in a simulator that smooths friction: nothing pushes it through."""
    speed, creeping = swings(np.linspace(-0.004, 0.004, 100))
    assert rests(speed)[creeping].mean() > 0.9


def test_a_slow_reversal_is_no_rest_because_stamps_of_fast_motions_jitter():
    """Noise of positions is that of their speed: where this is small, so is the noise."""
    speed, still = swings(np.zeros(200))
    slow = 0.1 * np.sin(2.0 * np.pi * 0.25 * STEP * np.arange(800))
    found = rests(np.concatenate([speed, slow, speed]), jitter=0.002)
    assert found[still].mean() > 0.9
    assert found[1850:2550].mean() < 0.1


def test_what_creeps_rests_in_a_noisy_recording_however_quiet_it_is_itself():
    """At half a hundredth of the usual speed, over more than friction gives way."""
    speed, slow = swings(np.full(2000, 0.003))
    assert rests(speed, jitter=0.002)[slow].mean() > 0.9
    assert not rests(speed)[slow].any()


def test_a_joint_that_slows_down_moves_until_it_stands():
    """Jitter of stamps makes a noise of fast motions, which is none of the stop."""
    slowing = np.linspace(1.0, 0.0, 200)
    speed = np.concatenate([np.ones(400), slowing, np.zeros(300), slowing[::-1], np.ones(400)])
    noisy = rests(speed, 2e-7)
    assert noisy[610:890].all()
    assert not noisy[:590].any()
    assert not noisy[910:].any()


def test_a_joint_without_any_speed_rests():
    still = SimpleNamespace(
        velocity=np.zeros((50, 1)), position=np.ones((50, 1)), acceleration=np.full((50, 1), 1e-9)
    )
    raw = SimpleNamespace(step=STEP, noise_density=np.full(1, 1e-20), position=still.position)
    assert resting(raw, still, BANDWIDTH).all()
