"""Recordings that nothing can be identified from are refused before anything is computed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.batch.excitation import require_motion
from sgp_ros.errors import RecordingError
from sgp_ros.physics.term import Joint
from sgp_ros.robots.registry import load_robot
from test.batch.worlds import moved_axis

LINEAR_AXIS = load_robot('linear_axis')

SIGNALS = moved_axis(0, duration=5.0)
NOISE = np.random.default_rng(0).normal(size=SIGNALS.position.shape)


@pytest.mark.parametrize('noise', [0.0, 1e-6, 1.0])
def test_a_robot_that_stands_still_is_refused_whatever_its_encoder_noise(noise):
    still = replace(SIGNALS, position=0.3 + noise * NOISE)
    with pytest.raises(RecordingError, match='none of the joints'):
        require_motion(still, LINEAR_AXIS)


@pytest.mark.parametrize('encoder', [0.0, 1e-4, 1e-2])
def test_a_moving_robot_is_accepted_whatever_its_encoder_noise(encoder):
    """The largest is a tenth of the motion."""
    require_motion(moved_axis(0, duration=5.0, encoder=encoder), LINEAR_AXIS)


def test_an_effort_that_never_changes_is_refused_with_its_joint():
    with pytest.raises(RecordingError, match=r"effort of \['axis'\] is constant"):
        require_motion(replace(SIGNALS, effort=np.zeros_like(NOISE)), LINEAR_AXIS)


def test_a_robot_without_any_effort_is_refused():
    """Only ratios of its coefficients could be determined."""
    passive = replace(LINEAR_AXIS, joints=(Joint('axis', is_actuated=False),))
    with pytest.raises(RecordingError, match='is constant'):
        require_motion(SIGNALS, passive)


def test_a_forward_model_may_swing_without_effort():
    forward = replace(LINEAR_AXIS, target='acceleration')
    require_motion(replace(SIGNALS, effort=np.zeros_like(NOISE)), forward)
