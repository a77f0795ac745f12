"""Laws of the machines of tier C and of their scores."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sgp_proof.concealed import blemishes, dirty, machines, production, several
from sgp_ros.engine.samples import JointSample
from sgp_ros.recordings.reader import open_recording


@pytest.fixture(scope='module')
def drawn(tmp_path_factory):
    """A machine of two joints at most, with short recordings, drawn twice."""
    folders = [tmp_path_factory.mktemp('machine') for _ in range(2)]
    for folder in folders:
        dirty.draw_case(1, folder, seconds=2.0, largest_joints=2)
    return folders


def _answer(*effects, wanted='hidden', verdict='missing_physics', errors=()):
    entries = [
        {'effect': names[0][0], 'joint': joint, 'names': names, 'is_asked': is_asked,
         'parameters': {}, 'scored': []}
        for joint, names, is_asked in effects
    ]  # fmt: skip
    return {'wanted': wanted, 'verdicts': [verdict], 'effects': entries, 'joints': ['a', 'b'],
            'parameter_errors': list(errors), 'joint_range': {}}  # fmt: skip


def _diagnosis(*findings, verdict='missing_physics'):
    return {
        'verdict': verdict, 'certainty': 0.9,
        'findings': [
            {'effect': e, 'joint': j, 'probability': p, 'parameters': {}} for e, j, p in findings
        ],
    }  # fmt: skip


DRY = ('a', [['asymmetric_coulomb'], ['coulomb_friction', 'constant_load']], True)
ROTOR = ('b', [['armature']], False)


@pytest.mark.long
def test_a_machine_is_a_function_of_its_seed(drawn):
    """Its robot, what it conceals, and its recordings."""
    texts = [(f / 'answers/case_001.json').read_text(encoding='utf-8') for f in drawn]
    assert texts[0] == texts[1]
    states = [_states(f / 'cases/case_001/real.mcap') for f in drawn]
    assert len(states[0]) == len(states[1])
    for one, other in zip(*states, strict=True):
        assert one.stamp_ns == other.stamp_ns
        np.testing.assert_array_equal(one.position, other.position)
        np.testing.assert_array_equal(one.effort, other.effort)


def _states(path):
    events = open_recording(str(path)).events(None, None)
    return [event for event in events if isinstance(event, JointSample)]


def test_what_is_asked_for_is_at_least_the_share_that_counts(drawn):
    """An effect that nothing else explains less of need not be named."""
    answer = json.loads((drawn[0] / 'answers/case_001.json').read_text(encoding='utf-8'))
    assert answer['effects']
    for effect in answer['effects']:
        assert effect['unique'] <= effect['share'] * (1.0 + 1e-9)
        assert effect['is_asked'] == (effect['unique'] >= 0.004)


def test_equivalent_names_are_right_and_what_is_not_asked_for_may_be_asserted():
    answer = _answer(DRY, ROTOR)
    found = [('coulomb_friction', 'a', 0.9), ('constant_load', 'a', 0.8), ('armature', 'b', 0.9)]
    assert several.score(answer, _diagnosis(*found))['right']
    assert several.score(answer, _diagnosis(*found[:2]))['right']
    assert several.score(answer, _diagnosis(found[0]))['missed'] == [['asymmetric_coulomb', 'a']]


@pytest.mark.parametrize(('load', 'is_right'), [(-0.3, True), (-0.7, False)])
def test_a_load_beside_dry_friction_is_friction_that_differs_with_direction(load, is_right):
    """As long as it is not the larger of the two: no direction drives."""
    sizes = {'coulomb_friction': {'level': 0.5}, 'constant_load': {'force': load}}
    answer = _answer(*(('a', [[name]], True) for name in sizes))
    for entry in answer['effects']:
        entry['parameters'] = sizes[entry['effect']]
    row = several.score(answer, _diagnosis(('asymmetric_coulomb', 'a', 0.9)))
    assert row['right'] == is_right


@pytest.mark.parametrize(('probability', 'count'), [(0.5, 0), (0.51, 1)])
def test_a_wrong_law_counts_once_it_is_asserted(probability, count):
    """At one half or less it is none, as the schema has it."""
    found = ('asymmetric_coulomb', 'a', 0.9), ('armature', 'a', probability)
    row = several.score(_answer(DRY, ROTOR), _diagnosis(*found))
    assert len(row['wrong']) == count
    assert row['right'] == (count == 0)


def test_a_refusal_is_not_right_and_no_wrong_law():
    row = several.score(
        _answer(DRY), _diagnosis(('unknown', 'a', 0.9), verdict='unexplained')
    )  # fmt: skip
    assert not row['right']
    assert (row['wrong'], len(row['unexplained'])) == ([], 1)


def test_physics_that_is_not_there_is_an_alarm():
    answer = _answer(wanted='parameters', verdict='parameters_only', errors=({},))
    row = several.score(answer, _diagnosis(('spring', 'a', 0.9)))
    assert row['alarm']
    assert not several.score(answer, _diagnosis(verdict='no_mismatch'))['alarm']
    assert not several.score(answer, _diagnosis(verdict='no_mismatch'))['right']


def test_rates_count_each_world_and_each_finding():
    answer = _answer(DRY, ROTOR)
    rows = [
        several.score(answer, _diagnosis(('asymmetric_coulomb', 'a', 0.9))),
        several.score(answer, _diagnosis(('spring', 'a', 0.9))),
        several.failed(answer),
    ]
    rows = [r | {'wanted': 'hidden', 'seconds': 1.0, 'held_out': {}} | r for r in rows]
    found = several.summary(rows)
    assert found['right']['share'] == pytest.approx(1 / 3, abs=1e-4)
    assert found['recall']['share'] == pytest.approx(1 / 3, abs=1e-4)  # an error misses all
    assert found['precision']['share'] == 0.5
    assert found['missed'] == {'asymmetric_coulomb': 2}
    assert found['failed'] == 1


@pytest.mark.parametrize('kind', production.KINDS)
def test_planned_motion_stays_in_the_span_and_is_its_own_derivative(kind):
    rng = np.random.default_rng(3)
    _, bodies = machines.draw_machine(rng)
    gears = machines.draw_gears(rng, bodies, np.ones(len(bodies)))
    plan = production.plan(rng, kind, 6.0, bodies, gears)
    span = np.array([body.span for body in bodies])
    assert (np.abs(plan.position) <= span * (1.0 + 1e-9)).all()
    q, v, _ = plan.at(3.0)
    ahead, behind = plan.at(3.0 + 1e-3)[0], plan.at(3.0 - 1e-3)[0]
    np.testing.assert_allclose((ahead - behind) / 2e-3, v, atol=0.02 * np.abs(plan.velocity).max())
    assert q.shape == span.shape


def test_recordings_have_pauses_repeated_stamps_and_gaps():
    """As their blemishes say."""
    _, machine, effects, _, _ = dirty.draw_world(1, largest_joints=2)
    parts = [machine.run(1.0, number, effects) for number in (1, 2)]
    whole = blemishes.Blemishes(
        0.02, (0.01,) * len(machine.bodies), 'absent', 1e-4, 0.05, 0, 2, 30.0, is_permuted=True
    )
    files = [
        blemishes.samples(parts, machine.every, x, np.random.default_rng(5))
        for x in (whole, replace(whole, gaps=1))
    ]
    steps = np.diff([sample.stamp_ns for sample in files[0]])
    assert (steps >= 0).all()
    assert (steps == 0).any()
    assert steps.max() >= 30e9
    assert len(files[1]) < len(files[0])


@pytest.mark.parametrize('is_one_size', [False, True])
def test_drives_of_one_size_have_noise_of_one_size(is_one_size):
    """A wrist behind the drive of a shoulder shows little but noise."""
    effort = np.array([[10.0, 0.1], [-10.0, -0.1]])
    spoilt = replace(
        blemishes.draw_blemishes(np.random.default_rng(0), 2, 0.01), is_one_size=is_one_size
    )
    own, size, step = blemishes.sizes_of([SimpleNamespace(effort=effort)], spoilt)
    np.testing.assert_allclose(own, [10.0, 0.1])
    np.testing.assert_allclose(size, [10.0, 10.0 if is_one_size else 0.1])
    np.testing.assert_allclose(step[0] / step[1], 1.0 if is_one_size else 100.0)
