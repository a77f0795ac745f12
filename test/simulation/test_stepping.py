"""Laws of time, randomness and commands in a simulation."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.errors import ConfigError
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.recording import simulate
from sgp_ros.simulation.registry import SIMULATORS
from sgp_ros.simulation.sensors import Sensors
from sgp_ros.simulation.stepping import HeldCommands

ARRAYS = (
    'stamps_ns', 'position', 'velocity', 'command_stamps_ns', 'command', 'true_position',
    'true_velocity', 'true_acceleration',
)  # fmt: skip
NOISY = Sensors((1e-3,), (1e-4,), measures_velocity=True, velocity_noise=(1e-2,), jitter_s=2e-3)


def assert_same(first, second):
    for name in ARRAYS:
        a, b = getattr(first, name), getattr(second, name)
        assert (a is None) == (b is None)
        if a is not None:
            np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize('robot', SIMULATORS)
def test_equal_seeds_give_equal_bits(robot):
    """Everything random comes from the seed, and building another simulation disturbs nothing."""
    first = make_simulation(robot, seed=5, sensors=NOISY)
    second = make_simulation(robot, seed=5, sensors=NOISY)
    third = simulate(make_simulation(robot, seed=6, sensors=NOISY), 0.5)
    one = simulate(first, 0.5)
    assert_same(one, simulate(second, 0.5))
    assert not np.array_equal(one.position, third.position)


@pytest.mark.parametrize('robot', SIMULATORS)
def test_live_stepping_equals_a_recording(robot):
    """A node that steps and a command that records run the same code: no bit differs."""
    live = make_simulation(robot, seed=2, sensors=NOISY, start_ns=10**18)
    samples = [live.step() for _ in range(40)]
    recording = simulate(
        make_simulation(robot, seed=2, sensors=NOISY, start_ns=10**18),
        40.0 / SIMULATORS[robot].rate_hz,
    )
    assert [s.stamp_ns for s in samples] == recording.stamps_ns.tolist()
    np.testing.assert_array_equal([s.position for s in samples], recording.position)
    np.testing.assert_array_equal([s.velocity for s in samples], recording.velocity)
    np.testing.assert_array_equal([s.command for s in samples], recording.command)
    np.testing.assert_array_equal(
        [s.true_acceleration for s in samples], recording.true_acceleration
    )


def test_two_recordings_in_a_row_equal_one_long_one():
    """A recording leaves the simulation where it stands."""
    parts = make_simulation('reaction_wheel', seed=1)
    whole = simulate(make_simulation('reaction_wheel', seed=1), 1.0)
    positions = [simulate(parts, 0.5).position, simulate(parts, 0.5).position]
    np.testing.assert_array_equal(np.vstack(positions), whole.position)


def test_stamps_start_where_told_and_follow_the_rate():
    """Integer nanoseconds: an epoch loses nothing."""
    recording = simulate(make_simulation('reaction_wheel', rate_hz=50.0, start_ns=10**18 + 1), 0.1)
    assert recording.stamps_ns.tolist() == [10**18 + 1 + 20_000_000 * i for i in range(5)]
    assert recording.stamps_ns.dtype == np.int64


def test_jitter_makes_sampling_uneven_around_the_clock():
    """Stamps differ from the clock by at most the jitter, never accumulate, never swap."""
    recording = simulate(make_simulation('reaction_wheel', seed=1, sensors=NOISY), 2.0)
    deviation = recording.stamps_ns[1:] - 10_000_000 * np.arange(1, 200)
    assert np.abs(deviation).max() <= 2_000_000
    assert deviation.std() > 500_000
    assert np.all(np.diff(recording.stamps_ns) > 0)


def test_steps_of_any_length_follow_the_same_motion():
    """Without noise the way time is cut matters only to the order of the integration."""
    choices = {'controller': 'zero', 'torque_noise': (0.0, 0.0), 'position': (2.0, 0.0)}
    even = make_simulation('reaction_wheel', **choices)
    uneven = make_simulation('reaction_wheel', **choices)
    even.advance(300_000_000)
    for elapsed_ns in (1, 999, 12_345_678, 87_653_322, 200_000_000):
        uneven.advance(elapsed_ns)
    np.testing.assert_allclose(
        even.step(0).true_position, uneven.step(0).true_position, rtol=1e-10, atol=1e-10
    )


def test_time_cannot_run_backwards():
    """A negative step is a mistake of the caller."""
    with pytest.raises(ValueError, match='negative'):
        make_simulation('reaction_wheel').advance(-1)


def test_command_from_outside_holds_until_the_next():
    """With controller `external` every sample shows the command given last."""
    simulation = make_simulation('reaction_wheel', controller='external')
    assert simulation.step().command.tolist() == [0.0]
    simulation.hold([3.0])
    assert [simulation.step().command.tolist() for _ in range(3)] == [[3.0]] * 3
    with pytest.raises(ValueError, match='command'):
        simulation.hold([1.0, 2.0])


def test_process_noise_has_the_stated_density_at_any_rate():
    """Velocity of a free axis is a random walk of variance density^2 t / M^2; 10 % is 4 sigma."""
    physical = {'viscosity': 0.0, 'coulomb': 0.0, 'offset': 0.0, 'mass': 2.0}
    for rate_hz in (100.0, 1250.0):
        simulation = make_simulation(
            'linear_axis', seed=3, rate_hz=rate_hz, controller='zero', physical=physical,
            torque_noise=(0.5,),
        )  # fmt: skip
        velocity = simulate(simulation, 8.0).true_velocity[:, 0]
        variance = np.mean(np.diff(velocity) ** 2) * rate_hz
        tolerance = 4.0 * np.sqrt(2.0 / len(velocity))
        assert variance == pytest.approx((0.5 / 2.0) ** 2, rel=tolerance)


def test_controller_sees_measurements_not_the_truth():
    """The balance command follows from the measured state: a coarse encoder hides a small tilt."""
    coarse = Sensors(resolution=(0.01,), measures_velocity=True)
    fine = Sensors(measures_velocity=True)
    choices = {'controller': 'balance', 'torque_noise': (0.0, 0.0), 'position': (0.004, 0.0)}
    blind = make_simulation('reaction_wheel', sensors=coarse, **choices)
    assert blind.step().command[0] == 0.0
    seeing = make_simulation('reaction_wheel', sensors=fine, **choices)
    assert seeing.step().command[0] != 0.0


@pytest.mark.parametrize(
    ('choices', 'words'),
    [
        ({'robot': 'robocop'}, ['robocop', 'reaction_wheel', 'linear_axis']),
        ({'controller': 'swing_up'}, ['swing_up', 'sinusoids', 'balance']),
        ({'rate_hz': 0.0}, ['rate 0 Hz', '100000 Hz']),
        ({'rate_hz': float('nan')}, ['rate nan Hz']),
        ({'seed': -1}, ['seed -1']),
        ({'physical': {'pole_weight': 1.0}}, ['pole_weight', 'pole_mass [kg]']),
        ({'physical': {'pole_mass': 0.0}}, ['pole_mass = 0 is not positive']),
        ({'physical': {'gravity': float('inf')}}, ['gravity = inf is not finite']),
        ({'position': (1.0,)}, ['position', '2 finite numbers', 'pole']),
        ({'torque_noise': (-1.0, 0.0)}, ['torque_noise']),
        ({'sensors': Sensors(jitter_s=0.005)}, ['jitter_s', 'below 0.005 s']),
        ({'sensors': Sensors(resolution=(0.1, 0.1, 0.1))}, ['resolution', '1 or 2']),
    ],
)
def test_wrong_choices_are_refused_in_one_line(choices, words):
    """The line says what was found and what exists."""
    with pytest.raises(ConfigError) as refusal:
        make_simulation(**{'robot': 'reaction_wheel', **choices})
    assert '\n' not in str(refusal.value)
    assert all(word in str(refusal.value) for word in words), str(refusal.value)


@pytest.mark.parametrize('duration', [0.0, -1.0, float('nan'), float('inf'), 0.004])
def test_recording_without_a_sample_is_refused(duration):
    """A duration must hold at least one period."""
    with pytest.raises(ConfigError, match='duration'):
        simulate(make_simulation('reaction_wheel'), duration)


def test_before_the_first_command_there_is_nothing():
    assert HeldCommands([0, 0]).arrived(5).tolist() == [0.0, 0.0]


def test_a_command_given_ahead_of_its_time_leaves_the_one_before_in_force():
    commands = HeldCommands([0])
    commands.hold(0, np.array([1.0]))
    commands.hold(10, np.array([2.0]))
    assert commands.arrived(9).tolist() == [1.0]
    assert commands.switches(5, 20) == [10]
    assert commands.arrived(10).tolist() == [2.0]


def test_each_channel_waits_for_its_own_delay():
    commands = HeldCommands([0, 30])
    for time_ns in range(0, 100, 10):
        commands.hold(time_ns, np.array([time_ns, time_ns], dtype=float))
        assert commands.arrived(time_ns).tolist() == [time_ns, max(time_ns - 30, 0)]
