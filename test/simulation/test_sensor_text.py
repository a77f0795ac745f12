"""Laws of sensors that are written as text."""

from __future__ import annotations

import math

import pytest

from sgp_ros.errors import ConfigError
from sgp_ros.simulation.mechanism import SimulatedJoint
from sgp_ros.simulation.sensor_text import parse_sensors
from sgp_ros.simulation.sensors import Sensors
from sgp_ros.simulation.transport import Transport

JOINTS = (SimulatedJoint('lift', is_prismatic=True), SimulatedJoint('elbow'))


def test_nothing_said_leaves_the_usual_sensors():
    """Only a resolution for all joints is written out joint by joint."""
    sensors, transport = parse_sensors([], Sensors((1e-3,), jitter_s=2e-3), JOINTS)
    assert sensors == Sensors((1e-3, 1e-3), jitter_s=2e-3)
    assert transport == Transport()


def test_bits_are_of_revolute_joints_and_resolution_of_prismatic_ones():
    """An encoder of 12 bits beside a scale of a micrometre."""
    sensors, _ = parse_sensors(['bits=12', 'resolution=1e-6'], Sensors((0.5,)), JOINTS)
    assert sensors.resolution == (1e-6, 2.0 * math.pi / 4096)


def test_every_setting_reaches_its_place():
    """Times in seconds, switches by yes and no."""
    texts = [
        'noise=1e-4', 'velocity=no', 'effort=yes', 'velocity_noise=0.01', 'jitter=1e-3',
        'latency=2e-4', 'stamp_noise=4e-5', 'log_latency=1e-3', 'drop=0.005', 'permuted=yes',
        'named_commands=yes',
    ]  # fmt: skip
    sensors, transport = parse_sensors(texts, Sensors(measures_velocity=True), JOINTS)
    assert sensors == Sensors(
        (0.0, 0.0), (1e-4,), measures_velocity=False, velocity_noise=(0.01,), jitter_s=1e-3,
        measures_effort=True, command_latency_s=2e-4,
    )  # fmt: skip
    assert transport == Transport(4e-5, 1e-3, 0.005, is_permuted=True, has_named_commands=True)


@pytest.mark.parametrize(
    'text', ['', 'colour=red', 'bits=12.5', 'bits=0', 'drop=2', 'velocity=perhaps', 'noise=much']
)
def test_wrong_texts_are_refused_in_one_line(text):
    """It says what can be set."""
    with pytest.raises(ConfigError) as caught:
        parse_sensors([text], Sensors(), JOINTS)
    assert '\n' not in str(caught.value)
    assert caught.value.expected
