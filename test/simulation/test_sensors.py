"""Laws of the sensors."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.recording import simulate
from sgp_ros.simulation.sensors import Sensors, encoder_resolution


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=4), st.integers(4, 20))
def test_quantisation_is_off_by_at_most_half_a_count(position, bits):
    """Rounding to the nearest count; the slack is the rounding of the division."""
    step = encoder_resolution(bits)
    true = np.array(position)
    seen, velocity = Sensors(resolution=(step,)).read(true, true, np.random.default_rng(0))
    assert velocity is None
    assert np.abs(seen - true).max() <= 0.5 * step * (1.0 + 1e-9)
    np.testing.assert_allclose(seen / step, np.round(seen / step), atol=1e-6)


def test_encoder_of_twelve_bits_has_4096_counts():
    """A full turn is 2^bits steps."""
    assert encoder_resolution(12) * 4096 == pytest.approx(2.0 * math.pi)


def test_perfect_sensors_show_the_truth():
    """No resolution and no noise change nothing, bit for bit."""
    simulation = make_simulation('reaction_wheel', sensors=Sensors(measures_velocity=True))
    recording = simulate(simulation, 0.5)
    np.testing.assert_array_equal(recording.position, recording.true_position)
    np.testing.assert_array_equal(recording.velocity, recording.true_velocity)


def test_noise_has_the_stated_deviation_on_each_joint():
    """Standard deviations over 2000 samples are within 4 sigma of themselves."""
    sensors = Sensors(
        position_noise=(1e-3, 1e-2), measures_velocity=True, velocity_noise=(0.1, 0.2)
    )
    recording = simulate(make_simulation('reaction_wheel', sensors=sensors, rate_hz=1000.0), 2.0)
    tolerance = 4.0 / math.sqrt(2.0 * 2000)
    position = (recording.position - recording.true_position).std(axis=0)
    velocity = (recording.velocity - recording.true_velocity).std(axis=0)
    np.testing.assert_allclose(position, [1e-3, 1e-2], rtol=tolerance)
    np.testing.assert_allclose(velocity, [0.1, 0.2], rtol=tolerance)


def test_sensor_noise_leaves_the_motion_alone():
    """Each source of chance has its own generator, so open-loop motion is the same bit for bit."""
    clean = simulate(make_simulation('reaction_wheel', seed=4, sensors=Sensors()), 0.5)
    noisy = simulate(
        make_simulation('reaction_wheel', seed=4, sensors=Sensors(position_noise=(0.1,))), 0.5
    )
    np.testing.assert_array_equal(clean.true_position, noisy.true_position)
