"""Laws of the simulated reaction wheel."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sgp_ros.errors import NumericalError
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.reaction_wheel import discrete_regulator
from sgp_ros.simulation.recording import simulate
from sgp_ros.simulation.sensors import Sensors

PERFECT = {'sensors': Sensors(), 'torque_noise': (0.0, 0.0)}
WITHOUT_LOSSES = {'pole_viscosity': 0.0, 'wheel_viscosity': 0.0, 'back_emf_constant': 0.0}


def coefficients(simulation):
    return {name: entry['value'] for name, entry in simulation.truth()['coefficients'].items()}


def energy(recording):
    """Kinetic and potential energy, from the textbook and not from the simulator's matrices."""
    pole_mass, length, wheel_mass, wheel_inertia = 0.2, 0.25, 0.25, 1e-3
    pole, wheel = recording.true_velocity.T
    turning = pole_mass * length**2 / 3.0 * pole**2 + wheel_mass * (length * pole) ** 2
    spinning = wheel_inertia * (pole + wheel) ** 2
    height = (pole_mass * length / 2.0 + wheel_mass * length) * np.cos(
        recording.true_position[:, 0]
    )
    return 0.5 * (turning + spinning) + 9.81 * height


def equation_27(w, recording):
    (p, _), (dp, dw), m = (
        recording.true_position.T,
        recording.true_velocity.T,
        recording.command[:, 0],
    )
    wheel = recording.true_position[:, 1]
    pole_axis = w['w1'] * np.sin(p) + w['w2'] * wheel + w['w3'] * dp + w['w4'] * dw + w['w9'] * m
    wheel_axis = w['w5'] * np.sin(p) + w['w6'] * wheel + w['w7'] * dp + w['w8'] * dw + w['w10'] * m
    return np.stack([pole_axis, wheel_axis], axis=1)


def test_without_losses_energy_is_conserved():
    """Fourth order at 1 ms: the drift over 10 s is far below a millionth."""
    simulation = make_simulation(
        'reaction_wheel', controller='zero', physical=WITHOUT_LOSSES, position=(1.0, 0.0),
        velocity=(0.0, 30.0), **PERFECT,
    )  # fmt: skip
    stored = energy(simulate(simulation, 10.0))
    assert np.ptp(stored) < 1e-8 * np.abs(stored).max()


def test_losses_only_take_energy():
    """Viscosity dissipates at every instant when no command acts."""
    simulation = make_simulation(
        'reaction_wheel', controller='zero', position=(1.0, 0.0), velocity=(0.0, 30.0), **PERFECT
    )
    assert np.all(np.diff(energy(simulate(simulation, 5.0))) < 0.0)


def test_coefficients_are_those_of_the_published_prototype():
    """Within 1 %: the published numbers are rounded to three digits."""
    published = [43.37, 0.0, -0.202, 0.101, -43.37, 0.0, 0.202, -2.10, -1.516, 31.5]
    true = coefficients(make_simulation('reaction_wheel'))
    assert list(true) == [f'w{i}' for i in range(1, 11)]
    np.testing.assert_allclose(list(true.values()), published, rtol=0.01)


@pytest.mark.parametrize(
    'physical', [{}, WITHOUT_LOSSES, {'pole_mass': 0.4, 'wheel_inertia': 2e-3}]
)
@pytest.mark.parametrize('effects', [[], ['viscous_friction:joint=pole,b=0.01']])
def test_accelerations_satisfy_equation_27(physical, effects):
    """The stated coefficients are those of the motion, with changed parameters and effects."""
    simulation = make_simulation('reaction_wheel', seed=3, physical=physical, effects=effects)
    recording = simulate(simulation, 2.0)
    expected = equation_27(coefficients(simulation), recording)
    np.testing.assert_allclose(recording.true_acceleration, expected, rtol=1e-9, atol=1e-9)


