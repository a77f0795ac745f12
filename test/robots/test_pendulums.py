"""The pendulums beside equations derived in another way."""

from __future__ import annotations

import numpy as np

from sgp_ros.physics.term import Motion
from sgp_ros.rigid.inertial import inertial_term, revolute_chain
from sgp_ros.robots.registry import load_robot

GRAVITY = 9.81
M1, R1, I1, M2, R2, I2, L1, GEAR, ROTOR = 0.6, 0.25, 0.05, 0.5, 0.3, 0.06, 0.2, 6.0, 1e-4


def _motion(k, seed, n=20):
    q, v, a = np.random.default_rng(seed).normal(size=(3, n, k))
    return Motion(q, v, a, np.zeros_like(q))


def _double_coefficients(rotor):
    """Six rigid-body coefficients, then no friction and no offsets."""
    rigid = [
        I1 + I2 + M2 * L1**2 + (GEAR**2 + 1.0) * rotor, I2 - GEAR * rotor, I2 + GEAR**2 * rotor,
        M2 * L1 * R2, (M1 * R1 + M2 * L1) * GRAVITY, M2 * R2 * GRAVITY,
    ]  # fmt: skip
    return np.array(rigid + [0.0] * 6)


def _pinocchio_torques(motion):
    """The same links as a chain that turns about y and hangs along -z, by Pinocchio."""
    model = revolute_chain(('shoulder', 'elbow'), [[0.0, 1.0, 0.0]] * 2, [[0, 0, 0], [0, 0, -L1]])
    w = np.zeros((2, 10))
    w[:, 0], w[:, 3], w[:, 6] = (M1, M2), (-M1 * R1, -M2 * R2), (I1, I2)
    return inertial_term(model).columns(motion) @ w.ravel()


def test_double_pendulum_without_rotors_is_a_rigid_chain():
    """Column by column it agrees with Pinocchio's regressor."""
    motion = _motion(2, 0)
    torque = load_robot('double_pendulum').regressor(motion) @ _double_coefficients(0.0)
    np.testing.assert_allclose(torque, _pinocchio_torques(motion), atol=1e-12)


def test_rotors_of_the_double_pendulum_add_their_spin():
    """A rotor turns with its carrier and, against it, by the gear ratio with its own joint."""
    robot, motion = load_robot('double_pendulum'), _motion(2, 1)
    added = robot.regressor(motion) @ (_double_coefficients(ROTOR) - _double_coefficients(0.0))
    a1, a2 = motion.acceleration.T
    first = np.stack([GEAR**2 * a1, 0.0 * a2], axis=1)  # its carrier stands still
    spin = a1 - GEAR * a2
    second = np.stack([spin, -GEAR * spin], axis=1)
    np.testing.assert_allclose(added, ROTOR * (first + second), atol=1e-15)


def test_friction_and_offsets_of_the_double_pendulum_stay_in_their_joint():
    """Viscous, Coulomb and constant torques act where they are named."""
    robot, motion = load_robot('double_pendulum'), _motion(2, 2)
    w = np.array([0.0] * 6 + [0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    v = motion.velocity
    expected = [0.1, 0.2] * v + [0.3, 0.4] * np.sign(v) + [0.5, 0.6]
    np.testing.assert_allclose(robot.regressor(motion) @ w, expected, atol=1e-14)


def test_simple_pendulum_satisfies_its_equation():
    """Inertia, gravity that pulls back, friction against the motion, offset."""
    motion = _motion(1, 3)
    q, v, a = motion.position, motion.velocity, motion.acceleration
    torque = load_robot('simple_pendulum').regressor(motion) @ [0.2, 3.0, 0.05, 0.1, -0.02]
    expected = 0.2 * a + 3.0 * np.sin(q) + 0.05 * v + 0.1 * np.sign(v) - 0.02
    np.testing.assert_allclose(torque, expected, atol=1e-14)
