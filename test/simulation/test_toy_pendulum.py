"""Laws of the simulated toy pendulum."""

from __future__ import annotations

import math

import numpy as np

from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.recording import simulate
from sgp_ros.simulation.sensors import Sensors


def test_acceleration_is_w_sine_except_in_the_interval():
    """Friction of 6 N m on 1 kg m^2 acts against the motion in [2, 2.5] rad of every turn."""
    recording = simulate(make_simulation('toy_pendulum', seed=1), 20.0)
    w = recording.truth['coefficients']['w']['value']
    q, v = recording.true_position[:, 0], recording.true_velocity[:, 0]
    wrapped = (q + math.pi) % (2.0 * math.pi) - math.pi
    inside = (wrapped >= 2.0) & (wrapped <= 2.5)
    expected = w * np.sin(q) - 6.0 * np.sign(v) * inside
    assert inside.sum() > 50
    np.testing.assert_allclose(recording.true_acceleration[:, 0], expected, atol=1e-9)


def test_without_friction_energy_is_conserved():
    """v^2 / 2 + w cos(theta) is constant."""
    simulation = make_simulation(
        'toy_pendulum', physical={'friction_amplitude': 0.0}, torque_noise=(0.0,),
        sensors=Sensors(),
    )  # fmt: skip
    recording = simulate(simulation, 10.0)
    stored = 0.5 * recording.true_velocity**2 + 9.81 * np.cos(recording.true_position)
    assert np.ptp(stored) < 1e-8 * np.abs(stored).max()


def test_there_is_no_command():
    """The toy robot has no motor: recordings carry commands of length 0."""
    recording = simulate(make_simulation('toy_pendulum'), 0.1)
    assert recording.command_joints == ()
    assert recording.command.shape == (10, 0)
