"""Wear is told from warm-up, a change from chance, and unknowns are reported."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import special

from sgp_proof.campaign.wear import LEVEL, World, draw_results
from sgp_ros.campaign import changes
from sgp_ros.campaign.changes import chance
from sgp_ros.campaign.frame import PAUSE_S, frame_of
from sgp_ros.campaign.trends import PER_DAY, WARM_UP, find_trends

RESULT = Path(__file__).parents[2] / 'sgp_proof' / 'results' / 'campaign.json'
SMALL = World(recordings=80, per_day=(2, 4))
DAY_NS = 86400 * 10**9


def _only(results, joint='elbow', name='coulomb'):
    """Leave one quantity in results, so that a test fits one."""
    for result in results:
        rows = result['tasks']['identify']['rows']
        rows[:] = [row for row in rows if row['parameter'] == f'{joint}.{name}']
    return results


def _terms(trend):
    return {term.name: term for term in trend.terms}


def test_a_step_under_twice_as_much_warm_up_is_found_where_it_is():
    trends = find_trends(draw_results(SMALL, 4, begin=50))
    changed = [trend for trend in trends if trend.changes]
    (trend,) = changed
    assert trend.key == ('identify', 'elbow', '', 'elbow.coulomb')
    (change,) = trend.changes
    assert change.first <= '0050.mcap' <= change.last
    assert change.low < 0.1 * LEVEL < change.high
    warm_up = _terms(trend)[WARM_UP]
    assert warm_up.low < 0.2 * LEVEL < warm_up.high
    assert json.dumps(trend.content(), allow_nan=False)


def test_a_friction_that_grows_all_the_time_drifts():
    world = replace(SMALL, growth=0.3, ramp=SMALL.recordings)
    results = _only(draw_results(world, 0, begin=0))
    (trend,) = find_trends(results)
    assert trend.is_drift
    assert not trend.changes
    days = (results[-1]['start_ns'] - results[0]['start_ns']) / DAY_NS
    slope = _terms(trend)[PER_DAY]
    assert slope.low < 0.3 * LEVEL / days < slope.high
    assert slope.low > 0.0


def test_a_given_temperature_and_a_robot_take_their_share():
    """The covariate has its coefficient, and robots differ without being a change."""
    results = _only(draw_results(replace(SMALL, warm_up=0.0), 1))
    rng = np.random.default_rng(0)
    for i, result in enumerate(results):
        temperature = float(rng.uniform(10.0, 30.0))
        result['covariates'] = {'temperature': temperature, 'always': 1.0}
        result['robot'] = ('left', 'right')[i % 2]
        row = result['tasks']['identify']['rows'][0]
        row['value'] += -0.005 * temperature + 0.2 * (i % 2)
    (trend,) = find_trends(results)
    assert not trend.changes
    term = _terms(trend)['temperature']
    assert term.low < -0.005 < term.high < 0.0
    assert trend.scatter['robots'] > 0.03
    assert any('always is constant' in said for said in trend.remarks)


def test_recordings_without_time_have_no_trend_in_time():
    results = _only(draw_results(SMALL, 2))
    for result in results:
        result['start_ns'] = 0
    (trend,) = find_trends(results)
    assert set(_terms(trend)) == {'level'}
    assert any('column `time`' in said for said in trend.remarks)


def test_one_stray_estimate_is_no_change():
    results = _only(draw_results(SMALL, 4))
    results[60]['tasks']['identify']['rows'][0]['value'] *= 3.0
    (trend,) = find_trends(results)
    assert not trend.changes


def test_copies_of_one_recording_have_neither_trend_nor_change():
    results = _only(draw_results(SMALL, 4))[:20]
    for result in results:
        result['tasks'] = results[0]['tasks']
    (trend,) = find_trends(results)
    assert not trend.changes
    assert not trend.is_drift
    assert json.dumps(trend.content(), allow_nan=False)


def test_what_only_large_values_assert_has_no_trend():
    """Of effects that a diagnosis finds now and then, those found are no fair sample."""
    results = _only(draw_results(SMALL, 5))
    finding = {'kind': 'finding', 'joint': 'elbow', 'effect': 'torque_gain', 'parameter': 'gain',
               'value': 0.9, 'std': 0.01, 'unit': '1'}  # fmt: skip
    for i, result in enumerate(results):
        result['tasks']['diagnose'] = {'rows': [finding] if i % 2 else []}
    assert [trend.key[0] for trend in find_trends(results)] == ['identify']
    for result in results:
        result['tasks']['diagnose'] = {'rows': [finding]}
    assert [trend.key[0] for trend in find_trends(results)] == ['diagnose', 'identify']


def test_sessions_are_what_lies_between_pauses():
    pause = round(1.1e9 * PAUSE_S)
    starts = [0, 10**12, 10**12 + pause, 2 * 10**12 + pause]
    results = [
        {'recording': str(i), 'robot': 'arm', 'session': None, 'start_ns': start,
         'duration_s': 100.0, 'tasks': {}}
        for i, start in enumerate(starts)
    ]  # fmt: skip
    frame = frame_of(results)
    assert frame.sessions.tolist() == [0, 0, 2, 2]
    assert frame.age.tolist() == [50.0, 1050.0, 50.0, 1050.0]
    one = frame_of([result | {'session': 'one'} for result in results])
    assert one.sessions.tolist() == [0, 0, 0, 0]


def test_the_bound_on_false_alarms_is_the_measured_one():
    """The tests that all looks are worth are not fewer than the simulation found."""
    alarms = json.loads(RESULT.read_text(encoding='utf-8'))['alarms']
    assert (alarms['horizon'], alarms['least_side']) == (changes.HORIZON, changes.LEAST_SIDE)
    measured = max(found['tests'] for found in alarms['levels'].values())
    assert measured <= changes.EQUIVALENT_TESTS <= 1.1 * measured


def test_chance_counts_all_that_is_looked_at():
    """At its bound a normal statistic is what the simulation says; more of anything is more."""
    z = -special.ndtri(changes.FALSE_ALARMS / (2.0 * changes.EQUIVALENT_TESTS))
    assert chance(z, 10**9, 50, 1) == pytest.approx(changes.FALSE_ALARMS, rel=1e-3)
    assert chance(-z, 10**9, 2 * changes.HORIZON, 7) == pytest.approx(14 * 0.01, rel=1e-3)
    assert chance(z, 20, 50, 1) > 0.1
    assert chance(0.0, 20, 50, 1) == 1.0
