"""Laws of simulated roll-outs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sgp_ros.batch.forward import forward
from sgp_ros.batch.rollout import advance, roll_out
from sgp_ros.physics.term import Motion
from sgp_ros.robots.registry import load_robot

EPS = np.finfo(float).eps
DOUBLE, SIMPLE, AXIS = (
    load_robot(name) for name in ('double_pendulum', 'simple_pendulum', 'linear_axis')
)
W_DOUBLE = np.array([0.14, 0.05, 0.06, 0.03, 2.4, 1.4, 0.02, 0.01, 0.15, 0.1, 0.01, -0.02])
SMOOTH = np.where(np.arange(12) // 2 == 4, 0.0, W_DOUBLE)  # no Coulomb friction
W_SIMPLE = np.array([0.15, 3.0, 0.05, 0.2, 0.0])


def _states(k, m=30, seed=0):
    return np.random.default_rng(seed).normal(size=(3, m, k))


def test_forward_inverts_the_inverse_model():
    """Its acceleration put back into the regressor gives the effort."""
    q, v, effort = _states(2)
    a = forward(DOUBLE, W_DOUBLE, q, v, effort)
    again = DOUBLE.regressor(Motion(q, v, a, np.zeros_like(q))) @ W_DOUBLE
    np.testing.assert_allclose(again, effort, atol=1e3 * EPS)


def test_forward_of_a_forward_model_is_its_regressor():
    """With target acceleration nothing has to be solved."""
    robot = load_robot('reaction_wheel')
    q, v, effort = _states(2)
    W = np.random.default_rng(1).normal(size=10)
    expected = robot.regressor(Motion(q, v, np.zeros_like(q), effort)) @ W
    np.testing.assert_allclose(forward(robot, W, q, v, effort), expected, atol=1e2 * EPS)


def test_residual_is_felt_on_the_side_of_the_target():
    """Z is torque against the motion of an inverse model, acceleration of a forward model."""
    q, v, effort = _states(2)

    def z(q, v):
        return 0.3 * np.sin(q) - 0.1 * v

    np.testing.assert_allclose(
        forward(DOUBLE, W_DOUBLE, q, v, effort, z),
        forward(DOUBLE, W_DOUBLE, q, v, effort - z(q, v)),
    )
    robot, W = load_robot('reaction_wheel'), np.ones(10)
    np.testing.assert_allclose(
        forward(robot, W, q, v, effort, z), forward(robot, W, q, v, effort) + z(q, v)
    )


def test_a_mass_matrix_without_inverse_gives_no_number():
    """No made-up acceleration, and no effect on the other states."""
    q, v, effort = _states(1, m=2)
    a = forward(SIMPLE, np.array([0.0, 3.0, 0.0, 0.0, 0.0]), q, v, effort)
    assert np.isnan(a).all()


def test_roll_outs_agree_with_an_independent_integrator():
    """Without dry friction: SciPy's DOP853 at 1e-10, piece by piece of constant effort."""
    q, v, _ = _states(2, m=3)
    effort = np.random.default_rng(3).normal(size=(3, 20, 2))
    found_q, found_v = roll_out(DOUBLE, SMOOTH, q, v, effort, 0.01, substeps=4)

    for i in range(3):
        state = np.concatenate([q[i], v[i]])
        for n in range(20):

            def slope(_, y, u=effort[i, n]):
                return [*y[2:], *forward(DOUBLE, SMOOTH, y[None, :2], y[None, 2:], u[None])[0]]

            state = solve_ivp(slope, (0, 0.01), state, 'DOP853', rtol=1e-10, atol=1e-10).y[:, -1]
        np.testing.assert_allclose(np.hstack([found_q[i, -1], found_v[i, -1]]), state, atol=1e-6)


