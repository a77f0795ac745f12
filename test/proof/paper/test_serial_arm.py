"""Newton-Euler, friction and the tracking of curves."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_proof.paper.figure_eight import (
    ARM,
    GAIN,
    FigureEight,
    follow,
    joint_positions,
)
from sgp_proof.paper.serial_arm import GRAVITY, ArmLink, JointFriction, SerialArm

ROD = ArmLink((0, 1, 0), (0, 0, 0), 2.0, (0.3, 0, 0), (0.01, 0, 0.06, 0, 0, 0.06))
CURVE = FigureEight((0.49, 0, 0.26), (0, 0.3, 0), (0.15, 0, 0), period=3.0)


def _states(n):
    return np.random.default_rng(n).normal(size=(3, n, 3))


def _energy(arm, q, v):
    """Kinetic energy from the mass matrix, potential from the work of gravity torques."""
    unit = np.eye(3)
    M = np.stack([arm.rigid_torque(q, 0.0 * v, e, 0.0) for e in unit], axis=-1)
    return 0.5 * v @ M @ v


def test_a_rod_weighs_what_its_formula_says():
    """Torque `I a - m g c cos(q)`: pitching down is positive."""
    arm = SerialArm((ROD,), (JointFriction(0.0, 0.0),), 0.02)
    q, v, a = np.array([0.4]), np.array([1.3]), np.array([-2.0])
    expected = (0.06 + 2.0 * 0.3**2) * a - 2.0 * GRAVITY * 0.3 * np.cos(q)
    assert arm.inverse_dynamics(q, v, a) == pytest.approx(expected, abs=1e-12)


def test_forward_dynamics_undo_inverse_dynamics():
    """Accelerations come back, to the condition of the mass matrix."""
    q, v, a = _states(40)
    torque = ARM.inverse_dynamics(q, v, a)
    assert np.allclose(ARM.acceleration(q, v, torque), a, rtol=0.0, atol=1e-10)


def test_mass_matrix_is_symmetric_and_positive():
    """It is a kinetic energy."""
    q, v, _ = _states(20)
    M = np.stack([ARM.rigid_torque(q, 0.0 * v, e, 0.0) for e in np.eye(3)], axis=-1)
    assert np.allclose(M, np.swapaxes(M, -1, -2), atol=1e-13)
    assert np.all(np.linalg.eigvalsh(M) > 0.0)


def test_power_of_torques_is_the_change_of_energy():
    """Without gravity and friction: Coriolis torques do no work beyond the kinetic energy."""
    q, v, a = (x[0] for x in _states(1))
    h = 1e-5
    later = _energy(ARM, q + h * v, v + h * a)
    before = _energy(ARM, q - h * v, v - h * a)
    power = ARM.rigid_torque(q, v, a, 0.0) @ v
    assert (later - before) / (2.0 * h) == pytest.approx(power, rel=1e-7)


def test_many_states_give_what_single_ones_give():
    """Leading dimensions are independent states."""
    q, v, a = _states(6)
    together = ARM.inverse_dynamics(q.reshape(2, 3, 3), v.reshape(2, 3, 3), a.reshape(2, 3, 3))
    alone = [ARM.inverse_dynamics(*state) for state in zip(q, v, a, strict=True)]
    assert np.allclose(together.reshape(6, 3), alone, atol=1e-13)


def test_dry_friction_grows_linearly_towards_both_limits():
    """Zero up to the onset, `growth` at the limits."""
    friction = JointFriction(0.0, 1.0, growth=2.0, lower=-1.0, upper=3.0, onset=0.5)
    positions = np.array([-1.0, -0.75, -0.5, 1.0, 2.5, 2.75, 3.0])
    assert friction.near_limits(positions) == pytest.approx([2.0, 1.0, 0.0, 0.0, 0.0, 1.0, 2.0])


def test_friction_takes_energy():
    """Its torque has the sign of the velocity."""
    q, v, _ = _states(50)
    assert np.all(ARM.friction(q, v) * v > 0.0)


def test_the_tip_is_where_the_curve_is():
    """Inverse kinematics against the forward ones written out."""
    points = CURVE.at(np.linspace(0.0, 3.0, 50))
    yaw, pitch, elbow = joint_positions(points).T
    reach = 0.4 * np.cos(pitch) + 0.35 * np.cos(pitch + elbow)
    height = 0.3 - 0.4 * np.sin(pitch) - 0.35 * np.sin(pitch + elbow)
    found = np.column_stack([reach * np.cos(yaw), reach * np.sin(yaw), height])
    assert np.allclose(found, points, atol=1e-12)
    assert np.all(elbow > 0.0)


def test_a_curve_out_of_reach_is_refused():
    """The arm is 0.75 m long."""
    with pytest.raises(ValueError, match='reach'):
        joint_positions(np.array([[1.0, 0.0, 0.3]]))


def test_samples_obey_the_equation_of_motion():
    """The torque of each sample is the inverse dynamics of its motion."""
    (run,) = follow((CURVE,), 30, np.full(3, 0.5), np.random.default_rng(0))
    torque = ARM.inverse_dynamics(run.position, run.velocity, run.acceleration)
    assert np.allclose(torque, run.torque, atol=1e-10)


def test_control_is_proportional():
    """Without disturbance, torque over gain leads from the position to the curve."""
    (run,) = follow((CURVE,), 20, np.zeros(3), np.random.default_rng(0))
    times = 0.01 * (50 + np.arange(20))
    assert np.allclose(run.position + run.torque / GAIN, joint_positions(CURVE.at(times)))


def test_runs_do_not_disturb_each_other():
    """A curve is followed alike, alone or beside another one, where nothing is random."""
    other = FigureEight((0.38, 0, 0.46), (0, 0.3, 0), (0, 0, 0.2), period=2.8)
    alone = follow((CURVE,), 5, np.zeros(3), np.random.default_rng(0))[0]
    beside = follow((CURVE, other), 5, np.zeros(3), np.random.default_rng(0))[0]
    assert np.allclose(alone.position, beside.position, atol=1e-12)
