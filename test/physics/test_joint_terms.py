"""Laws of the terms of single joints."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.physics.joint_terms import Shape, joint_term, term_laws
from sgp_ros.physics.term import Joint, Motion

JOINT_TERMS = term_laws()
JOINTS = (Joint('a'), Joint('b', kind='prismatic'), Joint('c'))


def _motion(seed=0, n=6):
    return Motion(*np.random.default_rng(seed).normal(size=(4, n, 3)))


def _rest(**given):
    arrays = {c: np.zeros((1, 3)) for c in ('position', 'velocity', 'acceleration', 'effort')}
    return Motion(**(arrays | {name: np.full((1, 3), x) for name, x in given.items()}))


@pytest.mark.parametrize('name', JOINT_TERMS)
def test_a_term_acts_on_its_own_joint_alone(name):
    """Each column has one row that is not zero, and reads that joint's motion alone."""
    chosen = (2, 0)
    term = joint_term(name, JOINTS, chosen)
    motion = _motion()
    columns = term.columns(motion)
    assert columns.shape == (6, 3, len(term.coefficients))
    for i, coefficient in enumerate(term.coefficients):
        j = chosen[i // len(JOINT_TERMS[name][1].names)]
        assert coefficient.joint == JOINTS[j].name
        assert coefficient.name.startswith(f'{JOINTS[j].name}.')
        assert not np.any(np.delete(columns[:, :, i], j, axis=1))
        kept = {c: np.where(np.arange(3) == j, getattr(motion, c), 9.0)
                for c in ('position', 'velocity', 'acceleration', 'effort')}  # fmt: skip
        np.testing.assert_array_equal(term.columns(Motion(**kept))[:, :, i], columns[:, :, i])


@pytest.mark.parametrize('name', JOINT_TERMS)
def test_units_follow_the_kind_of_joint(name):
    """Newtons and metres where a joint slides."""
    turning, sliding, _ = (joint_term(name, JOINTS, (j,)).coefficients[0] for j in range(3))
    assert ('rad' in turning.unit) or ('N m' in turning.unit) or turning.unit == 'kg m^2'
    assert 'rad' not in sliding.unit
    assert 'N m' not in sliding.unit
    assert turning.unit != sliding.unit


@pytest.mark.parametrize('name', ['viscous', 'coulomb', 'asymmetric_coulomb', 'stribeck',
                                  'quadratic'])  # fmt: skip
def test_friction_takes_power_from_the_motion(name):
    """With positive coefficients: effort times velocity is never negative; none at rest."""
    term = joint_term(name, JOINTS, (0, 1, 2))
    motion = _motion(n=50)
    effort = term.columns(motion).sum(axis=2)
    assert np.all(effort * motion.velocity >= 0.0)
    assert not np.any(term.columns(_rest()))


def test_dry_friction_is_the_sign_beyond_its_width():
    """At ten widths the sign is complete; at half a width it is its tangent hyperbolic."""
    term = joint_term('coulomb', JOINTS, (0,), Shape(coulomb_width=0.2))
    for velocity, expected in ((2.0, 1.0), (-2.0, -1.0), (0.1, np.tanh(0.5))):
        found = term.columns(_rest(velocity=velocity))[0, 0, 0]
        assert found == pytest.approx(expected, abs=1e-8)


def test_asymmetric_friction_splits_the_symmetric_one():
    """Equal sizes give the symmetric term back."""
    motion = _motion()
    split = joint_term('asymmetric_coulomb', JOINTS, (1,)).columns(motion)
    whole = joint_term('coulomb', JOINTS, (1,)).columns(motion)
    np.testing.assert_allclose(split.sum(axis=2), whole[:, :, 0])
    assert np.all(split[:, :, 0] * split[:, :, 1] == 0.0)


@pytest.mark.parametrize(
    ('name', 'given', 'expected'),
    [
        ('viscous', {'velocity': 0.3}, 0.3),
        ('quadratic', {'velocity': -0.3}, -0.09),
        ('stribeck', {'velocity': 0.1}, np.exp(-1.0)),
        ('offset', {}, 1.0),
        ('armature', {'acceleration': 2.0}, 2.0),
        ('spring', {'position': 0.7}, 0.7),
    ],
)
def test_columns_are_what_their_names_say(name, given, expected):
    """Written out for one joint."""
    found = joint_term(name, JOINTS, (2,)).columns(_rest(**given))[0, 2, 0]
    assert found == pytest.approx(expected)
