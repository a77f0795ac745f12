"""Formulas lose the terms that a recording does not tell from zero."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.diagnosis.decide.scale import Scale
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.comparison import compare_models
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.unlisted import formulas
from sgp_ros.diagnosis.unlisted.beside import law_of
from sgp_ros.diagnosis.unlisted.formulas import Range, law
from sgp_ros.diagnosis.unlisted.search import search
from sgp_ros.diagnosis.unlisted.shapes import PIECES, SmoothForce
from sgp_ros.diagnosis.unlisted.shorter import idle, shorter, without
from sgp_ros.diagnosis.unlisted.variables import Variable
from sgp_ros.physics.effect_at import EffectAt
from test.diagnosis.fitted_models import fitted
from test.diagnosis.worlds import CHAINS, simulate


@pytest.mark.parametrize(
    ('text', 'names', 'short'),
    [
        ('a*X + d', 'd', 'a*X'),
        ('a*X + d', 'a', ''),
        ('a*X + b*exp(X/w1)', 'a', 'a*exp(X/w1)'),
        ('a*log(1 + exp((X - x0)/w0)) + b*X + d', 'bd', 'a*log(1 + exp((X - x0)/w0))'),
        ('a*abs(X) + d', '', 'a*abs(X) + d'),
    ],
)
def test_a_text_loses_the_terms_of_some_coefficients(text, names, short):
    assert without(text, names) == short


def _seal(offset):
    """Return the force of a Maxwell element: it follows a speed after a lag."""
    state = [0.0, 0.0]

    def force(t, _q, v):
        state[1] += (v[0] - state[1]) * (1.0 - np.exp(-(t - state[0]) / 0.3))
        state[0] = t
        return (-0.8 * state[1] + offset,)

    return simulate(CHAINS[1], 11, 10.0, force=force)


def test_a_search_ends_with_a_formula_without_idle_terms(equations_for, monkeypatch):
    """And not with a longer one that no term can leave, for they only fit together."""
    monkeypatch.setattr(formulas, 'texts', lambda _: ['a*X + d', 'a*abs(X - x0) + d'])
    _, equations = equations_for(_seal(0.0))
    comparison = compare_models(equations, lambda _share: None)
    scale = Scale.of(equations, comparison)
    found = search(Columns(equations), scale, fitted(equations), 0, is_open=True)
    assert law_of(found.laws[0], 0).effect.text == 'a*X'


@pytest.mark.parametrize('offset', [0.0, 0.4])
def test_a_formula_loses_a_constant_that_is_hardly_there(equations_for, offset):
    """Of a Maxwell element, which a term with a place could imitate."""
    _, equations = equations_for(_seal(offset))
    motion, columns = equations.motion, Columns(equations)
    variable = Variable('dq', 0, 'joint0', memory=('lag', 0.25))
    smooth = SmoothForce(0, variable, '', variable.knots(motion, PIECES), 'joint0')
    seen = Range.of_variable(smooth.variable, motion)
    whole = law(smooth, motion, seen, 'a*abs(X - x0) + d', {'x0': seen.high})
    plain = law(smooth, motion, seen, 'a*X + d', {})
    start = fitted(equations, is_free=False)
    models = []
    for found, shape in ((whole, [seen.high, 0.25]), (plain, [0.25])):
        placed = EffectAt(found, found.places(motion)[0], np.array(shape))
        models.append(fit(columns, (placed,), start.sigma, is_free=False, rounds=2))
    bent, straight = models
    assert idle(columns, straight, 0) == (frozenset() if offset else {'d'})
    short = list(shorter(columns, straight, 0))
    assert len(short) == (0 if offset else 1)
    for model in short:
        placed = law_of(model, 0)
        assert placed.effect.text == 'a*X'
        np.testing.assert_allclose(placed.coefficients, -0.8, rtol=0.15)
        np.testing.assert_allclose(placed.shape, 0.3, rtol=0.15)
        assert model.left[0] < 1.1 * min(straight.left[0], bent.left[0]) + 1e-5
