"""Laws of dry friction."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.dry_friction import (
    directions_from_rest,
    friction_at_rest,
    hold_axes,
    hold_still,
)
from sgp_ros.simulation.recording import simulate
from sgp_ros.simulation.sensors import Sensors

PERFECT = {'sensors': Sensors(), 'torque_noise': (0.0, 0.0)}


@given(st.integers(1, 4), st.integers(0, 10_000))
def test_friction_at_rest_holds_or_slides(s, seed):
    """A joint inside its range does not accelerate; one at the end accelerates against it."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(s, s))
    A = root @ root.T + 0.5 * np.eye(s)
    a, up, down = rng.normal(size=s), rng.uniform(0.0, 1.0, s), rng.uniform(0.0, 1.0, s)
    r = friction_at_rest(A, a, up, down)
    after = a + A @ r
    assert np.all((-up <= r) & (r <= down))
    scale = 1e-9 * np.abs(A).max()
    assert np.all(np.abs(after[(-up < r) & (r < down)]) < scale)
    assert np.all(after[r == -up] > -scale)
    assert np.all(after[r == down] < scale)


@pytest.mark.parametrize(('push', 'expected'), [(0.9, 0), (1.1, 1), (-0.9, -1), (-0.4, 0)])
def test_single_joint_starts_beyond_the_level_of_its_side(push, expected):
    """Levels of 1 upwards and 0.5 downwards, unit mass."""
    found = directions_from_rest(np.eye(1), np.array([push]), np.array([1.0]), np.array([0.5]))
    assert found == [expected]


def test_held_joints_do_not_accelerate_and_free_ones_follow_the_reduced_mass():
    """Holding the second joint leaves `force / mass` of the first alone."""
    mass = np.array([[2.0, 0.5], [0.5, 1.0]])
    inverse = np.linalg.inv(mass)
    held = hold_still(inverse, inverse @ np.array([3.0, 7.0]), [1])
    np.testing.assert_allclose(held, [1.5, 0.0], atol=1e-12)
    assert held[1] == 0.0


def test_axes_that_depend_on_each_other_are_held():
    """Two joints and a motor that turns with both; alone it leaves the two to turn together."""
    inverse = np.linalg.inv(np.array([[2.0, 0.5], [0.5, 1.0]]))
    free = inverse @ np.array([3.0, 7.0])
    G = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, -0.5]])
    np.testing.assert_allclose(hold_axes(inverse, free, G), 0.0, atol=1e-12)
    np.testing.assert_allclose(hold_axes(inverse, free, G[:1]), [0.0, 7.0], atol=1e-12)
    both = hold_axes(inverse, free, G[2:])
    assert both[0] == pytest.approx(0.5 * both[1])
    # virtual work of the motion that the motor allows, (0.5, 1)
    assert both[1] == pytest.approx((0.5 * 3.0 + 7.0) / (0.25 * 2.0 + 0.5 + 1.0))


def test_wheel_held_by_its_bearing_turns_with_the_pole():
    """A stuck wheel makes one rigid pendulum: no relative motion, energy of the whole kept."""
    physical = {'pole_viscosity': 0.0, 'wheel_viscosity': 0.0, 'back_emf_constant': 0.0}
    simulation = make_simulation(
        'reaction_wheel', controller='zero', position=(2.0, 0.0), physical=physical,
        effects=['coulomb_friction:joint=wheel,level=1.0'], **PERFECT,
    )  # fmt: skip
    recording = simulate(simulation, 3.0)
    assert np.all(recording.true_position[:, 1] == 0.0)
    p, v = recording.true_position[:, 0], recording.true_velocity[:, 0]
    inertia = (0.2 / 3.0 + 0.25) * 0.25**2 + 1e-3
    stored = 0.5 * inertia * v**2 + 0.858375 * np.cos(p)
    assert np.ptp(stored) < 1e-8


@pytest.mark.long
def test_swing_under_dry_friction_loses_its_level_times_the_way():
    """Energy falls by level * |angle travelled|, through every turning point, then it rests."""
    physical = {'pole_viscosity': 0.0, 'wheel_viscosity': 0.0, 'back_emf_constant': 0.0}
    level = 0.05
    simulation = make_simulation(
        'reaction_wheel', controller='zero', position=(2.0, 0.0), physical=physical,
        effects=[f'coulomb_friction:joint=pole,level={level}'], rate_hz=1000.0, **PERFECT,
    )  # fmt: skip
    recording = simulate(simulation, 9.0)
    p, v = recording.true_position[:, 0], recording.true_velocity
    turning = (0.2 / 3.0 + 0.25) * 0.25**2 * v[:, 0] ** 2 + 1e-3 * (v[:, 0] + v[:, 1]) ** 2
    stored = 0.5 * turning + 0.858375 * np.cos(p)
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(p)))])
    np.testing.assert_allclose(stored - stored[0], -level * way, atol=2e-5)
    assert np.all(v[-1000:, 0] == 0.0)
    assert np.ptp(p[-1000:]) == 0.0


def test_friction_in_an_interval_acts_only_there():
    """Against the same robot without it, accelerations differ inside the interval only."""
    text = 'position_friction:joint=pole,amplitude={},lo=-3.0,hi=-2.6,kind={}'
    for kind, amplitude in (('coulomb', 0.05), ('viscous', 0.02)):
        effects = [text.format(amplitude, kind)]
        recording = simulate(make_simulation('reaction_wheel', seed=1, effects=effects), 4.0)
        w = {n: c['value'] for n, c in recording.truth['coefficients'].items()}
        (p, _), (dp, dw) = recording.true_position.T, recording.true_velocity.T
        model = (
            w['w1'] * np.sin(p) + w['w3'] * dp + w['w4'] * dw + w['w9'] * recording.command[:, 0]
        )
        wrapped = (p + np.pi) % (2.0 * np.pi) - np.pi
        inside = (wrapped >= -3.0) & (wrapped <= -2.6)
        law = np.sign(dp) if kind == 'coulomb' else dp
        inertia = (0.2 / 3.0 + 0.25) * 0.25**2
        expected = model - inside * amplitude * law / inertia
        assert inside.sum() > 20
        np.testing.assert_allclose(recording.true_acceleration[:, 0], expected, atol=1e-8)
