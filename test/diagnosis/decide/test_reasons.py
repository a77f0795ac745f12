"""Why a model is not asserted is said in words that its numbers bear out."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sgp_ros.diagnosis.criteria import COUNTED_SHARE
from sgp_ros.diagnosis.decide.decision import Decision, decide, refused
from sgp_ros.diagnosis.decide.reasons import apart, left_remarks, why_not
from sgp_ros.diagnosis.decide.scale import Scale
from sgp_ros.diagnosis.explain.comparison import Comparison
from test.diagnosis.fitted_models import fitted
from test.diagnosis.worlds import CHAINS, simulate

NUMBERS = re.compile(r'leaves ([\d.e+-]+) % of the mean squared effort of \w+, .*?([\d.e+-]+) %')


def _comparison(equations, *models):
    bases = (fitted(equations, is_free=f) for f in (False, True))
    return Comparison(*bases, models, ())


@pytest.fixture(scope='module')
def damped(equations_for, viscous):
    return equations_for(viscous)[1]


@pytest.fixture(scope='module')
def models(damped):
    """The right model, one more effect, a wrong one, and nothing."""
    names = (('viscous_friction',), ('viscous_friction', 'quadratic_drag'), ('spring',), ())
    return [fitted(damped, *each) for each in names]


def _said(model, asserted, equations):
    scale = Scale.of(equations, _comparison(equations, asserted))
    decision = Decision('missing_physics', asserted, (model,), np.zeros(1), 0)
    return why_not(model, decision, scale)


def test_a_rival_beside_what_is_asserted_is_told_from_one_in_its_place(damped, models):
    """It leaves less than the asserted model and still lost: what it adds is next to nothing."""
    right, more, wrong, _ = models
    assert _said(more, right, damped).startswith('added to the asserted model it leaves')
    said = _said(wrong, right, damped)
    assert 'added' not in said
    assert ';' not in said  # the two numbers say it


def test_a_rival_that_leaves_less_gets_its_reason(damped, models):
    """Its price, the size of its effects, or bodies that are not likely."""
    right, more, _, _ = models
    more = replace(more, residual=0.9 * right.residual, parts=2 * right.parts)
    more.__dict__['shares'] = [1.0, 1e-6]
    assert 'too small' in _said(more, right, damped)
    more.__dict__['shares'] = [1.0, 1.0]
    assert 'than the improvement justifies' in _said(more, right, damped)
    worse = replace(more, residual=1.001 * right.residual)
    worse.__dict__['shares'] = [1.0, 1.0]
    assert 'it fits no better and needs more' in _said(worse, right, damped)
    heavy = replace(more, w=np.full_like(more.w, 30.0), inertia=np.zeros(1))
    heavy.__dict__['shares'] = [1.0, 1.0]
    assert 'further from the nominal' in _said(heavy, right, damped)


def test_a_good_fit_that_is_refused_is_given_the_true_reason(damped, models):
    """Not its fit: what beats it, or where it fails, is known to whoever refused it."""
    right, _, _, base = models
    comparison = _comparison(damped, right)
    decision = decide(damped, comparison)
    why = 'what explains joint_0 does not carry over'
    after = refused(damped, comparison, decision, 0, why)
    assert after.verdict == 'unexplained'
    said = why_not(right, after, Scale.of(damped, comparison))
    assert said.endswith(f'; {why}')
    assert 'the asserted model' not in said  # nothing is asserted
    assert base.key == after.model.key


@pytest.mark.parametrize(
    ('left', 'size', 'is_calm'), [(0.1, 1.0, False), (0.6, 1.0, True), (0.1, 0.8, True)]
)
def test_what_bodies_explain_much_worse_is_not_explained_by_them(
    damped, models, left, size, is_calm
):
    """Though they leave less than counts as physics: they stand for what is refused.

    Unless that is too small to count itself, in the band of the equations (0.8 of the bound).
    """
    right = models[0]
    if size < 1.0:
        part = np.sqrt(size * COUNTED_SHARE / right.filtered_shares[0])
        right = replace(right, parts=tuple(part * x for x in right.parts))
    comparison = _comparison(damped, right)
    decision = decide(damped, comparison)
    bodies = comparison.parameters
    small = np.sqrt(0.8 * COUNTED_SHARE / bodies.left.max()) * bodies.residual
    comparison = replace(comparison, parameters=replace(bodies, residual=small))
    refusable = replace(decision, model=replace(right, residual=np.sqrt(left) * small))
    after = refused(damped, comparison, refusable, 0, 'it fails elsewhere')
    assert (after.verdict in {'parameters_only', 'no_mismatch'}) is is_calm
    assert is_calm or after.verdict == 'unexplained'


def test_what_leaves_more_than_noise_is_reported_with_its_size(damped, models):
    """A spring where friction is missing."""
    spring = models[2]
    comparison = _comparison(damped, spring)
    decision = decide(damped, comparison)
    assert decision.verdict == 'unexplained'
    said = why_not(spring, decision, Scale.of(damped, comparison))
    if decision.tentative is not None:
        times = re.search(r'the part that is not noise is ([\d.e+]+) times', said)
        assert float(times[1]) > 1.0


@given(
    share=st.floats(1e-6, 1e3), inertia=st.floats(-2.0, 2.0), w=st.floats(0.0, 30.0),
    sizes=st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0)), which=st.integers(0, 2),
    against=st.integers(0, 3),
)  # fmt: skip
def test_no_reason_contradicts_the_numbers_beside_it(
    damped, models, share, inertia, w, sizes, which, against
):
    """Larger residuals need no other reason; a smaller one always has one."""
    drawn = models[which]
    residual = np.sqrt(share) * models[against].residual
    drawn = replace(drawn, residual=residual, inertia=np.full(1, inertia), w=drawn.w + w)
    drawn.__dict__['shares'] = list(sizes[: len(drawn.effects)])
    said = _said(drawn, models[against], damped)
    numbers, _, reason = said.partition('; ')
    left, other = map(float, NUMBERS.search(numbers).groups()) if 'as much' not in said else (0, 0)
    assert reason or left > other
    if 'less well' in reason:
        assert left <= other
    scale = Scale.of(damped, _comparison(damped, models[against]))
    if 'needs' in reason:
        assert scale.worth(drawn) < scale.worth(models[against])
    if 'improvement' in reason:
        assert scale.likelihood(drawn) > scale.likelihood(models[against])
    if 'no better' in reason:
        assert scale.likelihood(drawn) <= scale.likelihood(models[against])
    if not models[against].effects:
        assert 'asserted model' not in said


@given(a=st.floats(1e-9, 1e9), b=st.floats(1e-9, 1e9))
def test_numbers_that_differ_are_printed_apart(a, b):
    """Unless they differ by rounding."""
    one, other = apart(a, b)
    assert (one == other) <= (abs(a - b) <= 1e-3 * max(a, b))
    if one != other:
        assert (float(one) > float(other)) == (a > b)


@pytest.mark.parametrize(('ripple', 'unknown', 'says'), [(0.8, (), True), (0.8, (0,), False),
                                                         (0.0, (), False)])  # fmt: skip
def test_what_is_left_beside_laws_that_are_adequate_is_said(equations_for, ripple, unknown, says):
    """It comes back with the motion, and counts as physics by itself."""
    world = simulate(
        CHAINS[1], 4, 10.0, force=lambda t, q, v: (ripple * math.sin(5.0 * q[0]) - 1.5 * v[0],)
    )
    _, equations = equations_for(world)
    model = fitted(equations, 'viscous_friction')
    found = list(left_remarks(equations, model, unknown))
    assert len(found) == says
    assert all('joint0' in remark and 'comes back with the motion' in remark for remark in found)
