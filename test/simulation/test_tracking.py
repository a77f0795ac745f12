"""Laws of reference motions."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.simulation.controllers import random_multisine
from test.simulation.trees import arm


@pytest.mark.parametrize('seed', range(3))
def test_velocity_and_acceleration_are_the_derivatives(seed):
    """Central differences of the position and of the velocity."""
    reference = random_multisine(np.random.default_rng(seed), np.zeros(3), np.ones(3))
    h = 1e-5
    for t in (0.0, 0.7, 12.3):
        (q0, v0, _), (_, v, a), (q1, v1, _) = (reference.at(x) for x in (t - h, t, t + h))
        np.testing.assert_allclose((q1 - q0) / (2 * h), v, atol=1e-6)
        np.testing.assert_allclose((v1 - v0) / (2 * h), a, atol=1e-5)


def test_reference_stays_within_its_span():
    """The amplitudes of each joint add up to its span."""
    centre, span = np.array([0.5, -1.0]), np.array([0.3, 1.2])
    reference = random_multisine(np.random.default_rng(1), centre, span)
    positions = np.array([reference.at(t)[0] for t in np.arange(0.0, 60.0, 0.05)])
    assert np.all(np.abs(positions - centre) <= span + 1e-12)
    assert np.all(np.ptp(positions, axis=0) > 0.7 * span)


def test_tracked_arm_follows_its_reference():
    """The computed force of the robot itself leaves an error of the sampling alone."""
    pytest.importorskip('mujoco')
    from sgp_ros.simulation.assembly import make_simulation
    from sgp_ros.simulation.controllers import ControllerChoice, computed_force
    from sgp_ros.simulation.recording import simulate
    from sgp_ros.simulation.simulator import Simulator
    from sgp_ros.simulation.tree_simulator import tree_simulator

    usual = tree_simulator(arm())
    reference = random_multisine(np.random.default_rng(2), np.zeros(2), np.array([0.8, 0.8]))
    q, v, _ = reference.at(0.0)
    control = computed_force(usual.mechanism, usual.joints, (0, 1), reference)
    choice = ControllerChoice(lambda *_: control, tuple(q), tuple(v))
    simulator = Simulator(
        usual.name, usual.joints, usual.command_joints, usual.command_unit, usual.mechanism,
        {'tracking': choice}, usual.sensors, usual.torque_noise,
    )  # fmt: skip
    recording = simulate(make_simulation(simulator, rate_hz=200.0), 3.0)
    wanted = np.array([reference.at(i / 200.0)[0] for i in range(len(recording.stamps_ns))])
    assert np.abs(recording.true_position - wanted).max() < 0.01
