"""Laws of the places where effects act: command, drive, joint, sensor."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sgp_ros.errors import ConfigError
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.effects import Moment
from sgp_ros.simulation.friction import position
from sgp_ros.simulation.mechanism import SimulatedJoint
from sgp_ros.simulation.recording import simulate
from sgp_ros.simulation.registry import LAWS, SIMULATORS
from sgp_ros.simulation.scenario import places
from sgp_ros.simulation.sensors import Sensors

FREE = {'viscosity': 0.0, 'coulomb': 0.0, 'offset': 0.0, 'mass': 1.0}
AXIS = {
    'controller': 'external', 'sensors': Sensors(), 'torque_noise': (0.0,), 'physical': FREE
}  # fmt: skip
EXAMPLE_VALUE = {'kind': 'coulomb', 'lo': 0.1, 'hi': 0.2, 'static': 0.1, 'motor_inertia': 1e-5}


def step_response(effects, seconds=0.5):
    simulation = make_simulation('linear_axis', effects=effects, **AXIS)
    simulation.step()
    simulation.hold([1.0])
    recording = simulate(simulation, seconds)
    return np.arange(1, len(recording.stamps_ns) + 1) / 200.0, recording


def example(name, joint, other=None):
    known = LAWS[name].parameters(EFFECTS[name])
    values = {p.name: EXAMPLE_VALUE.get(p.name, (*p.choices, 0.05)[0]) for p in known
              if not p.default}  # fmt: skip
    if name == 'joint_coupling':
        values = {'kind': 'spring', 'stiffness': 0.05, 'ratio': 2.0}
    if EFFECTS[name].has_source:
        values['source_joint'] = other
    values = ','.join(f'{name}={value}' for name, value in values.items())
    return f'{name}:joint={joint},{values}'


@pytest.mark.parametrize('delay', [0.0, 0.0123, 0.1])
def test_delay_shifts_the_step_response_by_exactly_the_delay(delay):
    """Unit mass: v = t - delay, also where the delay is no multiple of period or substep."""
    t, recording = step_response([f'command_delay:joint=axis,delay={delay}'])
    expected = np.maximum(t - delay, 0.0)
    np.testing.assert_allclose(recording.true_velocity[:, 0], expected, atol=1e-12)
    late = t < delay
    np.testing.assert_array_equal(recording.true_acceleration[late], 0.0)


def test_lag_is_the_exact_first_order_response():
    """a = 1 - exp(-t/T); Runge-Kutta at 1 ms and T = 50 ms is exact to 1e-9."""
    t, recording = step_response(['actuator_lag:joint=axis,time_constant=0.05'])
    exact = 1.0 - np.exp(-t / 0.05)
    np.testing.assert_allclose(recording.true_acceleration[:, 0], exact, atol=1e-8)


def test_delay_acts_before_the_lag():
    """Both together are the lag's response, later by the delay."""
    effects = ['actuator_lag:joint=axis,time_constant=0.05', 'command_delay:joint=axis,delay=0.02']
    t, recording = step_response(effects)
    exact = np.where(t >= 0.02, 1.0 - np.exp(-(t - 0.02) / 0.05), 0.0)
    np.testing.assert_allclose(recording.true_acceleration[:, 0], exact, atol=1e-8)


def test_eccentricity_changes_what_is_seen_not_what_is():
    """The encoder shows q + A sin(3 q + phase); velocity is the derivative of that."""
    sensors = Sensors(measures_velocity=True)
    effect = ['encoder_eccentricity:joint=wheel,amplitude=0.05,periods=3,phase=0.5']
    plain = simulate(make_simulation('reaction_wheel', sensors=sensors), 1.0)
    shown = simulate(make_simulation('reaction_wheel', sensors=sensors, effects=effect), 1.0)
    np.testing.assert_array_equal(plain.true_position, shown.true_position)
    q, v = shown.true_position[:, 1], shown.true_velocity[:, 1]
    np.testing.assert_allclose(shown.position[:, 1], q + 0.05 * np.sin(3 * q + 0.5), atol=1e-12)
    np.testing.assert_allclose(
        shown.velocity[:, 1], v * (1 + 0.15 * np.cos(3 * q + 0.5)), atol=1e-12
    )
    np.testing.assert_array_equal(shown.position[:, 0], q * 0 + shown.true_position[:, 0])


@pytest.mark.parametrize('robot', SIMULATORS)
@pytest.mark.parametrize('name', LAWS)
def test_every_effect_runs_on_every_joint_that_can_have_it(robot, name):
    """The motion stays finite and the truth, with units, survives JSON."""
    effect, simulator = EFFECTS[name], SIMULATORS[robot]
    for joint in simulator.joint_names:
        other = next((x for x in simulator.joint_names if x != joint), None)
        text = example(name, joint, other)
        lacks_joints = effect.has_source and other is None
        if joint not in places(simulator, effect) or name == 'limit_friction' or lacks_joints:
            with pytest.raises(ConfigError, match=joint):
                make_simulation(robot, effects=[text])
            continue
        recording = simulate(make_simulation(robot, effects=[text], seed=1), 0.2)
        assert np.all(np.isfinite(recording.true_acceleration))
        assert json.loads(json.dumps(recording.truth)) == recording.truth
        described = recording.truth['effects'][0]
        assert (described['effect'], described['joint']) == (name, joint)
        assert set(described['parameters']) <= {p.name for p in LAWS[name].parameters(effect)}


@pytest.mark.parametrize(
    ('robot', 'name'), [(r, c) for r, s in SIMULATORS.items() for c in s.controllers]
)
def test_every_controller_runs_on_its_robot(robot, name):
    """Commands are finite, one per commanded joint."""
    recording = simulate(make_simulation(robot, controller=name), 0.5)
    assert recording.command.shape == (len(recording.stamps_ns), len(recording.command_joints))
    assert np.all(np.isfinite(recording.command))
    assert set(recording.truth['coefficients']) == {
        c.name for c in SIMULATORS[robot].mechanism.coefficients()
    }


@pytest.mark.parametrize('turns', [-2, 0, 1])
def test_an_interval_across_the_wrap_is_one_interval(turns):
    """3.0 to 3.4 rad is also -3.28 to -2.88 rad, on every turn."""
    joint = SimulatedJoint('hinge', is_continuous=True)
    values = {'amplitude': 1.0, 'lo': 3.0, 'hi': 3.4, 'kind': 'coulomb', 'edge': 0.0}
    (action,) = position((joint,), 0, values)
    q = np.array([2.9, 3.1, 3.3, 3.5, -3.1, -2.8]) + 2.0 * np.pi * turns
    moments = [Moment(0.0, np.array([x]), np.ones(1), np.zeros(1), np.zeros(0)) for x in q]
    assert [action.dry_level(m, 1) for m in moments] == [0.0, 1.0, 1.0, 0.0, 1.0, 0.0]
