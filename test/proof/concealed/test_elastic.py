"""Statements on elastic joints, and on worlds without any law, are counted rightly."""

from __future__ import annotations

from sgp_proof.concealed import elastic, no_law
from sgp_ros.physics.elasticity import JointElasticity
from sgp_ros.physics.mount import MountElasticity

TRUE = {'stiffness': 200.0, 'damping': 0.1, 'motor_inertia': 0.01, 'encoder': 'motor'}
ANSWER = {
    'case': 'case_1', 'rate_hz': 200.0,
    'effects': [{'effect': JointElasticity.name, 'joint': 'elbow', 'parameters': TRUE}],
}  # fmt: skip
SPRING = {
    'effect': JointElasticity.name, 'joint': 'elbow', 'probability': 0.9,
    'parameters': {'stiffness': {'value': 210.0}, 'encoder': {'value': 'motor'}},
}  # fmt: skip
FRICTION = {'effect': 'coulomb_friction', 'joint': 'elbow', 'probability': 0.6, 'parameters': {}}
LAW = {'effect': 'law', 'joint': 'elbow', 'probability': 0.8, 'formula': 'tau_x[elbow] = a'}


def _said(*findings):
    return {'verdict': 'missing_physics', 'findings': [*findings], 'fit': {}}


def test_a_spring_is_named_where_joint_and_name_are_right():
    """Beside it nothing else is to be asserted; what is hardly probable is not asserted."""
    right = elastic.scored(ANSWER, _said(SPRING, {**FRICTION, 'probability': 0.3}), 30.0)
    assert right['is_named']
    assert right['right_side']
    assert abs(right['stiffness_error'] - 0.05) < 1e-12
    assert right['others'] == []
    wrong = elastic.scored(ANSWER, _said({**SPRING, 'joint': 'wrist'}, FRICTION), 300.0)
    assert not wrong['is_named']
    assert wrong['others'] == [[JointElasticity.name, 'wrist'], ['coulomb_friction', 'elbow']]
    found = elastic.summary([right, wrong])
    assert found['all']['named']['share'] == 0.5
    assert found['below_half_the_rate']['named']['share'] == 1.0
    assert found['below_half_the_rate']['named']['n'] == 1
    assert found['all']['something_else']['share'] == 0.5


def test_a_mount_is_compared_by_axis_and_frequency():
    """The base has one side, its axis."""
    true = {'frequency': 5.0, 'damping_ratio': 0.05, 'moved_mass': 9.0, 'axis': 'x'}
    mount = {'effect': MountElasticity.name, 'joint': 'base', 'parameters': true}
    answer = {**ANSWER, 'effects': [mount]}
    said = {'frequency': {'value': 4.5}, 'axis': {'value': 'y'}}
    row = elastic.scored(answer, _said({**mount, 'probability': 0.7, 'parameters': said}), 5.0)
    assert row['is_named']
    assert not row['right_side']
    assert abs(row['frequency_error'] - 0.1) < 1e-12
    assert elastic.resonance(None, answer) == 5.0
    assert abs(elastic.summary([row])['all']['frequency_error_median'] - 0.1) < 1e-12


def test_what_is_asserted_without_a_law_counts_as_wrong():
    """A law is a wrong law and a wrong name, an effect of the list a wrong name."""
    rows = [
        no_law.said('none', 'case_1', _said(LAW)),
        no_law.said('parameters', 'case_2', _said(FRICTION)),
        no_law.said('walk', 'case_3', _said({**FRICTION, 'effect': 'unknown'})),
    ]
    found = no_law.summary(rows)
    assert found['all']['wrong_law']['n'] == 3
    assert [round(found['all'][k]['share'], 4) for k in ('wrong_law', 'wrong_name')] == [
        0.3333, 0.6667,
    ]  # fmt: skip
    assert found['walk']['wrong_name']['share'] == 0.0