def test_each_roll_out_is_independent_of_its_neighbours():
    """Lock-step is a matter of speed alone."""
    q, v, _ = _states(2, m=6)
    effort = 0.5 * np.random.default_rng(4).normal(size=(6, 30, 2))
    together = roll_out(DOUBLE, W_DOUBLE, q, v, effort, 0.005)
    for i in range(6):
        one = slice(i, i + 1)
        alone = roll_out(DOUBLE, W_DOUBLE, q[one], v[one], effort[one], 0.005)
        np.testing.assert_allclose(np.array(alone)[:, 0], np.array(together)[:, i], atol=1e-9)


def test_conserved_energy_drifts_with_the_fourth_order_of_the_step():
    """Halving the step divides the drift by 16 or more."""
    W = np.where(np.arange(12) < 6, W_DOUBLE, 0.0)
    start, rest = np.array([[2.0, -1.0]]), np.zeros((1, 2))

    def drift(steps):
        q, v = roll_out(DOUBLE, W, start, rest, np.zeros((1, steps, 2)), 1.0 / steps)
        c2 = np.cos(q[0, :, 1])
        J1, J12, J2, H, G1, G2 = W[:6]
        v1, v2 = v[0].T
        kinetic = (J1 + 2 * H * c2) * v1**2 / 2 + (J12 + H * c2) * v1 * v2 + J2 * v2**2 / 2
        energy = kinetic - G1 * np.cos(q[0, :, 0]) - G2 * np.cos(q[0].sum(axis=1))
        return abs(energy[-1] - energy[0])

    assert drift(200) < drift(100) / 14.0


def test_a_sliding_body_stops_when_and_where_friction_has_eaten_its_energy():
    """Constant deceleration: q = v^2 M / (2 Fc), whatever the step, and then it stays."""
    M, Fc, speed = 2.0, 3.0, 0.7
    for dt in (0.1, 0.03):
        q, v = roll_out(
            AXIS, np.array([M, 0.0, Fc, 0.0]), np.zeros((1, 1)), np.full((1, 1), speed),
            np.zeros((1, 40, 1)), dt,
        )  # fmt: skip
        np.testing.assert_allclose(q[0, -1, 0], speed**2 * M / (2.0 * Fc), rtol=1e-12)
        assert v[0, -1, 0] == 0.0
        assert np.ptp(q[0, -5:, 0]) == 0.0


@dataclass
class _Sliding:
    """Two bodies on a plane with dry friction, which count how often they are asked."""

    asked: int = 0

    def level_of_dry_friction(self, q, effort):
        return np.ones_like(q)

    def equations(self, q, v, effort):
        self.asked += 1
        return np.tile(np.eye(2), (len(q), 1, 1)), effort - np.sign(v)


@pytest.mark.parametrize(('h', 'is_short'), [(1e-3, True), (2e-3, False)])
def test_in_a_short_step_joints_stop_at_its_end(h, is_short):
    """No step is cut for each of many joints; they lie still behind it either way."""
    bodies = _Sliding()
    speed = h * np.array([[0.3, 0.6]])
    q, v = advance(bodies, np.zeros((1, 2)), speed, np.zeros((1, 2)), h)
    assert (v == 0.0).all()
    assert np.abs(q - 0.5 * speed**2).max() < h**2
    assert (bodies.asked == 4) == is_short


def test_a_body_at_rest_stays_until_the_effort_exceeds_the_friction():
    """Stiction holds for ever below the level, and lets go above it."""
    W, start = np.array([2.0, 0.0, 3.0, 0.0]), np.zeros((3, 1))
    effort = np.array([2.99, 3.01, -3.01])[:, None, None] * np.ones((3, 50, 1))
    q, _ = roll_out(AXIS, W, start, start, effort, 0.01)
    assert np.all(q[0] == 0.0)
    np.testing.assert_allclose(q[1:, -1, 0], [0.01 / 16.0, -0.01 / 16.0], rtol=1e-9)


def test_a_pendulum_with_dry_friction_comes_to_rest_on_a_slope():
    """It ends where friction carries its weight, off the lowest point, and creeps nowhere."""
    q, v = roll_out(
        SIMPLE, W_SIMPLE, np.array([[1.0]]), np.zeros((1, 1)), np.zeros((1, 800, 1)), 0.01
    )
    assert np.all(v[0, -100:] == 0.0)
    assert np.ptp(q[0, -100:]) == 0.0
    assert abs(W_SIMPLE[1] * np.sin(q[0, -1, 0])) <= W_SIMPLE[3]


