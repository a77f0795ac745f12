"""Each effect is the generalised force that its formula says, read back from the acceleration."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.friction import stribeck
from sgp_ros.simulation.recording import simulate
from sgp_ros.simulation.sensors import Sensors
from sgp_ros.simulation.tree_simulator import tree_simulator
from test.simulation.trees import arm

URDF = arm(limit=1.5)
SHOULDER, ELBOW = 0, 1
PERFECT = Sensors(measures_velocity=True, measures_effort=True)


def run(*effects, seconds=2.0, rate_hz=200.0, **choices):
    simulator = tree_simulator(URDF)
    choices = {'sensors': PERFECT, 'seed': 5, 'rate_hz': rate_hz} | choices
    return simulate(make_simulation(simulator, effects=effects, **choices), seconds)


def extra_force(recording):
    """Return `M a + h - tau_cmd` along the encoders, (n, k)."""
    tree = tree_simulator(URDF).mechanism
    rows = zip(
        recording.shown_position, recording.shown_velocity, recording.true_acceleration,
        recording.command, strict=True,
    )  # fmt: skip
    pairs = [(tree.dynamics(q, v), a, u) for q, v, a, u in rows]
    return np.array([np.linalg.solve(A, a) - h - u for (A, h), a, u in pairs])


def signals(recording, joint=ELBOW):
    t = 1e-9 * (recording.stamps_ns - recording.stamps_ns[0])
    return t, recording.shown_position[:, joint], recording.shown_velocity[:, joint]


def inside(q, lo, hi):
    return (lo <= q) & (q <= hi)


def _geared(v, recording):
    return v - 0.6 * recording.shown_velocity[:, SHOULDER]


LAWS = {
    'viscous_friction:b=0.2': lambda t, q, v, r: -0.2 * v,
    'coulomb_friction:level=0.2': lambda t, q, v, r: -0.2 * np.sign(v),
    'stribeck_friction:coulomb=0.2,static=0.4,stribeck_velocity=0.5': lambda t, q, v, r: (
        -(0.2 + 0.2 * np.exp(-((v / 0.5) ** 2))) * np.sign(v)
    ),
    'quadratic_drag:c=0.1': lambda t, q, v, r: -0.1 * np.abs(v) * v,
    'asymmetric_coulomb:level_pos=0.1,level_neg=0.3': lambda t, q, v, r: np.where(
        v > 0, -0.1, 0.3
    ),
    'load_friction:level=0.05,mu=0.2': lambda t, q, v, r: (
        -(0.05 + 0.2 * np.abs(r.command[:, ELBOW])) * np.sign(v)
    ),
    'position_friction:amplitude=0.3,lo=-0.1,hi=0.2,kind=viscous': lambda t, q, v, r: (
        -0.3 * v * inside(q, -0.1, 0.2)
    ),
    'position_friction:amplitude=0.3,lo=-0.1,hi=0.2,kind=coulomb': lambda t, q, v, r: (
        -0.3 * np.sign(v) * inside(q, -0.1, 0.2)
    ),
    'limit_friction:amplitude=2,onset=0.1': lambda t, q, v, r: (
        -2.0 * np.maximum((q - 0.1) / (1.5 - 0.1), 0.0) * np.sign(v)
    ),
    'limit_friction:amplitude=2,onset=-0.1': lambda t, q, v, r: (
        -2.0 * np.maximum((-0.1 - q) / (1.5 - 0.1), 0.0) * np.sign(v)
    ),
    'limit_friction:amplitude=2,onset=-0.4,side=upper': lambda t, q, v, r: (
        -2.0 * np.maximum((q + 0.4) / (1.5 + 0.4), 0.0) * np.sign(v)
    ),
    'friction_drift:start=0.5,end=0.1,time_constant=0.7,kind=viscous': lambda t, q, v, r: (
        -(0.1 + 0.4 * np.exp(-t / 0.7)) * v
    ),
    'friction_drift:start=0.3,end=0.1,time_constant=0.7,kind=coulomb': lambda t, q, v, r: (
        -(0.1 + 0.2 * np.exp(-t / 0.7)) * np.sign(v)
    ),
    'spring:stiffness=2,rest=0.3': lambda t, q, v, r: -2.0 * (q - 0.3),
    'constant_load:force=-0.4': lambda t, q, v, r: np.full_like(q, -0.4),
    'cogging:amplitude=0.3,periods=7,phase=0.4': lambda t, q, v, r: 0.3 * np.sin(7 * q + 0.4),
    'end_stop:position=0.1,stiffness=20,damping=0.5': lambda t, q, v, r: (
        -np.maximum(20.0 * (q - 0.1) + 0.5 * v, 0.0) * (q > 0.1)
    ),
    'end_stop:position=0.3,stiffness=5,damping=0.1,side=lower': lambda t, q, v, r: (
        np.maximum(5.0 * (0.3 - q) - 0.1 * v, 0.0) * (q < 0.3)
    ),
    'armature:inertia=0.05': lambda t, q, v, r: -0.05 * r.true_acceleration[:, ELBOW],
    'joint_coupling:source_joint=shoulder,kind=torque,coefficient=0.3': lambda t, q, v, r: (
        0.3 * r.command[:, SHOULDER]
    ),
    'joint_coupling:source_joint=shoulder,kind=spring,stiffness=2,ratio=0.5': lambda t, q, v, r: (
        -2.0 * (q - 0.5 * r.shown_position[:, SHOULDER])
    ),
    'coupled_friction:source_joint=shoulder,ratio=-0.6,coulomb=0.2,viscous=0.1': (
        lambda t, q, v, r: -0.2 * np.sign(_geared(v, r)) - 0.1 * _geared(v, r)
    ),
    'torque_gain:gain=0.8': lambda t, q, v, r: -0.2 * r.command[:, ELBOW],
    'dead_zone:width=0.2': lambda t, q, v, r: -np.clip(r.command[:, ELBOW], -0.2, 0.2),
    'saturation:limit=0.3': lambda t, q, v, r: (
        np.clip(r.command[:, ELBOW], -0.3, 0.3) - r.command[:, ELBOW]
    ),
    'motor_speed_limit:stall_torque=0.6,no_load_speed=3': lambda t, q, v, r: (
        _at_speed(r.command[:, ELBOW], v) - r.command[:, ELBOW]
    ),
}


def _at_speed(u, v):
    """Driving effort is below the line, braking effort below the torque of the standing motor."""
    most = np.where(u * v < 0.0, 0.6, np.maximum(0.6 - 0.2 * np.abs(v), 0.0))
    return np.sign(u) * np.minimum(np.abs(u), most)


@pytest.mark.parametrize('text', LAWS)
def test_force_on_the_joint_is_that_of_the_formula(text):
    """`M a + h = tau_cmd + tau_x`, and nothing acts on the other joint unless by a reaction."""
    name, _, values = text.partition(':')
    recording = run(f'{name}:joint=elbow,{values}')
    found = extra_force(recording)
    t, q, v = signals(recording)
    expected = LAWS[text](t, q, v, recording)
    moves = np.abs(v if 'coupled' not in text else _geared(v, recording)) > 1e-9
    assert np.abs(expected[moves]).max() > 0.05
    np.testing.assert_allclose(found[moves, ELBOW], expected[moves], atol=1e-8)
    if 'ratio=' in text:
        np.testing.assert_allclose(found[moves, SHOULDER], _reaction(text) * found[moves, ELBOW],
                                   atol=1e-8)  # fmt: skip
    else:
        np.testing.assert_allclose(found[:, SHOULDER], 0.0, atol=1e-8)


def _reaction(text):
    """The energy `k (q - r p)^2 / 2` gives the source `r` times the tension, `q + r p` of a motor
    the opposite."""
    return -0.5 if 'kind=spring' in text else -0.6


def test_a_motor_on_two_joints_can_hold_their_sum_at_rest():
    """Beside dry friction of each joint, which stops them one by one and all together."""
    recording = run(
        'coupled_friction:joint=elbow,source_joint=shoulder,ratio=-1,coulomb=3,viscous=0',
        'coulomb_friction:joint=elbow,level=0.1', 'coulomb_friction:joint=shoulder,level=0.3',
        controller='zero', position=(1.0, -0.5), seconds=4.0,
    )  # fmt: skip
    v = recording.true_velocity
    held = np.abs(v[:, ELBOW] - v[:, SHOULDER]) < 1e-10
    moves = np.abs(v[:, SHOULDER]) > 1e-3
    assert np.mean(held & moves) > 0.1  # as one body
    assert np.abs(v[-20:]).max() < 1e-12
    assert np.ptp(recording.true_position[-20:], axis=0).max() < 1e-12


def test_hysteresis_of_a_fast_joint_stays_within_its_level():
    """Its memory then decays within a step, where an explicit integration would grow."""
    recording = run('hysteresis:joint=elbow,level=0.2,presliding=1e-4')
    force = extra_force(recording)[:, ELBOW]
    assert 0.19 < np.abs(force).max() < 0.21


def test_hysteresis_follows_its_own_equation():
    """z integrated from the recorded velocity by trapezia at 1 kHz."""
    recording = run('hysteresis:joint=elbow,level=0.4,presliding=0.05', rate_hz=1000.0)
    _, _, v = signals(recording)
    z, expected = 0.0, []
    for before, after in pairwise(v):
        expected.append(-0.4 * z)
        speed = 0.5 * (before + after)
        decay = np.exp(-abs(speed) * 1e-3 / 0.05)
        z = z * decay + np.sign(speed) * (1.0 - decay)
    np.testing.assert_allclose(extra_force(recording)[:-1, ELBOW], expected, atol=2e-3)


def test_motor_with_backlash_is_alone_inside_the_gap():
    """There `J a = u` of the motor, and the link feels no motor; outside both stay together."""
    gap, inertia = 0.05, 0.003
    recording = run(f'backlash:joint=elbow,gap={gap},motor_inertia={inertia}', seconds=4.0)
    twist = recording.shown_position[:, ELBOW] - recording.true_position[:, ELBOW]
    free = np.abs(twist) < 0.5 * gap
    assert 0.02 < free.mean() < 0.9
    assert np.abs(twist).max() < 0.6 * gap
    motor = inertia * recording.true_acceleration[:, ELBOW]
    np.testing.assert_allclose(motor[free], recording.command[free, ELBOW], atol=1e-6)


@pytest.mark.long
def test_link_behind_backlash_keeps_the_rest_of_the_inertia():
    """Without a gap motor and link together are the nominal robot."""
    stiff = run('backlash:joint=elbow,gap=0,motor_inertia=0.003,contact_hz=200')
    plain = run()
    np.testing.assert_allclose(stiff.true_position, plain.true_position, atol=2e-4)


def test_acceleration_of_an_eccentric_encoder_is_that_of_its_position():
    """Second difference at 1 kHz of what the encoder shows."""
    recording = run('encoder_eccentricity:joint=elbow,amplitude=0.05,periods=3,phase=0.5',
                    rate_hz=1000.0)  # fmt: skip
    shown = recording.shown_position[:, ELBOW]
    second = (shown[2:] - 2.0 * shown[1:-1] + shown[:-2]) / 1e-6
    middle = recording.true_acceleration[1:-1, ELBOW]
    assert np.abs(second - middle).max() < 0.03 * np.abs(middle).max()


def test_velocity_behind_a_filter_is_late_and_the_position_is_not():
    """`T dw/dt + w = v` for the measured w, by central differences at 1 kHz."""
    recording = run('velocity_filter_lag:joint=elbow,time_constant=0.03', rate_hz=1000.0)
    w, v = recording.velocity[:, ELBOW], recording.true_velocity[:, ELBOW]
    slope = (w[2:] - w[:-2]) / 2e-3
    np.testing.assert_allclose(0.03 * slope + w[1:-1], v[1:-1], atol=2e-3)
    np.testing.assert_array_equal(recording.position, recording.true_position)
    assert np.abs(w - v).max() > 0.01


@pytest.mark.parametrize(
    ('effect', 'law'),
    [
        ('torque_gain:joint=elbow,gain=0.7', lambda u: u),
        ('saturation:joint=elbow,limit=0.3', lambda u: np.clip(u, -0.3, 0.3)),
        ('dead_zone:joint=elbow,width=0.2', lambda u: u - np.clip(u, -0.2, 0.2)),
    ],
)
def test_measured_effort_is_the_current_times_the_nominal_constant(effect, law):
    """It is behind dead zone and saturation, and a wrong torque constant does not show in it."""
    recording = run(effect)
    np.testing.assert_allclose(recording.effort[:, ELBOW], law(recording.command[:, ELBOW]))


def test_delay_of_all_motors_is_that_of_each():
    """`joint=all` stands for every motor."""
    together = run('command_delay:joint=all,delay=0.02')
    each = run(*(f'command_delay:joint={j},delay=0.02' for j in ('shoulder', 'elbow')))
    np.testing.assert_array_equal(together.true_position, each.true_position)


def test_dry_friction_of_a_tree_holds_it_still():
    """Below its level nothing moves, to the last bit."""
    recording = run(
        *(f'coulomb_friction:joint={j},level=50' for j in ('shoulder', 'elbow')),
        controller='zero', position=(0.5, 0.5),
    )  # fmt: skip
    assert np.all(recording.true_position == 0.5)
    assert np.all(recording.true_velocity == 0.0)


def test_equal_seeds_give_equal_recordings():
    """Also with noise, jitter and effects with memory."""
    noisy = Sensors(
        (1e-4,), (1e-4,), measures_velocity=True, velocity_noise=(0.01,), jitter_s=1e-3
    )
    pair = [run('hysteresis:joint=elbow,level=0.2,presliding=0.1', sensors=noisy) for _ in '12']
    for name in ('stamps_ns', 'position', 'velocity', 'command', 'true_acceleration'):
        np.testing.assert_array_equal(*(getattr(recording, name) for recording in pair))


def test_friction_of_a_simulation_that_runs_away_is_still_a_number():
    """So that the simulation ends with its own message, not with one of arithmetic."""
    (action,) = stribeck((), 0, {'coulomb': 0.2, 'static': 0.4, 'stribeck_velocity': 0.5})
    fast = SimpleNamespace(velocity=np.array([1e200]))
    assert action.dry_level(fast, 1) == 0.2
