"""A spring between motor and link, on motions that were simulated with all of its states."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import signal

from sgp_ros.batch.zero_phase import ZeroPhase
from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.compare.parallel_filter import ParallelFilter
from sgp_ros.diagnosis.compare.volume import Loop
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.screening import screen
from sgp_ros.diagnosis.explain.uncertainty import reported_std
from sgp_ros.physics.catalogue import ARMATURE, EFFECTS, VISCOUS_FRICTION
from sgp_ros.physics.drive import Drive
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.elasticity import twist_of
from sgp_ros.physics.hidden_states import behind, resonator
from sgp_ros.physics.memory import BARE
from sgp_ros.physics.place import Place
from sgp_ros.rigid.tree import read_urdf
from sgp_ros.robots.observed_motion import ObservedMotion
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.recording import simulate
from sgp_ros.simulation.sensors import Sensors
from sgp_ros.simulation.tree_simulator import tree_simulator
from test.simulation.trees import arm

URDF, ELBOW = arm(limit=1.5), 1
RATE, SECONDS, CUTOFF = 400.0, 6.0, 25.0
J = 0.003
STIFFNESS = J * (2.0 * np.pi * 15.0) ** 2
LAW = EFFECTS['joint_elasticity']
SPRING = {'stiffness': STIFFNESS, 'damping': 0.02, 'motor_inertia': J}
FRICTION = 0.05


@cache
def recorded(encoder, *, has_friction=False):
    """A motion of the arm whose elbow motor would swing at 15 Hz on its spring."""
    text = ','.join(f'{name}={x}' for name, x in SPRING.items())
    effects = [f'joint_elasticity:joint=elbow,{text},encoder={encoder}']
    effects += [f'viscous_friction:joint=elbow,b={FRICTION}'] * has_friction
    return moved(effects)


def moved(effects):
    """A motion of the arm with effects."""
    return simulate(
        make_simulation(
            tree_simulator(URDF), effects=effects, seed=5, rate_hz=RATE,
            sensors=Sensors(measures_velocity=True, measures_effort=True),
        ), SECONDS,
    )  # fmt: skip


def equations(encoder, *, has_friction=False):
    """The equations of that motion."""
    return equations_of(recorded(encoder, has_friction=has_friction))


def equations_of(recording):
    """The equations of a motion, as a diagnosis forms them, without bodies."""
    t = 1e-9 * (recording.stamps_ns - recording.stamps_ns[0])
    n = len(t)
    states = ZeroPhase(RATE, 2.5 * CUTOFF).states(recording.shown_position)
    drive = Drive(t, recording.command, ((0.0, n),), 1.0 / RATE)
    effort = np.column_stack([drive.effort(j) for j in range(2)])
    motion = ObservedMotion(read_urdf(URDF), t, 1.0 / RATE, *states, effort, drive,
                            bandwidth=CUTOFF)  # fmt: skip
    low = ParallelFilter(RATE, CUTOFF, (slice(0, n),))
    d = low(motion.nominal_effort - effort)
    return Equations(
        motion, low, t[low.rows], d, (np.zeros((len(d), 0)),) * 2, np.zeros((0, 20)),
        (effort**2).mean(axis=0), np.full(2, 1e-9), np.ones((n, 2)), np.zeros((n, 2), dtype=bool),
        *[np.zeros(2)] * 4, Loop.of(motion, CUTOFF),
    )  # fmt: skip


@pytest.mark.parametrize('encoder', ['motor', 'link'])
def test_its_force_is_what_the_nominal_robot_lacks(encoder):
    """Below the bandwidth, with a resonance below it too; the wrong side explains none of it."""
    found = equations(encoder)
    left = {}
    for kind in LAW.kinds:
        truth = EffectAt.stated(LAW, 'elbow', SPRING | {'encoder': kind}, found.motion.tree)
        force = Columns(found).of(truth, found)[:, :, 0]
        left[kind] = ((found.d - force) ** 2).sum() / (found.d**2).sum()
    assert left.pop(encoder) < 1e-3
    assert min(left.values()) > 0.9


@pytest.mark.parametrize('encoder', ['motor', 'link'])
def test_no_friction_or_rotor_is_taken_for_a_resonance(encoder):
    """With the spring beside them both have their right size, without it they have not."""
    found = equations(encoder, has_friction=True)
    columns, plain = Columns(found), (EffectAt(VISCOUS_FRICTION, Place(ELBOW)),
                                      EffectAt(ARMATURE, Place(ELBOW)))  # fmt: skip
    start = np.sqrt((found.d**2).mean(axis=0)) + 1e-9
    alone = fit(columns, plain, start, is_free=False)
    (_, spring), *_ = screen(columns, alone, [LAW])
    assert spring.place == Place(ELBOW, encoder)
    both = fit(columns, (*plain, spring), start, is_free=False)
    friction, rotor = (float(s.coefficients[0]) for s in both.effects[:2])
    assert friction == pytest.approx(FRICTION, rel=0.05)  # it is on the link
    assert abs(rotor) < 0.1 * J
    assert abs(alone.effects[1].coefficients[0]) > 2.0 * abs(rotor)
    numbers = both.effects[2].report(found.motion)
    assert numbers['encoder'] == encoder
    assert numbers['stiffness'] == pytest.approx(STIFFNESS, rel=0.1)
    assert both.mean_square.sum() < 0.02 * alone.mean_square.sum()


def test_a_rotor_that_the_robot_file_lacks_is_told_from_the_link():
    """Three times the link, as behind a gear: with the rotor beside the spring both are found."""
    link = equations('motor').motion.free_inertia(ELBOW, slice(None))
    rotor, stiffness = 3.0 * link, link * (2.0 * np.pi * 8.0) ** 2
    numbers = f'stiffness={stiffness},damping=0.01,motor_inertia={rotor}'
    found = equations_of(moved([
        f'armature:joint=elbow,inertia={rotor}',
        f'joint_elasticity:joint=elbow,{numbers},encoder=motor',
    ]))  # fmt: skip
    columns, start = Columns(found), np.sqrt((found.d**2).mean(axis=0)) + 1e-9
    beside = EffectAt(ARMATURE, Place(ELBOW))
    alone, rotor_alone = (fit(columns, x, start, is_free=False) for x in ((), (beside,)))
    assert BARE not in {s.place.kind for _, s in screen(columns, alone, [LAW])}
    springs = {s.place.kind: s for _, s in reversed(screen(columns, rotor_alone, [LAW], [ELBOW]))}
    whole = replace(beside, coefficients=np.array([rotor]))
    behind = screen(columns, replace(rotor_alone, effects=(whole,)), [LAW], [ELBOW])
    assert {s.place.kind for _, s in behind} == {BARE, 'link'}
    model = fit(columns, (beside, springs[BARE]), start, is_free=False, steps=30)
    armature, spring = model.effects
    numbers = spring.report(found.motion)
    assert float(armature.coefficients[0]) == pytest.approx(rotor, rel=0.1)
    assert numbers['motor_inertia'] == pytest.approx(rotor, rel=0.1)
    assert numbers['stiffness'] == pytest.approx(stiffness, rel=0.1)
    assert numbers['encoder'] == 'motor'
    assert float(model.mean_square[ELBOW] / (found.d[:, ELBOW] ** 2).mean()) < 0.01
    of_rotor, of_spring = reported_std(model, columns)
    assert of_spring['motor_inertia'] == pytest.approx(of_rotor['inertia'])  # one number
    inside = EffectAt(LAW, Place(ELBOW, 'motor'), np.array([0.1 * link, *spring.shape[1:]]))
    moved_out = fit(columns, (beside, inside), start, is_free=False)
    assert moved_out.effects[1].place.kind == BARE


def test_a_joint_has_one_spring():
    """No other one is looked for there, however much it leaves."""
    found = equations('motor')
    columns, start = Columns(found), np.sqrt((found.d**2).mean(axis=0)) + 1e-9
    alone = fit(columns, (), start, is_free=False)
    shape = np.array([J, 1.0 / STIFFNESS, 0.0, 0.0])
    spring = EffectAt(LAW, Place(ELBOW, 'motor'), shape, np.ones(1))
    assert screen(columns, alone, [LAW], [ELBOW])
    assert screen(columns, replace(alone, effects=(spring,)), [LAW], [ELBOW]) == []


@pytest.mark.parametrize('entry', [1, 2])
def test_a_spring_that_is_softest_or_most_damped_is_something_else(entry):
    """Such as a load on its own, a lag or a delay of the drive."""
    motion, place = equations('motor').motion, Place(ELBOW, 'link')
    high = LAW.bounds(motion, place)[1]
    at = EffectAt(LAW, place, 0.5 * high, np.ones(1))
    assert LAW.is_inside(at, motion)
    ends = at.shape.copy()
    ends[entry] = high[entry]
    assert not LAW.is_inside(at.with_shape(ends), motion)


def test_a_motor_on_a_spring_has_its_own_equation():
    """`J theta'' = u - K (theta - q) - D (dtheta - dq)`, theta being what the encoder shows."""
    recording = recorded('motor')
    twist = recording.shown_position - recording.true_position
    spin = recording.shown_velocity - recording.true_velocity
    torque = STIFFNESS * twist[:, ELBOW] + SPRING['damping'] * spin[:, ELBOW]
    expected = (recording.command[:, ELBOW] - torque) / J
    np.testing.assert_allclose(recording.true_acceleration[:, ELBOW], expected, atol=1e-4)
    assert np.abs(twist[:, ELBOW]).max() > 1e-3
    assert not twist[:, 0].any()


def test_hidden_states_follow_their_filters():
    """Where the input is straight between the rows, against a solver of linear systems."""
    u = np.random.default_rng(0).normal(size=500)
    u[0] = 0.0
    t, a, b = 0.002 * np.arange(500), 1.0 / (2.0 * np.pi * 30.0) ** 2, 1e-4
    for numerator, denominator, found in (
        ([1.0], [0.01, 1.0], behind(u, 0.01, 0.002)),
        ([b, 1.0], [a, b, 1.0], resonator(u, a, b, 0.002)),
        ([0.1, 1.0], [a, 0.1, 1.0], resonator(u, a, 0.1, 0.002)),
    ):
        np.testing.assert_allclose(found, signal.lsim((numerator, denominator), u, t)[1],
                                   atol=1e-9)  # fmt: skip


@pytest.mark.parametrize('damping', [0.0, 3.0])
def test_friction_of_the_motor_does_not_reach_the_spring(damping):
    """The link swings under the motor, from any state at the start, whatever the motor takes.

    Of a link on a spring, on the motor's side of which is friction of the size of the effort, a
    part of which the robot file may have.
    """
    step, link, J, K, D, G = 0.002, 0.3, 0.05, 216.0, 0.55, 6.0
    t = step * np.arange(6000)
    rate = 2.0 * np.pi * np.array([0.7, 2.3, 4.1])
    phases = rate * t[:, None]
    shapes = np.sin(phases), rate * np.cos(phases), -(rate**2) * np.sin(phases)
    theta, v, a = (0.02 * x.sum(axis=1) for x in shapes)
    twist = theta - signal.lsim(([D, K], [link, D, K + G]), theta, t)[1]
    spring = K * twist + D * np.gradient(twist, step)
    effort = J * a + 5.0 * np.sign(v) + damping * v + spring
    begun = slice(500, None)  # where it swings already
    nominal = (link + J) * a + damping * v + G * theta
    motion = SimpleNamespace(
        velocity=v[begun, None], acceleration=a[begun, None], effort=effort[begun, None],
        nominal_effort=nominal[begun, None],
        step=step, starts=(0, 2500), bandwidth=50.0,
        tree=SimpleNamespace(damping=np.array([damping])), rotors=np.zeros(1),
        effort_slopes=lambda _j: [np.full((5500, 1), x) for x in (G, damping, link + J)],
    )  # fmt: skip
    place, shape = Place(0, 'motor'), np.array([J, 1.0 / K, D / K, 1.0])
    off = {}
    for share in (0.0, 1.0):
        shape[3] = share
        found = twist_of(motion, place, shape)[0] / K
        off[share] = np.std(found - twist[begun]) / np.std(twist[begun])
    assert off[1.0] < 0.01
    assert off[0.0] > 0.1


@pytest.mark.parametrize('encoder', ['motor', 'link'])
def test_its_share_counts_what_lies_above_the_bandwidth(encoder):
    """The force with its resonance is that of the simulated motion at the full rate.

    But for a factor, as the inertia with which the joint swings changes with the pose.
    """
    recording, found = recorded(encoder), equations(encoder)
    motion = found.motion
    truth = EffectAt.stated(LAW, 'elbow', SPRING | {'encoder': encoder}, motion.tree)
    seen = ObservedMotion(
        motion.tree, motion.time, motion.step, recording.shown_position,
        recording.shown_velocity, recording.true_acceleration, motion.effort, motion.drive,
    )  # fmt: skip
    true = (seen.nominal_effort - recording.command)[:, ELBOW]
    share = (LAW.whole(motion, EffectAt(LAW, truth.place, truth.shape, np.ones(1))) ** 2).mean()
    assert 0.25 < share / (true**2).mean() < 4.0
