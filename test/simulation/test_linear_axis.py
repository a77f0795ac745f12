"""Laws of the simulated linear axis."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.recording import simulate
from sgp_ros.simulation.sensors import Sensors

PERFECT = {'sensors': Sensors(), 'torque_noise': (0.0,)}


def values(simulation):
    return {name: entry['value'] for name, entry in simulation.truth()['coefficients'].items()}


def driven(force, seconds, **choices):
    simulation = make_simulation('linear_axis', controller='external', **PERFECT, **choices)
    simulation.step()
    simulation.hold([force])
    return simulate(simulation, seconds)


def test_motion_satisfies_the_inverse_model():
    """F = M a + Fv v + Fc sign(v) + offset wherever the axis slides."""
    simulation = make_simulation('linear_axis', seed=2)
    recording = simulate(simulation, 5.0)
    c = values(simulation)
    a, v = recording.true_acceleration[:, 0], recording.true_velocity[:, 0]
    force = c['M'] * a + c['Fv'] * v + c['Fc'] * np.sign(v) + c['offset']
    slides = v != 0.0
    assert slides.sum() > 0.8 * len(v)
    np.testing.assert_allclose(recording.command[slides, 0], force[slides], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize('force', [17.0, -23.0])
def test_force_within_dry_friction_moves_nothing(force):
    """|F - offset| < Fc: position and velocity stay at exactly 0."""
    recording = driven(force, 1.0)
    assert np.all(recording.true_position == 0.0)
    assert np.all(recording.true_velocity == 0.0)
    assert np.all(recording.true_acceleration == 0.0)


@pytest.mark.parametrize('force', [17.5, -24.0])
def test_force_beyond_dry_friction_moves_the_axis(force):
    """The axis follows the exact exponential towards (F - offset - Fc sign) / Fv."""
    recording = driven(force, 2.0)
    c = recording.truth['coefficients']
    M, Fv, Fc, offset = (c[name]['value'] for name in ('M', 'Fv', 'Fc', 'offset'))
    final = (force - offset - np.sign(force) * Fc) / Fv
    t = 1e-9 * (recording.stamps_ns - recording.stamps_ns[0]) + 1.0 / 200.0
    exact = final * (1.0 - np.exp(-Fv / M * t))
    np.testing.assert_allclose(recording.true_velocity[:, 0], exact, rtol=1e-9, atol=1e-15)


def test_dry_friction_alone_stops_after_the_exact_time():
    """v^2 / (2 Fc / M) is the way to rest; after it there is no chatter, velocity is exactly 0."""
    simulation = make_simulation(
        'linear_axis', controller='zero', velocity=(0.1,),
        physical={'viscosity': 0.0, 'offset': 0.0, 'mass': 100.0, 'coulomb': 20.0}, **PERFECT,
    )  # fmt: skip
    recording = simulate(simulation, 2.0)
    assert recording.true_position[-1, 0] == pytest.approx(0.1**2 / (2.0 * 0.2), rel=1e-9)
    assert np.all(recording.true_velocity[101:, 0] == 0.0)
    assert np.all(recording.true_acceleration[101:, 0] == 0.0)


def test_noise_below_dry_friction_does_not_creep():
    """White force whose substep values stay under Fc leaves a resting axis where it is."""
    simulation = make_simulation(
        'linear_axis', controller='zero', sensors=Sensors(), torque_noise=(0.05,)
    )
    assert np.all(simulate(simulation, 2.0).true_position == 0.0)


def test_without_nominal_friction_the_axis_is_an_integrator():
    """Nominal friction is removed by its physical parameters: v = F t / M."""
    physical = {'viscosity': 0.0, 'coulomb': 0.0, 'offset': 0.0}
    recording = driven(10.0, 1.0, physical=physical)
    assert recording.truth['built_in_effects'] == []
    t = np.arange(1, 201) / 200.0
    np.testing.assert_allclose(recording.true_velocity[:, 0], 10.0 * t / 95.11, rtol=1e-9)


def test_added_dry_friction_is_part_of_the_true_coefficient():
    """Fc is what an identification sees: the nominal one plus the effect."""
    simulation = make_simulation('linear_axis', effects=['coulomb_friction:joint=axis,level=5'])
    entry = simulation.truth()['coefficients']['Fc']
    assert entry == {
        'value': pytest.approx(25.39), 'unit': 'N', 'nominal': 20.39, 'physical': 0.0,
        'effects': pytest.approx(5.0),
    }  # fmt: skip
    assert simulation.truth()['effects'][0]['parameters']['level'] == {'value': 5.0, 'unit': 'N'}


@pytest.mark.long
@pytest.mark.parametrize('seed', range(3))
def test_tracking_stays_near_its_reference(seed):
    """The axis moves by decimetres and never runs away."""
    recording = simulate(make_simulation('linear_axis', seed=seed), 20.0)
    assert 0.05 < np.abs(recording.true_position).max() < 1.0
    assert np.abs(recording.command).max() < 1000.0
