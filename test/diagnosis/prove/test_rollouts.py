"""Roll-outs of diagnosed models from measured states."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.fitted_model import floors, imbalance
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.prove import rollouts
from sgp_ros.diagnosis.prove.dynamics import dynamics_of
from sgp_ros.diagnosis.prove.overlay import replays
from sgp_ros.diagnosis.prove.rollouts import cut, roll_out, work
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import Place
from test.diagnosis.fitted_models import with_coefficients
from test.diagnosis.worlds import CHAINS, PERIOD, World, acceleration, delayed, simulate

TRIM = 40
FINE = 100
"""Steps a period in which the hysteretic pendulum is integrated."""
LEVEL, PRESLIDING = 0.6, 0.05


def _model(equations, *candidates, is_free=False):
    start = np.sqrt((equations.d**2).mean(axis=0) + floors(equations))
    return fit(Columns(equations), candidates, start, is_free=is_free)


def _candidate(name, joint, *shape):
    return EffectAt(EFFECTS[name], Place(joint), np.array(shape))


def _loads(motion):
    """Return the loads of a recording without what remembers, see `DiagnosedDynamics`."""
    still = np.zeros_like(motion.effort)
    return np.column_stack([motion.effort, still, motion.time, 0.0 * motion.time])


def _errors(windows, q, ends):
    assert ends.all()
    return windows.squared(q).sum(axis=0) / windows.held.sum(axis=0)


@pytest.fixture(scope='module')
def hysteretic():
    """A pendulum whose friction is a bristle, integrated with the bristle as a state."""
    (link,), rng = CHAINS[1], np.random.default_rng(6)
    omega, phase = rng.uniform(2.0, 9.0, 4), rng.uniform(0.0, 6.0, 4)
    q, v, z = 0.0, 0.0, 0.0
    kept, commands, h = [], [], PERIOD / FINE
    for i in range(round(10.0 / PERIOD)):
        goal = float(np.sin(omega * i * PERIOD + phase).sum()) / 2.0
        u = 12.0 * (goal - q) - 1.0 * v
        commands.append((u,))
        kept.append((q, v, acceleration((link,), (q,), (v,), (u - LEVEL * z,))[0]))
        for _ in range(FINE):
            v += h * acceleration((link,), (q,), (v,), (u - LEVEL * z,))[0]
            q += h * v
            sign = math.copysign(1.0, v)
            z = sign + (z - sign) * math.exp(-abs(v) * h / PRESLIDING)
    at, speed, rise = (np.array(x)[:, None] for x in zip(*kept, strict=True))
    return World(PERIOD * np.arange(len(kept)), at, speed, rise, np.array(commands))


@pytest.mark.parametrize(
    ('name', 'shape', 'coefficient'),
    [
        ('payload', (0.4, 0.1, 0.05, -0.2), 1.0), ('gravity_tilt', (0.1, -0.2), 1.0),
        ('armature', (), 0.3), ('constant_load', (), 0.5),
    ],
)  # fmt: skip
def test_the_dynamics_are_the_equations_of_the_model(
    equations_for, perfect, name, shape, coefficient
):
    """`M a` less the drive is what the motion takes beyond efforts and effects."""
    _, equations = equations_for(perfect[2])
    candidate = _candidate(name, -1 if name == 'gravity_tilt' else 1, *shape)
    model = with_coefficients(_model(equations, candidate), np.array([coefficient]))
    motion = equations.motion
    dynamics = dynamics_of(model, equations, motion)
    M, drive = dynamics.equations(motion.position, motion.velocity, _loads(motion))
    left = np.einsum('nij,nj->ni', M, motion.acceleration) - drive
    np.testing.assert_allclose(left, imbalance(model, equations, motion), atol=1e-9)


@pytest.mark.parametrize('k', [1, 2])
def test_the_true_model_ends_where_the_robot_did(equations_for, perfect, k):
    """In all windows, to a ten-thousandth of the way."""
    _, equations = equations_for(perfect[k])
    windows = cut(equations.motion, TRIM)
    q, ends = roll_out(windows, _model(equations), equations)
    assert len(ends) > 20
    assert np.all(_errors(windows, q, ends) < 1e-4)


def test_wrong_bodies_are_rolled_out_with_what_was_found(equations_for, heavy):
    """The mass matrix of the model, not the nominal one."""
    _, equations = equations_for(heavy[2])
    windows = cut(equations.motion, TRIM)
    nominal = _errors(windows, *roll_out(windows, _model(equations), equations))
    found = _errors(windows, *roll_out(windows, _model(equations, is_free=True), equations))
    assert np.all(found < 1e-4)
    assert np.all(nominal > 100.0 * found)


def test_dry_friction_holds_and_releases_in_a_roll_out(equations_for, dry):
    """Without it the joint slides where it rested, and 0.3 s later is somewhere else."""
    _, equations = equations_for(dry)
    windows = cut(equations.motion, TRIM)
    nominal = _errors(windows, *roll_out(windows, _model(equations), equations))
    model = _model(equations, _candidate('coulomb_friction', 0))
    found = _errors(windows, *roll_out(windows, model, equations))
    assert found < 1e-3
    assert nominal > 0.1


def test_a_joint_that_friction_holds_does_not_creep(equations_for, dry):
    """Its level is the jump of the force; below it the joint stands, to the last digit."""
    _, equations = equations_for(dry)
    model = _model(equations, _candidate('coulomb_friction', 0), _candidate('viscous_friction', 0))
    motion = equations.motion
    dynamics = dynamics_of(model, equations, motion)
    level = dynamics.level_of_dry_friction(motion.position, _loads(motion))
    np.testing.assert_allclose(level, model.effects[0].coefficients[0])
    windows = cut(motion, TRIM, horizon=0.05)
    q, _ = roll_out(windows, model, equations)
    steps = np.abs(np.diff(q[:, :, 0], axis=1))
    truly = np.array([(dry.velocity[rows, 0] == 0.0).all() for rows in windows.rows])
    assert truly.sum() > 3
    assert np.all(steps[truly, -1] == 0.0)
    assert np.all(steps[~truly].max(axis=1) > 0.0)


def test_what_remembers_commands_needs_no_iteration(equations_for, monkeypatch):
    """A delay is a function of time: one round settles all windows."""
    world = simulate(CHAINS[1], 7, 10.0, motor=delayed(0.012))
    _, equations = equations_for(world)
    model = _model(equations, _candidate('command_delay', 0, 0.01))
    windows = cut(equations.motion, TRIM)
    monkeypatch.setattr(rollouts, 'MOST_ROUNDS', 1)
    assert _errors(windows, *roll_out(windows, model, equations)) < 1e-4


@pytest.mark.parametrize('of_the_file', [False, True])
def test_friction_that_creeps_answers_the_motion(
    equations_for, hysteretic, monkeypatch, of_the_file
):
    """From the bristle measured before each window, without any iteration."""
    _, equations = equations_for(hysteretic)
    model = _model(equations, _candidate('hysteresis', 0, 0.8 * PRESLIDING))
    assert model.effects[0].coefficients[0] == pytest.approx(LEVEL, rel=0.02)
    windows = cut(equations.motion, TRIM)
    nominal = _errors(windows, *roll_out(windows, _model(equations), equations))
    if of_the_file:
        stated = replace(equations.motion, stated=model.effects)
        windows, model = cut(stated, TRIM), _model(equations)
    monkeypatch.setattr(rollouts, 'MOST_ROUNDS', 1)
    found = _errors(windows, *roll_out(windows, model, equations))
    assert found < 1e-4
    assert nominal > 100.0 * found


def test_what_remembers_the_motion_is_iterated_to_a_fixed_point(
    equations_for, perfect, monkeypatch
):
    """Play, whose force follows the motion before; one round tells nothing of convergence."""
    _, equations = equations_for(perfect[1])
    start, play = (
        np.sqrt((equations.d**2).mean(axis=0)),
        _candidate('backlash', 0, 0.3, 0.02, 0.0, 0.0),
    )
    model = fit(Columns(equations), (play,), start, is_free=False, still=1)
    small = with_coefficients(model, np.ones(1))
    windows = cut(equations.motion, TRIM)
    _, ends = roll_out(windows, small, equations)
    assert ends.mean() > 0.5
    monkeypatch.setattr(rollouts, 'MOST_ROUNDS', 1)
    _, ends = roll_out(windows, small, equations)
    assert not ends.any()


def test_a_joint_at_rest_asks_for_no_small_steps(equations_for, dry):
    """Dry friction jumps where a velocity is zero; that is no rate."""
    _, equations = equations_for(dry)
    model = _model(equations, _candidate('coulomb_friction', 0))
    motion = equations.motion
    dynamics = dynamics_of(model, equations, motion)
    q = motion.position
    assert dynamics.fastest_rate(q, np.zeros_like(q), _loads(motion)) < 1.0 / PERIOD


def test_a_roll_out_that_runs_away_is_counted(equations_for, viscous):
    """Friction that drives, beyond what numbers can hold."""
    _, equations = equations_for(viscous)
    model = _model(equations, _candidate('quadratic_drag', 0))
    mad = with_coefficients(model, np.array([-1e5]))
    _, ends = roll_out(cut(equations.motion, TRIM), mad, equations)
    assert not ends.all()


def test_stiff_friction_is_integrated_in_smaller_steps(equations_for, perfect):
    """A time constant a tenth of the step: the joint creeps, it does not explode."""
    _, equations = equations_for(perfect[1])
    model = _model(equations, _candidate('viscous_friction', 0))
    inertia = float(equations.motion.mass_diagonal.mean())
    stiff = with_coefficients(model, np.array([10.0 / PERIOD * inertia]))
    windows = cut(equations.motion, TRIM)
    q, ends = roll_out(windows, stiff, equations)
    assert ends.all()
    assert np.ptp(q[:, 5:], axis=1).max() < 0.05 * np.sqrt(windows.held.max())
    assert work(windows, stiff, equations) > 4 * work(windows, model, equations)


def test_replays_of_a_stiff_model_are_the_short_ones(equations_for, perfect):
    """As many steps are taken whatever the model."""
    _, equations = equations_for(perfect[1])
    shown = {
        longest: [name for name, *_ in replays(equations.motion, TRIM, None, longest)]
        for longest in (10.0, 1.0)
    }
    assert shown == {10.0: ['open_0.5', 'open_2', 'open_whole'], 1.0: ['open_0.5']}


def test_the_long_replay_shows_where_most_moves(equations_for, perfect):
    """A recording may begin at rest, of which a simulation says nothing."""
    _, equations = equations_for(perfect[1])
    motion, half = equations.motion, len(equations.motion.time) // 2
    for calm in (slice(half), slice(half, None)):
        velocity = motion.velocity.copy()
        velocity[calm] = 0.0
        *_, (name, windows, _) = replays(replace(motion, velocity=velocity), TRIM, None, 2.0)
        assert name == 'open_whole'
        assert len(windows.first) == 1
        assert bool(windows.rows[0, -1] > half) is (calm.start is None)


def test_windows_follow_each_other_and_cross_no_pause(equations_for, perfect):
    """No sample in two windows, none near the ends of a stretch, all of the horizon's length."""
    _, equations = equations_for(perfect[1])
    motion = replace(equations.motion, starts=(0, 700))
    windows = cut(motion, TRIM)
    last = windows.rows[:, -1]
    assert np.all(windows.first[1:] >= last[:-1])
    assert np.all((last < 700 - TRIM) | (windows.first >= 700 + TRIM))
    assert windows.first[0] == TRIM
    length = windows.steps * windows.stride * motion.step
    assert length == pytest.approx(rollouts.HORIZON_S, rel=0.05)


def test_a_long_recording_is_sampled_evenly(equations_for, perfect, monkeypatch):
    """From its beginning to its end."""
    _, equations = equations_for(perfect[1])
    everything = cut(equations.motion, TRIM).first
    monkeypatch.setattr(rollouts, 'MOST_WINDOWS', 5)
    some = cut(equations.motion, TRIM).first
    assert len(some) == 5
    assert set(some) <= set(everything)
    assert (some[0], some[-1]) == (everything[0], everything[-1])
    assert np.ptp(np.diff(some)) <= everything[1] - everything[0]
