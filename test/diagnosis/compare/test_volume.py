"""Volume of a motion that the residual of an effort stands for."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.diagnosis.compare.volume import Loop, log_inertia, noisy_volume

INERTIA, CUTOFF = 0.02, 5.0
OMEGA = 2.0 * np.pi * CUTOFF * (np.arange(16) + 0.5) / 16


def _loop(kp, kd):
    return Loop(np.array([INERTIA]), np.array([kp]), np.array([kd]), OMEGA)


def test_under_given_efforts_the_volume_is_the_inertia():
    assert _loop(0.0, 0.0).volume(np.array([0.7])) == pytest.approx(0.7)


def test_a_stiff_drive_leaves_no_prize_on_inertia():
    """Its natural frequency is five times the band."""
    loop = _loop(INERTIA * (10.0 * np.pi * CUTOFF) ** 2, 0.0)
    assert abs(loop.volume(np.log([2.0]))) < 0.05


@pytest.mark.parametrize('kp', [0.05, 2.0, 40.0])
def test_no_inertia_is_preferred_where_the_encoder_alone_is_wrong(kp):
    """Errors of position that are alike at all frequencies, and any inertia in the model.

    The log density of the motion is that of the efforts and the volume together: the same.
    """
    loop, kd = _loop(kp, 0.1), 0.1
    x = np.exp(1j * np.random.default_rng(1).uniform(0.0, 6.0, len(OMEGA)))

    def log_effort(inertia):
        return np.log(np.abs((kp - inertia * OMEGA**2 + 1j * kd * OMEGA) * x)).mean()

    for ratio in (0.5, 3.0):
        gained = log_effort(INERTIA) - log_effort(ratio * INERTIA)
        assert loop.volume(np.log([ratio])) + gained == pytest.approx(0.0, abs=1e-9)


def test_stiffer_gains_are_a_unit_of_the_error():
    assert _loop(400.0, 4.0).volume(np.zeros(1), 2.0, 2.0) == pytest.approx(np.log(2.0), abs=0.02)


def test_bodies_that_cannot_be_have_no_volume():
    M = np.array([[[1.0, 2.0], [2.0, 1.0]]])
    log = log_inertia(M, np.eye(2)[None])
    assert (log == -np.inf).all()
    assert (noisy_volume(_loop(5.0, 1.0).volume(log), np.array([0.5, 0.0])) == -np.inf).all()
    assert (log_inertia(np.eye(2)[None], np.diag([1.0, 0.0])[None]) == np.inf).all()


def test_each_joint_has_its_part_of_the_determinant():
    M = np.array([[[2.0, 0.5], [0.5, 1.0]]])
    log = log_inertia(M, np.eye(2)[None])
    assert log.sum() == pytest.approx(np.log(1.75))
    assert log[0] - log[1] == pytest.approx(np.log(2.0))
