"""Numbers of errors of the connection, beside the physics that is named."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sgp_ros.diagnosis import refining
from sgp_ros.diagnosis.compare.bandwidth import choose_bandwidth
from sgp_ros.diagnosis.compare.equations import make_equations
from sgp_ros.diagnosis.compare.trajectory import observe
from sgp_ros.diagnosis.connected import Connected
from sgp_ros.diagnosis.decide.differences import Several
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.fitted_model import first_scale
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.gathered import Recordings
from sgp_ros.diagnosis.refining import refined
from sgp_ros.diagnosis.setup.connection import Connection, Tried
from sgp_ros.diagnosis.setup.correction import Correction
from sgp_ros.diagnosis.setup.errors import hypotheses
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import Place
from test.diagnosis.worlds import CHAINS, heavier, simulate

SCALE = 1.06
NEUTRAL = Correction.none(2)
FRICTION = tuple(EffectAt(EFFECTS['viscous_friction'], Place(j)) for j in (0, 1))


@pytest.fixture(scope='module')
def recorded(equations_for):
    """A chain with friction and a heavier link, whose second encoder shows too much."""
    world = simulate(heavier(CHAINS[2], 1, 1.1), 5, 10.0, force=_oil)
    return equations_for(replace(world, position=world.position * np.array([1.0, SCALE])))


def _oil(_t, _q, v):
    return -0.2 * v[0], -0.1 * v[1]


def _connected(raw, tree, correction=NEUTRAL):
    """Return a recording, corrected, with its friction and bodies fitted."""
    recordings = Recordings(('one',), raw, {}, {}, (), ())
    learned, robot = recordings.corrected(correction).learned, correction.tree(tree)
    equations = make_equations(learned, robot, choose_bandwidth(learned, robot))
    model = fit(Columns(equations), FRICTION, first_scale(equations), is_free=True)
    decision = SimpleNamespace(model=model)
    return Connected(recordings, equations, Several(equations, None, decision, model, {}))


def _seen(motion):
    names = ('effort', 'stated_force', 'nominal_effort')
    return {name: getattr(motion, name) for name in names}


def _tried(motion, number, std, effect='position_scale'):
    (one,) = [h for h in hypotheses(motion) if h.effect == effect and h.joint == 'joint1']
    numbers = np.array([number])
    return Tried(one, numbers, np.array([std]), one.applied(NEUTRAL, numbers), None)


def _of(error):
    return Connection((error,), ((),), None, None)


@pytest.mark.parametrize(
    ('number', 'has_moved'), [(SCALE - 0.02, True), (SCALE + 0.015, True), (SCALE, False)]
)
def test_a_number_is_estimated_beside_friction_and_bodies(recorded, robots, number, has_moved):
    """A right one stays, with the standard deviation that all rows give it."""
    raw, tree = recorded[0], robots[2][1]
    plain = _connected(raw, tree)
    error = _tried(plain.equations.motion, number, 0.02)
    found, moved = refined(_of(error), plain, _connected(raw, tree, error.correction), tree)
    (better,) = found.errors
    assert moved is has_moved
    assert better.numbers[0] == pytest.approx(SCALE, abs=3.0 * better.std[0] + 1e-3)
    assert better.std[0] < 0.002
    assert better.correction.scale[1] == better.numbers[0]
    assert has_moved or better.numbers[0] == number


def test_a_number_that_all_rows_tell_no_better_stays(recorded, robots):
    raw, tree = recorded[0], robots[2][1]
    plain = _connected(raw, tree)
    found = _of(_tried(plain.equations.motion, 1.04, 1e-7))
    assert refined(found, plain, plain, tree) == (found, False)


def test_numbers_of_efforts_gains_and_units_stay():
    """Least squares would make efforts small; a unit is exact."""

    def error(effect, number, names=('scale',), exact=()):
        hypothesis = SimpleNamespace(effect=effect, exact=exact, is_of_gains='kp' in names)
        return SimpleNamespace(hypothesis=hypothesis, numbers=np.array(number))

    assert refining._is_open(error('position_scale', [1.02], exact=(57.3,)))
    assert not refining._is_open(error('position_scale', [57.3], exact=(57.3,)))
    assert not refining._is_open(error('effort_scale', [1.02]))
    assert not refining._is_open(error('gain_scale', [1.0, 2.0], ('kp', 'kd')))
    assert not refining._is_open(error('joint_sign', []))


def test_a_slope_is_that_of_what_a_corrected_recording_lacks(recorded, robots):
    raw, tree = recorded[0], robots[2][1]
    plain = _connected(raw, tree)
    error = _tried(plain.equations.motion, 1.04, 0.02)
    undone = _connected(raw, tree, error.correction).equations
    (slope,) = refining._slopes(_of(error), plain, undone, tree).T
    lacks = []
    for scale in (1.04, 1.041):
        correction = replace(NEUTRAL, scale=np.array([1.0, scale]))
        motion = observe(correction.recording(raw), tree, choose_bandwidth(raw, tree))
        lacks.append(motion.effort - motion.nominal_effort)
    assert (slope.T - (lacks[1] - lacks[0]) / 1e-3).std() < 0.01 * slope.std()
    still = SimpleNamespace(
        filter=undone.filter,
        motion=SimpleNamespace(**_seen(undone.motion), moves=np.array([False, True])),
    )
    (moving,) = refining._slopes(_of(error), plain, still, tree).T
    assert not moving[0].any()
    assert (moving[1] == slope[1]).all()
