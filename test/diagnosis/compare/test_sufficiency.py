"""Too little to decide anything: encoders at rest, few rows."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sgp_ros.diagnosis.compare.sufficiency import motion_to_noise, require_signed, still_joints
from sgp_ros.diagnosis.compare.trajectory import collect
from sgp_ros.diagnosis.criteria import LEAST_MOTION, LEAST_ROWS
from sgp_ros.diagnosis.gathered import Knowledge, setup_remarks
from sgp_ros.diagnosis.pipeline import diagnose
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.samples import JointSample, frozen_array
from sgp_ros.errors import RecordingError
from test.diagnosis.worlds import CHAINS, PERIOD, World, events_of, simulate

RESULTS = Path(__file__).parents[3] / 'sgp_proof' / 'results' / 'diagnosis_guards.json'
ROWS = 2400
COARSE = 0.02
"""Counts of a coarse encoder [rad]."""


def _at_rest(k, shown, effort):
    """Return a world whose robot hangs while its encoders show (n, k)."""
    still = np.zeros((len(shown), k))
    command = np.full((len(shown), k), effort) + 0.01 * np.random.default_rng(1).normal(
        size=(len(shown), k)
    )
    return World(PERIOD * np.arange(len(shown)), shown, still, still, command)


ENCODERS = {
    'nothing': lambda rng: np.zeros((ROWS, 1)),
    'fine noise': lambda rng: rng.normal(0.0, 1e-6, (ROWS, 1)),
    'coarse noise': lambda rng: rng.normal(0.0, 1e-3, (ROWS, 1)),
    'flicker': lambda rng: 1e-4 * (np.cumsum(rng.random((ROWS, 1)) < 0.05, axis=0) % 2),
    'noise of some counts': lambda rng: 1e-4 * np.round(rng.normal(0.0, 2.0, (ROWS, 1))),
}


@pytest.mark.parametrize('effort', [0.0, 0.5])
@pytest.mark.parametrize('kind', ENCODERS)
def test_nothing_is_said_of_a_robot_that_never_moved(robots, kind, effort):
    """No matter what its encoders show, and whether or not it is pushed against a stop."""
    world = _at_rest(1, ENCODERS[kind](np.random.default_rng(0)), effort)
    with pytest.raises(RecordingError, match='no joint of chain moves'):
        diagnose(events_of(world, quantum=0), *robots[1], {})


@pytest.mark.parametrize('seconds', [0.9, 1.5, 2.5])
def test_nothing_is_said_of_a_recording_of_few_rows(robots, seconds):
    """None are left where a coarse encoder asks for long filters."""
    world = simulate(CHAINS[1], 11, seconds, dry=lambda t, q, s: 0.4)
    with pytest.raises(RecordingError, match='independent rows') as refused:
        diagnose(events_of(world, quantum=COARSE), *robots[1], {})
    assert 'use a longer recording' in str(refused.value)


def test_a_held_out_recording_of_no_rows_is_refused_by_its_name(robots, perfect):
    short = events_of(simulate(CHAINS[1], 12, 0.5))
    with pytest.raises(RecordingError, match='brief'):
        diagnose(events_of(perfect[1], quantum=COARSE), *robots[1], {'brief': short})


def test_the_noise_of_a_still_joint_explains_nothing(robots):
    """Beside one that moves it is reported, and no effect, body or doubt is found at it."""
    world = simulate(CHAINS[2], 11, 6.0, held=(1,))
    noise = np.random.default_rng(0).normal(0.0, 1e-4, len(world.time))
    shown = np.column_stack([world.position[:, 0], noise])
    found = diagnose(events_of(replace(world, position=shown)), *robots[2], {})
    assert 'Joints that do not move cannot be diagnosed: joint1.' in found.remarks
    assert 'joint1' not in {f.joint for f in (*found.findings, *found.alternatives)}


@pytest.mark.parametrize('level', [0.0, pytest.param(0.6, marks=pytest.mark.long)])
def test_a_joint_whose_efforts_are_noise_takes_nothing_from_the_others(robots, level):
    """Noise of three times its effort: no law, body or torque constant makes that small.

    A gain that divides the measured efforts makes their noise small too, in other units.
    """
    world = simulate(CHAINS[2], 11, force=lambda t, q, v: (-level * np.tanh(v[0] / 1e-2), 0.0))
    acts = world.command.copy()
    acts[1:] = 0.5 * (acts[1:] + acts[:-1])
    noise = np.random.default_rng(0).standard_normal(len(acts))
    acts[:, 1] += 3.0 * np.sqrt((acts[:, 1] ** 2).mean()) * noise
    found = diagnose(events_of(world, effort=acts, commands=False), *robots[2], {})
    if level:
        (friction,) = found.findings
        assert (friction.joint, friction.effect) == ('joint0', 'coulomb_friction')
        assert friction.parameters['level'].value == pytest.approx(level, rel=0.01)
    else:
        assert found.verdict == 'no_mismatch'


@pytest.mark.long
def test_a_model_worse_than_a_constant_certifies_nothing(robots):
    """A robot that swings without effort: no effort varies that a model could explain."""
    world = simulate(CHAINS[1], 11, 6.0)
    lazy = replace(world, command=np.zeros_like(world.command))
    found = diagnose(events_of(lazy), *robots[1], {})
    assert found.certainty is None
    assert all(f.probability < 0.5 for f in found.findings)
    assert any('joint0' in remark and 'constant' in remark for remark in found.remarks)


def test_a_joint_not_seen_is_not_still():
    """It is not known to rest; joints are looked up by name in each state."""
    swing = np.sin(0.1 * np.arange(200))
    events = [
        JointSample(i, ('rests', 'moves')[:: 1 - 2 * (i // 2 % 2)],
                    frozen_array([1e-4 * (i % 2), x][:: 1 - 2 * (i // 2 % 2)]))
        for i, x in enumerate(swing)
    ]  # fmt: skip
    assert still_joints(events, ('rests', 'moves', 'unseen')) == ('rests',)


@pytest.fixture(scope='module')
def guards():
    return json.loads(RESULTS.read_text(encoding='utf-8'))


def test_no_encoder_at_rest_reaches_what_every_drawn_motion_has(guards):
    """Not even noise of heavy tails over 200 000 rows; and far less than drawn worlds move."""
    assert 1.3 * max(guards['at_rest'].values()) < LEAST_MOTION
    assert min(world['motion'] for world in guards['worlds']) > 10.0 * LEAST_MOTION


def test_verdicts_on_enough_rows_are_right(guards):
    """On fewer many are wrong. Worlds that are wrong at full length do not count here."""
    whole = {w['seed'] for w in guards['worlds'] if w['seconds'] > 30.0 and w['verdict_is_right']}
    judged = [w for w in guards['worlds'] if w['seed'] in whole and 'rows' in w]
    few = [w['verdict_is_right'] for w in judged if w['rows'] < LEAST_ROWS]
    enough = [w['verdict_is_right'] for w in judged if w['rows'] >= LEAST_ROWS]
    assert np.mean(few) < 0.7
    assert np.mean(enough) > 0.95


@pytest.mark.parametrize('rows', [3, 15, 64, 1000])
def test_the_measure_of_motion_has_no_unit(rows):
    """Radians or counts, wherever the zero is."""
    q = np.random.default_rng(rows).normal(size=rows).cumsum()
    assert motion_to_noise(1e-3 * q + 7.0) == pytest.approx(motion_to_noise(q), rel=1e-6)
    assert motion_to_noise(np.full(rows, 0.1)) == 0.0


def test_efforts_without_their_sign_are_refused_and_a_positive_load_is_not(robots):
    """A fold comes down to zero at each reversal; a load that is always positive does not."""
    robot, tree = robots[1]
    world = simulate(CHAINS[1], 11, 3.0)
    folded = events_of(world, effort=np.abs(world.command), commands=False)
    with pytest.raises(RecordingError, match='the effort of joint0 is never negative'):
        diagnose(folded, robot, tree, {})
    lifted = world.command - world.command.min() + 1.0
    raw = collect(events_of(world, effort=lifted, commands=False), robot)
    require_signed(raw, tree.moving_names)
    lowered = world.command**2 / np.mean(world.command**2) + 0.05
    raw = collect(events_of(world, effort=lowered, commands=False), robot)
    require_signed(raw, tree.moving_names)


@pytest.mark.parametrize('jump', [0.001, 0.02, 0.1])
def test_no_connection_is_searched_where_the_filters_leave_too_few_rows(robots, jump):
    """A short recording in which one position jumps: its noise puts the cut-off low."""
    robot, tree = robots[1]
    world = simulate(CHAINS[1], 1, 0.8)
    world.position[40] += jump
    known = Knowledge(robot, (), EngineConfig())
    assert setup_remarks(events_of(world), tree, known) == ()


@pytest.mark.parametrize(('noise', 'is_certain'), [(0.5, True), (4.0, False)])
def test_nothing_is_certain_where_friction_would_not_show(robots, noise, is_certain):
    """Noise of several times the effort hides a friction that a robot may not lack in silence."""
    world = simulate(CHAINS[1], 11, 4.0)
    size = noise * np.sqrt((world.command**2).mean())
    acts = world.command + size * np.random.default_rng(0).standard_normal(world.command.shape)
    found = diagnose(events_of(world, effort=acts, commands=False), *robots[1], {})
    assert found.verdict == 'no_mismatch'
    assert (found.certainty is not None) == is_certain
    assert any('would not show' in remark for remark in found.remarks) != is_certain
