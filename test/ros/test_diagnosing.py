"""Recordings that the node keeps for a diagnosis, without a graph."""

from __future__ import annotations

import gc
import re
import time
from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.diagnosis.result import Finding
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.samples import POSITION, CommandSample, JointSample, Reset, frozen_array
from sgp_ros.recordings.messages import Status
from sgp_ros.robots.registry import load_robot
from sgp_ros.ros.diagnosing import MOST_EVENTS, Diagnosing
from sgp_ros.ros.diagnosis_outcome import DiagnosisFailed, with_sentences
from sgp_ros.ros.verdict import OK, WARN
from test.report.diagnoses import COULOMB, SPRING, UNKNOWN, diagnosis


def _diagnosing(window_s: float, robot: str = 'reaction_wheel') -> Diagnosing:
    return Diagnosing(load_robot(robot), robot, window_s)


def _state(stamp_ns: int) -> JointSample:
    return JointSample(stamp_ns, ('pole', 'wheel'), frozen_array([0.0, 0.0]))


def test_the_memory_of_events_ends_at_the_window() -> None:
    """By stamps, not by the clock: what is older than the newest by more is gone."""
    kept = _diagnosing(1.0)
    for i in range(500):
        kept.take(_state(i * 10**7))
    kept.take(Reset(10**18))
    stamps = [event.stamp_ns for event in kept.events]
    assert (stamps[0], stamps[-1], len(stamps)) == (399 * 10**7, 499 * 10**7, 101)


def test_the_memory_of_events_is_bounded_where_stamps_stand_still() -> None:
    kept = _diagnosing(3600.0)
    state = _state(0)
    for _ in range(MOST_EVENTS + 10):
        kept.take(state)
    assert len(kept.events) == MOST_EVENTS


def test_a_wrong_stamp_costs_no_more_than_a_pause() -> None:
    """And a clock that is set back costs nothing of what was before."""
    kept = _diagnosing(60.0)
    for stamp_ns in (*range(0, 10**9, 10**7), 10**18, *range(10**9, 2 * 10**9, 10**7), 0, 10**7):
        kept.take(_state(stamp_ns))
    assert len(kept.events) == 203


def test_what_is_remembered_comes_back() -> None:
    kept = _diagnosing(1.0)
    velocity, effort = frozen_array([1.0, 2.0]), frozen_array([3.0])
    state = JointSample(5, ('pole', 'wheel'), velocity, velocity, None)
    target = CommandSample(7, effort, ('wheel',), POSITION, velocity)
    for event in (CommandSample(5, effort, ('wheel',)), state, CommandSample(6, effort), target):
        kept.take(event)
    first, second, third, fourth = kept.events
    assert isinstance(fourth, CommandSample)
    assert (fourth.kind, fourth.velocity) == (POSITION, velocity)
    assert isinstance(first, CommandSample)
    assert isinstance(second, JointSample)
    assert isinstance(third, CommandSample)
    assert (first.stamp_ns, first.names, first.effort) == (5, ('wheel',), effort)
    assert (second.stamp_ns, second.names) == (5, ('pole', 'wheel'))
    assert second.position is second.velocity is velocity
    assert second.effort is None
    assert (third.stamp_ns, third.names) == (6, None)


@pytest.mark.long
def test_the_garbage_collector_does_not_search_what_is_remembered() -> None:
    """A minute at a kilohertz is so much that a search holds up messages for 50 ms."""
    kept = _diagnosing(3600.0)
    gc.collect()
    before = len(gc.get_objects())
    for i in range(1000):
        kept.take(_state(i))
        kept.take(CommandSample(i, frozen_array([0.0]), ('wheel',)))
    gc.collect()
    gc.collect()
    assert len(gc.get_objects()) - before < 100


def test_a_robot_without_nominal_bodies_is_refused_with_the_reason() -> None:
    robot = load_robot('simple_pendulum')
    bodies = replace(robot.bodies, values=dict.fromkeys(robot.bodies.values))
    unknown = Diagnosing(replace(robot, bodies=bodies), 'simple_pendulum', 1.0)
    started, message = unknown.start(EngineConfig())
    assert not started
    assert 'simple_pendulum has no nominal values of J' in message


def test_a_robot_that_never_moved_is_refused_with_the_reason() -> None:
    """The service answers so at once; no process is started to find that out."""
    kept = _diagnosing(60.0)
    rng = np.random.default_rng(0)
    for i in range(500):
        shown = frozen_array(1e-4 * np.round(rng.normal(size=2)))
        kept.take(JointSample(i * 10**7, ('pole', 'wheel'), shown))
    started, message = kept.start(EngineConfig())
    assert not started
    assert 'no joint of reaction_wheel moves' in message
    assert kept.statuses('node') == []


def _statuses(kept: Diagnosing, verdict: str, *findings: Finding) -> list[Status]:
    kept._outcome, kept._ended_s = with_sentences(diagnosis(verdict, findings)), time.monotonic()
    return kept.statuses('left/node')


def test_a_verdict_warns_with_number_joint_and_remedy() -> None:
    """In the sentences of the report, with the joint at the end of the name of each finding."""
    head, first, again, other = _statuses(
        _diagnosing(60.0), 'missing_physics', COULOMB, COULOMB, SPRING
    )
    assert [s.level for s in (head, first, again, other)] == [WARN] * 4
    assert head.name == 'left/node: diagnosis'
    assert first.name == 'left/node: diagnosis coulomb_friction elbow'
    assert again.name == 'left/node: diagnosis coulomb_friction 2 elbow'
    assert other.name == 'left/node: diagnosis spring shoulder'
    for status in (head, first):
        assert 'on elbow: Coulomb friction, level 0.317' in status.message
        assert 'sgp diagnose RECORD' in status.message
    assert (first.values['level'], first.values['level.unit']) == ('0.317', 'N m')


@pytest.mark.parametrize('verdict', ['parameters_only', 'unexplained', 'setup_error'])
def test_every_verdict_but_no_mismatch_asks_for_something(verdict: str) -> None:
    findings = [UNKNOWN] if verdict == 'unexplained' else []
    head, *_ = _statuses(_diagnosing(60.0), verdict, *findings)
    assert head.level == WARN
    assert head.values['verdict'] == verdict
    assert re.search('[Cc]orrect |Record a longer', head.message)


def test_a_robot_without_mismatch_is_fine() -> None:
    (head,) = _statuses(_diagnosing(60.0), 'no_mismatch')
    assert head.level == OK
    assert head.message.startswith('No mismatch: ')


def test_a_certainty_that_is_not_stated_is_no_number() -> None:
    kept = _diagnosing(60.0)
    found = replace(diagnosis('unexplained', [UNKNOWN]), certainty=None)
    kept._outcome, kept._ended_s = with_sentences(found), time.monotonic()
    assert kept.statuses('node')[0].values['certainty'] == 'not stated'


@pytest.mark.parametrize('is_failed', [True, False])
def test_an_outcome_is_information_once_its_window_is_past(*, is_failed: bool) -> None:
    """Its past is over then; its words stay."""
    kept = _diagnosing(60.0)
    before = _statuses(kept, 'missing_physics', COULOMB)
    if is_failed:
        kept._outcome = DiagnosisFailed('it ended with code -9')
        before = kept.statuses('left/node')
        assert 'call ~/diagnose again' in before[0].message
    assert all(status.level for status in before)
    kept._ended_s -= 61.0
    after = kept.statuses('left/node')
    assert [status.level for status in after] == [OK] * len(before)
    assert [status.message for status in after] == [status.message for status in before]
