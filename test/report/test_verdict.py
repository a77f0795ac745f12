"""No sentence of a verdict contradicts the numbers beside it, whatever these are."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sgp_ros.diagnosis.criteria import LEAST_SHARE
from sgp_ros.diagnosis.result import VERDICTS, Difference, Parameter, ParameterError
from sgp_ros.diagnosis.shown import Dependence
from sgp_ros.report.diagnosis import render
from sgp_ros.report.diagnosis_cards import cards
from sgp_ros.report.diagnosis_text import explained
from sgp_ros.report.next_steps import Given, after_diagnosis
from sgp_ros.report.verdict import verdict_sentence
from test.report.diagnoses import ASYMMETRIC, COULOMB, MASS, SPRING, UNKNOWN, diagnosis

_OF_MODELS = tuple(v for v in VERDICTS if v != 'setup_error')
JOINTS = ('shoulder', 'elbow')
SHARES = st.floats(1e-9, 100.0)
FINDINGS = st.lists(st.sampled_from([COULOMB, SPRING, UNKNOWN]), max_size=3, unique_by=id)


@st.composite
def _diagnoses(draw, verdicts=_OF_MODELS):
    verdict = draw(st.sampled_from(verdicts))
    findings = draw(FINDINGS) if verdict == 'missing_physics' else []
    findings = [UNKNOWN] if verdict == 'unexplained' else findings
    if verdict == 'missing_physics' and not findings:
        findings = [SPRING]
    left = draw(SHARES)
    rest = f'leaves {left:.3g} % of the mean squared effort of elbow, the asserted model 1 %'
    rival = replace(
        ASYMMETRIC, joint='elbow', log_bayes_factor=draw(st.floats(-50.0, 5e3)),
        probability=draw(st.floats(0.0, 0.4)),
        why=draw(st.sampled_from(['', rest, f'{rest}; what explains elbow does not carry over'])),
    )  # fmt: skip
    found = diagnosis(
        verdict, findings, alternatives=draw(st.sampled_from([(), (rival,)])),
        errors=draw(st.sampled_from([(), (MASS,)])), held=draw(st.booleans()),
    )  # fmt: skip
    proof = found.proofs['train']
    before, after = (draw(st.tuples(SHARES, SHARES)) for _ in range(2))
    proof = replace(
        proof, nmse_before=dict(zip(JOINTS, before, strict=True)),
        nmse_after=dict(zip(JOINTS, after, strict=True)),
    )  # fmt: skip
    scores = {name: draw(st.floats(0.0, 1.0)) for name in ('position', 'velocity')}
    chances = {name: draw(st.floats(0.0, 1.0)) for name in scores}
    return replace(
        found, proofs=found.proofs | {'train': proof},
        dependences=tuple(Dependence(j, 0.1, scores, chances) for j in JOINTS),
        bands=(), certainty=draw(st.none() | st.floats(0.05, 0.99)),
    )  # fmt: skip


@given(found=_diagnoses())
def test_a_sentence_says_no_more_than_its_numbers(found):
    """No gain is claimed that is none, no fit denied that is one, nothing large called little."""
    text = verdict_sentence(found)
    assert not re.search(r'(?<!e)-\d[\d.]* %', text)
    gain = re.search(r'(explains?|explaining) ([\d.e+]+|more than 99.9|less than 0.001) %', text)
    if gain and found.verdict in {'missing_physics', 'parameters_only'}:
        assert explained(found) > 0.0
    assert 'fits' not in text
    nearest = found.verdict == 'unexplained' and found.alternatives
    if nearest and found.alternatives[0].why:
        assert found.alternatives[0].why in text  # the whole reason, not its first number alone
    if 'too little to count' in text and 'not noise' not in text:
        shown = max(found.proofs['train'].nmse_before.values())
        assert shown < LEAST_SHARE
    assert '  ' not in text
    assert text.endswith('.')


@given(found=_diagnoses(verdicts=('unexplained', 'no_mismatch')))
def test_what_is_not_asserted_is_nowhere_called_the_finding(found):
    """The numbers on top of such a page claim no law and no gain by one."""
    text = ' '.join(card['value'] + card['label'] for card in cards(found))
    assert 'explained by the finding' not in text
    assert '-' not in text.replace('->', '')  # no negative share


def test_a_finding_that_a_simulation_was_not_asked_for_has_no_empty_number():
    """A quantity that is unknown there is called so."""
    known = replace(COULOMB, in_simulation={'level': Parameter(0.1, 0.01, 'N m')})
    found = diagnosis('missing_physics', [known, UNKNOWN])
    text = verdict_sentence(found)
    assert 'in the simulation level 0.100 +- 0.020 N m (' in text
    assert 'in the simulation unknown (' in text


def test_all_that_differs_is_in_the_sentence():
    """Between recordings beside what all lack, and bodies beside what a simulation lacks."""
    level = COULOMB.parameters
    change = Difference('warm', 'elbow', 'coulomb_friction', level, level, 0.99, 0.1)
    several = replace(
        diagnosis('missing_physics', [SPRING]), recordings=('cold', 'warm'), differences=(change,)
    )
    text = verdict_sentence(several)
    assert text.startswith('Missing')
    assert 'The recordings differ: warm has on elbow Coulomb friction' in text
    assert 'differ' not in verdict_sentence(replace(several, differences=()))
    known = replace(COULOMB, in_simulation={'level': Parameter(0.1, 0.01, 'N m')})
    mass = ParameterError('forearm', 'mass', 1.2, 1.0, 0.05, 'kg')
    found = diagnosis('missing_physics', [known])
    text = verdict_sentence(replace(found, parameter_errors=(mass,)))
    assert 'Bodies differ, too: mass of forearm 1.2' in text
    assert 'Bodies' not in verdict_sentence(replace(found, parameter_errors=()))


def test_a_low_probability_has_its_reason_beside_it():
    """Else a narrow interval contradicts it."""
    small = replace(SPRING, probability=0.4, why='its share is too small to count')
    text = verdict_sentence(diagnosis('missing_physics', [COULOMB, small]))
    assert '(probability 0.40: its share is too small to count)' in text


@pytest.mark.parametrize(
    ('scale', 'said'), [(57.29, 'degrees were taken for radians'), (1.6, ''),
                        (0.017453, 'radians were taken for degrees')],
)  # fmt: skip
def test_a_scale_that_mixes_up_units_says_so(scale, said):
    error = replace(
        SPRING, effect='position_scale', parameters={'scale': Parameter(scale, 1e-4, '')}
    )
    text = verdict_sentence(replace(diagnosis('setup_error', []), setup=(error,)))
    assert (' were taken for ' in text) == bool(said)
    assert said in text


@pytest.mark.parametrize(('robot', 'to'), [('arm.urdf', 'urdf'), ('arm.xml', 'mjcf')])
def test_the_next_step_hands_the_robot_back_in_its_format(robot, to):
    """The URDF beside the results holds bodies alone."""
    steps = after_diagnosis(
        'missing_physics', Given('a.mcap', robot), Path('out'), has_setup_error=False
    )
    assert f'--to {to} --ranges' in steps[-1][1]


@pytest.mark.parametrize('last', [None, 'c.mcap'])
def test_of_several_unexplained_recordings_the_last_is_compared_with_the_first(last):
    """A law that only one of them has is found so, also where no list has it."""
    given = Given('a.mcap', 'arm.urdf', 'gains.yaml', last)
    steps = after_diagnosis('unexplained', given, Path('out'), has_setup_error=False)
    apart = 'sgp diagnose c.mcap --robot arm.urdf --gains gains.yaml --sim a.mcap'
    assert (apart in [command for _, command in steps]) is (last is not None)
    assert steps[-1][1].startswith('sgp replay')


def test_the_title_names_an_error_of_the_set_up_before_missing_physics():
    """As the sentence below it does."""
    found = replace(diagnosis('missing_physics', [COULOMB]), setup=(SPRING,))
    assert '<title>Set-up error; physics is missing: diagnosis of' in render(found, {})
