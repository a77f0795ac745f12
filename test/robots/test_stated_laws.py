"""Laws of force in a robot YAML: what is wrong with one is said in one line."""

from __future__ import annotations

import pytest

from sgp_ros.robots.stated_effects import read_effects
from test.physics.test_effects import TREE

GOOD = {
    'joint': 'j1', 'formula': '-a*abs(dq[j1])**0.5*sign(dq[j1])',
    'parameters': {'a': {'start': 0.3, 'unit': 'N m s0.5/rad0.5', 'range': [0, 5]}},
}  # fmt: skip
A = GOOD['parameters']['a']
WRONG = {
    'the joint is': {'joint': 'j9'},
    'unknown key': {'rest': 1},
    'states tau_x': {'formula': 'tau_x[j0] = -a*dq[j1]'},
    'in the formula': {'formula': '-a*foo(dq[j1])'},
    "has the joints ['j7']": {'formula': '-a*abs(dq[j7])**0.5*sign(dq[j1])'},
    'has the unit kg m2/s, not N m': {'formula': '-a*abs(dq[j1])**-0.5*sign(dq[j1])'},
    'is None, not {value': {'formula': '-a*b*abs(dq[j1])**0.5*sign(dq[j1])'},
    "'b' is not in the formula": {'parameters': {'a': A, 'b': A}},
    'unit': {'parameters': {'a': {'start': 0.3}}},
    'the unit': {'parameters': {'a': {**A, 'unit': 'apples'}}},
    'either a value or a start': {'parameters': {'a': {**A, 'value': 0.3}}},
    'the range is': {'parameters': {'a': {**A, 'range': [1, 5]}}},
    'not a finite number': {'parameters': {'a': {**A, 'start': 'much'}}},
    'not positive': {'parameters': {'a': {**A, 'std': 0.0}}},
}


@pytest.mark.parametrize('law', [GOOD, {**GOOD, 'formula': f'tau_x[j1] = {GOOD["formula"]}'}])
def test_a_law_is_read_in_both_forms(law):
    """As an entry of its own, and as diagnosis.json has it."""
    for item in ({'law': law}, {'effect': 'law', **law}):
        problems = []
        (found,) = read_effects([item], TREE, problems)
        assert problems == []
        assert found.effect.is_open
        assert found.numbers == {'a': 0.3}
        assert found.effect.formula == f'tau_x[j1] = {GOOD["formula"]}'


@pytest.mark.parametrize(('why', 'change'), WRONG.items())
def test_what_is_wrong_is_said(why, change):
    """Where it stands, what was found and what belongs there."""
    problems = []
    assert read_effects([{'law': {**GOOD, **change}}], TREE, problems) == ()
    assert any(why in p for p in problems), problems
    assert all('effects[0].law' in p for p in problems)


def test_a_law_on_a_sliding_joint_has_its_units():
    """Metres for positions, newtons for the force."""
    law = {
        'joint': 'j2', 'formula': '-k*q[j2]**3',
        'parameters': {'k': {'value': 2.0, 'unit': 'N/m3', 'std': 0.1}},
    }  # fmt: skip
    problems = []
    (found,) = read_effects([{'law': law}], TREE, problems)
    assert problems == []
    assert not found.effect.is_open
    assert found.std == pytest.approx([0.1])
    law['parameters']['k']['unit'] = 'N m/rad3'
    assert read_effects([{'law': law}], TREE, problems) == ()
