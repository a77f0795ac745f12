"""Numbers of a recording that contradict the robot or each other, in one line each."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.batch.contradictions import (
    require_shared_motion,
    require_units,
    target_contradictions,
)
from sgp_ros.batch.recording_check import check_recording
from sgp_ros.engine.samples import POSITION, CommandSample, JointSample, frozen_array
from sgp_ros.errors import RecordingError
from sgp_ros.physics.term import Joint
from sgp_ros.robots.gains import Gains
from sgp_ros.robots.robot import Robot

T = np.arange(800) * 0.01
NAMES = ('lift', 'elbow')
ROBOT = Robot(
    'arm', tuple(Joint(n, lower=-2.0, upper=2.0, effort_limit=20.0) for n in NAMES), 'effort',
    (), ((), ()),
)  # fmt: skip
Q = np.column_stack([np.sin(3.0 * T), 0.7 * np.cos(5.0 * T)])
LATE = np.column_stack([np.sin(3.0 * T + 0.1), 0.7 * np.cos(5.0 * T + 0.1)])
DEGREES = 180.0 / np.pi


def _events(q, *, velocity=None, effort=None, target=None):
    found = []
    for i, t in enumerate(T):
        stamp = 10**9 + round(t * 1e9)
        if target is not None:
            found.append(CommandSample(stamp, frozen_array(target[i]), NAMES, POSITION))
        v, u = (None if x is None else frozen_array(x[i]) for x in (velocity, effort))
        found.append(JointSample(stamp, NAMES, frozen_array(q[i]), v, u))
    return found


def _remarks(**channels):
    return ' '.join(check_recording(_events(**channels), ROBOT).remarks)


def test_units_that_limits_contradict_are_named():
    """Degrees for radians, kgf cm and N mm for N m, deg/s beside rad."""
    rate = np.gradient(Q, T, axis=0)
    plain = _remarks(q=Q, velocity=rate, effort=10.0 * Q)
    assert 'fits' not in plain
    assert 'slope' not in plain
    said = _remarks(q=Q * DEGREES)
    assert 'positions of lift go from -57.3 to 57.3, but its limits are -2 to 2 rad' in said
    assert 'they would fit in degrees' in said
    assert (
        'effort of elbow reaches 143, but its limit is 20 N m: it would fit in kgf cm'
        in _remarks(q=Q, effort=204.0 * np.cos(T)[:, None] * [0.1, 0.7])
    )
    assert 'it would fit in N mm' in _remarks(q=Q, effort=1e4 * Q)
    said = _remarks(q=Q, velocity=rate * DEGREES)
    assert 'lift is 57.3 times the slope of its position: one of the two is in deg' in said
    assert 'is 2 times the slope of its position.' in _remarks(q=Q, velocity=2.0 * rate)
    shaken = Q + np.random.default_rng(0).normal(0.0, 5e-3, Q.shape)
    assert 'slope' not in _remarks(q=shaken, velocity=rate)


def test_positions_that_span_what_no_joint_does_are_named():
    """Also where no limits are known: counts of an encoder."""
    robot = Robot('arm', tuple(map(Joint, NAMES)), 'effort', (), ((), ()))
    for scale, said in ((1e4, False), (1e6, True), (1e29, True)):
        remarks = ' '.join(check_recording(_events(scale * Q), robot).remarks)
        assert ('rad: counts or degrees?' in remarks) is said


def test_a_table_with_a_wrong_unit_is_refused():
    require_units(_events(1.9 * Q), ROBOT)
    with pytest.raises(RecordingError, match='expected the units stated'):
        require_units(_events(Q * DEGREES), ROBOT)


def test_a_target_that_another_joint_follows_is_refused():
    assert target_contradictions(_events(Q, target=LATE), ROBOT, None) == ([], [])
    found = check_recording(_events(Q, target=LATE[:, ::-1]), ROBOT)
    assert found.refusals == (
        'the target of lift is followed by elbow and not by lift',
        'the target of elbow is followed by lift and not by elbow',
    )
    found = check_recording(_events(Q, target=LATE * DEGREES), ROBOT)
    assert found.refusals[0] == 'the target of lift is in degrees, its position is not'


def test_a_target_that_is_never_reached_is_said_with_its_reason():
    """Saturation where the gains ask for more than the motor has; else what else it may be."""
    gains = Gains(np.array([100.0, 100.0]), np.ones(2))
    far = check_recording(_events(Q, target=LATE + np.array([2.2, 0.0])), ROBOT, gains)
    assert not far.refusals
    (said,) = [r for r in far.remarks if 'target' in r]
    assert said.startswith('lift stays at least 2.')
    assert 'its gains would need 219 N m, the limit is 20 N m: the drive saturates' in said
    short = check_recording(_events(0.3 * Q, target=LATE), ROBOT)
    assert any('lift moves 0.6 of the 2 rad that its target spans' in r
               for r in short.remarks)  # fmt: skip
    weak = Gains(np.array([10.0, 10.0]), np.ones(2))
    said, _ = target_contradictions(_events(Q, target=LATE + np.array([0.3, 0.0])), ROBOT, weak)
    assert len(said) == 1
    assert 'a load of 2.93 N m that the gains cannot hold, or a wrong zero' in said[0]


def test_machine_and_simulation_must_overlap():
    ours = [{'lift': (0.0, 1.0)}, {'elbow': (2.0, 3.0)}]
    assert require_shared_motion(ours, {'lift': (0.5, 2.0), 'elbow': (2.0, 4.0)}) == []
    (said,) = require_shared_motion(ours, {'lift': (0.5, 2.0), 'elbow': (4.0, 5.0)})
    assert 'different positions: elbow 2 to 3, in the simulation 4 to 5' in said
    (said,) = require_shared_motion(ours, {'lift': (0.5, 2.0)})
    assert said == 'Moving only on the machine or only in the simulation: elbow.'
    with pytest.raises(RecordingError, match='no joint reaches the same positions'):
        require_shared_motion(ours[:1], {'lift': (1.5, 2.0)})
    with pytest.raises(RecordingError, match='machine moves lift, the simulation elbow'):
        require_shared_motion(ours[:1], {'elbow': (0.0, 1.0)})