def test_measured_motion_is_the_integral_of_the_accelerations():
    """Velocity differences equal the mean acceleration: Simpson over two periods, O(h^4)."""
    simulation = make_simulation(
        'reaction_wheel', seed=1, rate_hz=1000.0, physical={'gravity': 9.81}, **PERFECT
    )
    recording = simulate(simulation, 0.5)
    acceleration, command = recording.true_acceleration, recording.command[:, 0]
    w = coefficients(simulation)
    gain = np.array([w['w9'], w['w10']])
    drift = acceleration - command[:, None] * gain
    smooth = (drift[:-2] + 4.0 * drift[1:-1] + drift[2:]) / 6.0
    driven = 0.5 * (command[:-2] + command[1:-1])[:, None] * gain
    change = (recording.true_velocity[2:] - recording.true_velocity[:-2]) / 2e-3
    np.testing.assert_allclose(change, smooth + driven, atol=1e-3)


def test_added_viscosity_equals_changed_viscosity():
    """The effect and the physical parameter are the same physics, stated apart in the truth."""
    effect = make_simulation(
        'reaction_wheel', seed=1, effects=['viscous_friction:joint=wheel,b=0.001'], **PERFECT
    )
    parameter = make_simulation(
        'reaction_wheel', seed=1, physical={'wheel_viscosity': 2e-4 + 1e-3}, **PERFECT
    )
    first, second = simulate(effect, 2.0), simulate(parameter, 2.0)
    np.testing.assert_allclose(first.true_position, second.true_position, rtol=1e-9, atol=1e-9)
    assert coefficients(effect) == pytest.approx(coefficients(parameter), rel=1e-12)
    w4 = effect.truth()['coefficients']['w4']
    assert w4['effects'] == pytest.approx(1e-3 * 43.37 / 0.858375, rel=1e-3)
    assert w4['nominal'] + w4['physical'] + w4['effects'] == pytest.approx(w4['value'])


@pytest.mark.long
@pytest.mark.parametrize('seed', range(3))
def test_balance_keeps_the_pole_up(seed):
    """60 s with encoder steps and torque noise, from finite differences of measured angles."""
    recording = simulate(make_simulation('reaction_wheel', seed=seed, controller='balance'), 60.0)
    assert np.abs(recording.true_position[:, 0]).max() < 0.3
    assert np.abs(recording.true_position[3000:, 0]).max() < 0.05


@pytest.mark.parametrize('seed', range(5))
def test_sinusoids_swing_the_pole_below_the_horizontal(seed):
    """6 V excite without turning the pole over; the wheel stays below 200 rad/s."""
    recording = simulate(make_simulation('reaction_wheel', seed=seed), 10.0)
    swing = np.abs(recording.true_position[:, 0] - math.pi)
    assert 0.1 < swing.max() < 0.5 * math.pi
    assert np.abs(recording.true_velocity[:, 1]).max() < 200.0


def test_double_integrator_regulator_has_no_cheaper_neighbour():
    """Of all linear gains the Riccati gain costs least from any start: perturb and compare."""
    A, B = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]])
    Q, R, period = np.diag([1.0, 0.1]), np.array([[0.5]]), 0.1
    Ad = np.array([[1.0, period], [0.0, 1.0]])
    Bd = np.array([[0.5 * period**2], [period]])

    def cost(gain):
        x, total = np.array([1.0, -0.5]), 0.0
        for _ in range(600):
            u = -gain @ x
            total += x @ Q @ x + u @ R @ u
            x = Ad @ x + Bd @ u
        return total

    best = discrete_regulator(A, B, Q, R, period)
    for change in np.random.default_rng(0).normal(size=(20, 1, 2)):
        assert cost(best) < cost(best + 0.01 * change)


@pytest.mark.parametrize('physical', [{'wheel_inertia': 1e-300}, {'gravity': 1e200}])
def test_a_wheel_that_no_regulator_balances_is_refused_in_one_line(physical):
    """The library would end in an error of its own."""
    with pytest.raises(NumericalError, match='no regulator balances') as caught:
        make_simulation('reaction_wheel', controller='balance', physical=physical)
    assert '\n' not in str(caught.value)