def test_one_joint_sticks_while_the_other_moves():
    """A strong brake in the elbow makes one link of two."""
    W = SMOOTH.copy()
    W[9] = 50.0
    q, _ = roll_out(
        DOUBLE, W, np.array([[1.0, 0.5]]), np.zeros((1, 2)), np.zeros((1, 100, 2)), 0.01
    )
    assert np.all(q[0, :, 1] == 0.5)
    J1, H, G1, G2, Fv = W[0], W[3], W[4], W[5], W[6]
    inertia = J1 + 2.0 * H * np.cos(0.5)

    def slope(_, y):
        torque = -G1 * np.sin(y[0]) - G2 * np.sin(y[0] + 0.5) - Fv * y[1] - W[10]
        return [y[1], torque / inertia]

    expected = solve_ivp(slope, (0.0, 1.0), [1.0, 0.0], rtol=1e-10, atol=1e-10).y[0, -1]
    np.testing.assert_allclose(q[0, -1, 0], expected, atol=1e-6)


def test_reversing_under_friction_loses_no_velocity_to_the_step():
    """Error at the reversal falls with the square of the step."""
    W = np.array([1.0, 0.0, 1.0, 0.0])

    def end(dt):
        n = round(0.99 / dt)
        q, _ = roll_out(AXIS, W, np.zeros((1, 1)), np.ones((1, 1)), np.full((1, n, 1), -2.0), dt)
        return q[0, -1, 0]

    stop, rest = 1.0 / 6.0, 0.99 - 1.0 / 3.0  # a = -3 until v = 0 at 1/3 s, then -1
    for dt in (0.011, 0.09):
        np.testing.assert_allclose(end(dt), stop - rest**2 / 2.0, rtol=1e-12)


@pytest.mark.long
def test_stiction_agrees_with_ever_steeper_smooth_friction():
    """Forces of `sign(v)` are the limit of those of `tanh(v / width)`."""

    def smooth(width):
        return replace(
            SIMPLE,
            terms=tuple(
                replace(
                    term,
                    columns=lambda motion: np.tanh(motion.velocity / width)[:, :, None],
                )
                if term.coefficients[0].name == 'Fc'
                else term
                for term in SIMPLE.terms
            ),
        )

    start, effort = np.array([[1.2]]), 0.5 * np.sin(np.arange(200) / 20.0)[None, :, None]
    hard, _ = roll_out(SIMPLE, W_SIMPLE, start, np.zeros((1, 1)), effort, 0.01)
    error = []
    for width in (0.1, 0.01):
        soft, _ = roll_out(
            smooth(width), W_SIMPLE, start, np.zeros((1, 1)), effort, 0.01, substeps=20
        )
        error.append(np.abs(soft - hard).max())
    assert error[1] < 0.2 * error[0]
    assert error[1] < 2e-3


def test_a_diverged_roll_out_ends_in_no_number_and_spares_the_others():
    """Friction that pushes blows up; a neighbour with no velocity does not."""
    W = np.array([1e-3, -50.0, 0.0, 0.0])
    q, v = roll_out(AXIS, W, np.zeros((2, 1)), np.array([[1.0], [0.0]]), np.zeros((2, 80, 1)), 0.1)
    assert not np.isfinite(v[0, -1])
    assert np.all(q[1] == 0.0)


def test_wrong_shapes_and_steps_are_refused():
    """A caller's mistake."""
    state, effort = np.zeros((2, 1)), np.zeros((2, 5, 1))
    with pytest.raises(ValueError, match='effort'):
        roll_out(AXIS, np.zeros(4), state[:1], state, effort, 0.1)
    with pytest.raises(ValueError, match='dt'):
        roll_out(AXIS, np.zeros(4), state, state, effort, 0.0)
