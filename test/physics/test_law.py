"""Laws of force from formulas, against the built-in ones that mean the same, and by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.physics.catalogue import EFFECTS, drawn_over, exerts_force
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.formula import read_formula
from sgp_ros.physics.place import Place
from sgp_ros.robots.stated_effects import read_effects
from test.physics.test_effects import MOTION, STEP, TREE

SAME = {
    '-b*dq[j1]': ('viscous_friction', {'b': 'N m s/rad'}),
    '-level*sign(dq[j1])': ('coulomb_friction', {'level': 'N m'}),
    '-(coulomb + (static - coulomb)*exp(-(dq[j1]/stribeck_velocity)**2))*sign(dq[j1])': (
        'stribeck_friction', {'coulomb': 'N m', 'static': 'N m', 'stribeck_velocity': 'rad/s'},
    ),
    '-c*abs(dq[j1])*dq[j1]': ('quadratic_drag', {'c': 'N m s2/rad2'}),
    '-stiffness*(q[j1] - rest)': ('spring', {'stiffness': 'N m/rad', 'rest': 'rad'}),
    'amplitude*sin(periods*q[j1] + phase)': (
        'cogging', {'amplitude': 'N m', 'periods': '1', 'phase': 'rad'},
    ),
    'force': ('constant_load', {'force': 'N m'}),
    '-inertia*ddq[j1]': ('armature', {'inertia': 'kg m2'}),
}  # fmt: skip
VALUES = dict.fromkeys(('b', 'level', 'coulomb', 'c', 'amplitude', 'force', 'inertia'), 0.3) | {
    'static': 0.7, 'stribeck_velocity': 0.4, 'stiffness': 2.0, 'rest': 0.4, 'periods': 5.0,
    'phase': 0.2,
}  # fmt: skip


def law_at(formula, parameters, joint='j1', **entry):
    """Return a law as a robot YAML states it."""
    problems = []
    law = {'joint': joint, 'formula': formula, 'parameters': parameters, **entry}
    found = read_effects([{'law': law}], TREE, problems)
    assert problems == []
    return found[0]


def _stated(formula, units):
    return law_at(formula, {n: {'value': VALUES[n], 'unit': u} for n, u in units.items()})


@pytest.mark.parametrize('formula', SAME)
def test_a_formula_is_the_built_in_law_that_it_writes_down(formula):
    """Columns, coefficients, and what holds the joint at rest."""
    name, units = SAME[formula]
    law = _stated(formula, units)
    numbers = {n: VALUES[n] for n in units}
    built_in = EffectAt.stated(EFFECTS[name], 'j1', numbers, TREE)
    np.testing.assert_allclose(law.force(MOTION), built_in.force(MOTION), atol=1e-12)
    assert law.held_joints == built_in.held_joints
    assert law.report(MOTION) == pytest.approx(numbers)
    assert drawn_over(law.name, law.effect.formula) == built_in.effect.drawn_over or name in {
        'constant_load', 'armature',
    }  # fmt: skip
    assert exerts_force(law.name)


def test_factors_are_coefficients_and_all_else_is_shape():
    """A formula with a part that has no factor is fitted as a whole."""
    open_ = {n: {'start': 0.5, 'unit': 'N m', 'range': [0, 3]} for n in 'ab'}
    v0 = {'start': 1.0, 'unit': 'rad/s', 'range': [0.1, 10]}
    law = law_at('-(a + b*exp(-abs(dq[j1])/v0))*sign(dq[j1])', {**open_, 'v0': v0}).effect
    assert (law.linear, law.shape_names(), law.is_given) == (('a', 'b'), ('v0',), False)
    low, high = law.bounds(MOTION, Place(1))
    starts = law.starts(MOTION, Place(1))
    assert ((starts >= low) & (starts <= high)).all()
    assert starts[0] == 1.0
    one = {'value': 1.0, 'unit': 'N m'}
    whole = law_at('-(c + a)*sign(dq[j1])', {'a': open_['a'], 'c': one}).effect
    assert (whole.linear, whole.shape_names(), whole.is_given) == ((), ('a',), True)
    force = whole.columns(MOTION, Place(1), np.array([0.5]))[:, 0]
    np.testing.assert_allclose(force, -1.5 * MOTION.direction[:, 1])
    at = EffectAt(whole, Place(1), np.array([0.5]), np.ones(1))
    assert at.report(MOTION) == {'a': 0.5, 'c': 1.0}
    assert at.is_possible(MOTION)
    assert not at.with_shape(np.array([4.0])).is_possible(MOTION)


@pytest.mark.parametrize('w0', [1e-3, 1e-9])
def test_what_grows_beyond_all_bounds_can_be_squared(w0):
    """A search passes through widths at which a formula is no force."""
    number = {'start': 1.0, 'unit': 'N m', 'range': [-9, 9]}
    width = {'start': 0.5, 'unit': 'rad', 'range': [1e-9, 3]}
    law = law_at('a*exp(abs(q[j1])/w0)', {'a': number, 'w0': width}).effect
    x = law.columns(MOTION, Place(1), np.array([w0]))
    assert np.isfinite((x * x).sum())


def test_what_remembers_runs_over_the_grid():
    """A lag against its differential equation, play against its two edges, a delay."""
    q = MOTION.position[:, 1]
    stiff, T = {'value': 1.0, 'unit': 'N m/rad'}, {'value': 0.2, 'unit': 's'}
    lagged = law_at('k*lag(q[j1], T)', {'k': stiff, 'T': T}).force(MOTION)[:, 1]
    rate = np.gradient(lagged, STEP)
    np.testing.assert_allclose(rate[5:-5], ((q - lagged) / 0.2)[5:-5], atol=2e-2)
    width = {'value': 0.3, 'unit': 'rad'}
    played = law_at('k*play(q[j1], w)', {'k': stiff, 'w': width}).force(MOTION)[:, 1]
    assert np.abs(played - q).max() == pytest.approx(0.15)
    moved = np.diff(played) != 0.0
    assert 0.2 < moved.mean() < 0.98
    np.testing.assert_allclose(np.abs(played - q)[1:][moved], 0.15)
    delayed = law_at('k*delay(q[j1], T)', {'k': stiff, 'T': T}).force(MOTION)[:, 1]
    np.testing.assert_allclose(delayed[20:], q[:-20], atol=1e-9)


@pytest.mark.parametrize(
    ('formula', 'is_online', 'is_dry'),
    [
        ('-a*sign(dq[j1])*abs(sin(q[j0]))', True, True),
        ('-a*sign(dq[j0])', True, False),
        ('a*sign(dq[j1])', True, False),
        ('-a*exp(-t/T)*sign(dq[j1])', False, True),
        ('-a*lag(sign(dq[j1]), T)', False, True),
        ('a*tanh(tau[j3]/a)', True, False),
        ('q[j1]*tau[j3]', False, False),
        ('-a*tanh(q[j1])', True, False),
    ],
)
def test_it_says_what_it_needs(formula, is_online, is_dry):
    """One time of the motion, and whether it holds its joint at rest."""
    units = {'a': 'N m', 'T': 's'}
    used = {
        n: {'value': 1.0, 'unit': u}
        for n, u in units.items()
        if n in read_formula(formula, is_law=True).parameters
    }
    law = law_at(formula, used)
    assert law.effect.is_online == is_online
    assert bool(law.held_joints) == is_dry


def test_two_laws_of_a_joint_are_two():
    """Told apart by what they state; written under one name."""
    a, b = (_stated(f, SAME[f][1]) for f in ('-b*dq[j1]', '-level*sign(dq[j1])'))
    assert a.name == b.name == 'law'
    assert a.key != b.key
    open_ = law_at('-b*dq[j1]', {'b': {'start': 1.0, 'unit': 'N m s/rad'}})
    motion = replace(MOTION, stated=(a, open_))
    assert list(motion.catalogue)[-1] == open_.effect.key
    assert len(motion.catalogue) == len(EFFECTS) + 1
    np.testing.assert_array_equal(motion.stated_force, a.force(motion))
