"""Ripple between samples, against a loop that is solved exactly."""

import numpy as np
import pytest
from scipy.linalg import expm

from sgp_ros.batch.zero_phase import ZeroPhase
from sgp_ros.physics.drive import Drive
from sgp_ros.physics.ripple import Ripple
from sgp_ros.physics.servo import Servo

_M, _FREQUENCY_HZ, _RATIO, _FINE = 0.3, 8.0, 0.8, 20
KP = _M * (2.0 * np.pi * _FREQUENCY_HZ) ** 2
KD = 2.0 * _RATIO * np.sqrt(KP * _M)


def _followed(rate_hz, delay_steps):
    """Return times, targets (n,) and sampled positions (n,) of a mass behind held targets."""
    t = np.arange(int(16 * rate_hz)) / rate_hz
    targets = sum(np.sin(2.0 * np.pi * f * t + f) for f in (0.2, 0.5, 0.8, 1.1))
    targets = targets * np.clip(t / 2.0, 0.0, 1.0)
    A = np.array([[0.0, 1.0, 0.0], [-KP / _M, -KD / _M, KP / _M], [0.0, 0.0, 0.0]])
    step = expm(A / (rate_hz * _FINE))
    x, shown = np.zeros(2), np.empty(len(t))
    for i in range(len(t) * _FINE):
        if i % _FINE == 0:
            shown[i // _FINE] = x[0]
        held = targets[max(i - delay_steps, 0) // _FINE]
        x = step[:2] @ np.array([*x, held])
    return t, targets, shown


@pytest.mark.parametrize('delay_steps', [0, 5, 12, 27])
def test_a_drive_is_right_once_the_ripple_is_known(delay_steps):
    """At 50 Hz the equation of motion holds at least three times as well, behind any delay."""
    t, targets, shown = _followed(50.0, delay_steps)
    delay = delay_steps / (50.0 * _FINE)
    q, v, a = (x[:, None] for x in ZeroPhase(50.0, 15.0).states(shown))
    commands = Drive(t, np.column_stack([targets, 0.0 * t]), ((0.0, len(t)),), 0.02)
    gains, mass = (np.array([KP]), np.array([KD])), np.full((len(t), 1, 1), _M)
    ripple = Ripple.of(t, targets[:, None], t, 0.02, gains, mass)
    left = [
        (_M * a - Servo(commands, 0.02, (0,), *gains, q, v, 0.0 * q, ripple=r).effort(
            0, delay=delay)[:, None])[100:-100].std()
        for r in (None, ripple)
    ]  # fmt: skip
    assert left[1] < left[0] / 3.0


def test_stretches_of_a_recording_keep_their_ripple():
    """Long recordings are looked at in stretches, each with rows before it that are not used."""
    t, delay = np.arange(400) / 50.0, 0.05
    targets = np.sin(3.0 * t)[:, None]
    gains, mass = (np.array([KP]), np.array([KD])), np.full((400, 1, 1), _M)
    ripple = Ripple.of(t, targets, t, 0.02, gains, mass)
    assert ripple is not None
    commands = Drive(t, np.column_stack([targets, 0.0 * t]), ((0.0, 400),), 0.02)
    servo = Servo(commands, 0.02, (0,), *gains, 0.9 * targets, 0.0 * targets, 0.0 * targets,
                  ripple=ripple)  # fmt: skip
    stretches = slice(60, 140), slice(250, 350)
    part, whole = servo.on(stretches).effort(0, delay=delay), servo.effort(0, delay=delay)
    for s, at in zip(stretches, (0, 80), strict=True):
        np.testing.assert_allclose(part[at + 10 : at + s.stop - s.start - 10],
                                   whole[s.start + 10 : s.stop - 10], atol=1e-9 * KP)  # fmt: skip


def test_fast_samples_show_no_ripple():
    """Nor do samples at another rate than that of the targets, which see all phases."""
    t = np.arange(1000) / 500.0
    gains = np.array([KP]), np.array([KD])
    one = np.full((1000, 1, 1), _M)
    assert Ripple.of(t, np.sin(t)[:, None], t, 0.002, gains, one) is None
    slow = 10.0 * t
    assert Ripple.of(slow, np.sin(slow)[:, None], slow, 0.02, gains, one) is not None
    assert Ripple.of(slow[::2], np.sin(slow[::2])[:, None], slow, 0.02, gains, one) is None
