"""Real recordings: what is expected of each, and how a diagnosis is judged."""

from __future__ import annotations

import pytest

from sgp_proof.real.diagnosis import MACHINES
from sgp_proof.real.expected import judge, read_expected
from sgp_ros.diagnosis.result import VERDICTS
from sgp_ros.physics.catalogue import EFFECTS

EXPECTED = {
    'verdict': ['missing_physics'],
    'expected': [{'joint': ['a'], 'effects': {'spring': {'stiffness': [1.0, 2.0]}}}],
    'allowed': ['constant_load'],
    'held_out': {'nmse': 0.1, 'factor': 1.3},
}


def _finding(effect, probability=0.9, joint='a', **values):
    parameters = {name: {'value': value} for name, value in values.items()}
    return {'joint': joint, 'effect': effect, 'parameters': parameters, 'probability': probability}


def _found(*findings, verdict='missing_physics', error=0.05):
    fit = {
        'target': 'torque',
        'train': {'nmse_after': {'a': 9.0}},
        'x': {'nmse_after': {'a': error}},
    }
    return {'verdict': verdict, 'findings': findings, 'parameter_errors': [], 'fit': fit}


@pytest.mark.parametrize(
    ('found', 'grade', 'reasons'),
    [
        (_found(_finding('spring', stiffness=1.5), _finding('constant_load')), 'right', 0),
        (_found(_finding('spring', stiffness=3.0)), 'partly', 1),
        (_found(_finding('spring', 0.4, stiffness=1.5)), 'partly', 1),
        (_found(_finding('spring', stiffness=1.5), error=0.2), 'partly', 1),
        (_found(_finding('spring', stiffness=1.5), verdict='unexplained'), 'partly', 1),
        (_found(_finding('spring', stiffness=1.5), _finding('backlash', 0.4)), 'right', 0),
        (_found(_finding('spring', stiffness=1.5), _finding('backlash', 0.6)), 'wrong', 1),
        (_found(_finding('spring', joint='b', stiffness=1.5)), 'wrong', 2),
        (_found(_finding('unknown'), verdict='unexplained'), 'wrong', 2),
        ({'refused': 'no joint moves'}, 'wrong', 1),
    ],
    ids=['right', 'number', 'doubtful', 'held out', 'verdict', 'doubtful stranger', 'stranger',
         'other joint', 'unexplained', 'refused'],
)  # fmt: skip
def test_each_fault_costs_its_grade_and_gives_its_reason(found, grade, reasons):
    judged = judge(EXPECTED, found)
    assert (judged['grade'], len(judged['reasons'])) == (grade, reasons)


def test_each_recording_has_expectations_in_the_words_of_the_product():
    """Law, coupled friction and setup errors are of the schema, whether or not they exist yet."""
    later = {'law', 'coupled_friction', 'effort_scale', 'parameters', 'unknown'}
    expected = read_expected()
    assert set(expected) == set(MACHINES)
    for entry in expected.values():
        assert set(entry['verdict']) <= set(VERDICTS)
        named = {effect for item in entry['expected'] for effect in item['effects']}
        assert named | set(entry.get('allowed', ())) <= {*EFFECTS, *later}
        assert entry['source']
        for item in entry['expected']:
            for ranges in item['effects'].values():
                assert all(low < high for low, high in ranges.values())


@pytest.mark.parametrize(('shown', 'is_said'), [(0.41, True), (0.05, False)])
def test_what_the_recording_cannot_show_is_said_beside_a_miss(shown, is_said):
    seen = {'joint': 'elbow', 'effect': 'coulomb_friction', 'parameter': 'level', 'value': shown,
            'unit': 'N m'}  # fmt: skip
    expected = {
        'verdict': ['missing_physics'],
        'expected': [{'joint': ['elbow'], 'effects': {'coulomb_friction': {'level': [0.1, 0.3]}}}],
    }
    found = {'verdict': 'no_mismatch', 'findings': [], 'parameter_errors': [], 'fit': {},
             'visibility': [seen]}  # fmt: skip
    reasons = judge(expected, found)['reasons']
    assert (
        'elbow: coulomb friction, which this recording shows from 0.41 N m on '
        '(expected: at most 0.3), not found' in reasons
    ) == is_said
    assert reasons[-1].endswith('not found')
