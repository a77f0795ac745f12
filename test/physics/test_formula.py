"""Laws of formulas: they compute what Python computes, and nothing but the grammar is read."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sgp_ros.errors import ConfigError
from sgp_ros.physics.formula import SIGNALS, read_formula
from sgp_ros.physics.term import Motion

JOINTS = ('pole', 'arm-1')


def _motion(n=20):
    return Motion(*np.random.default_rng(0).normal(size=(4, n, 2)))


@pytest.mark.parametrize(
    ('text', 'expected'),
    [
        ('2 + 3 * 4', 14.0),
        ('-2 ** 2', -4.0),
        ('(1 - 3) / 4', -0.5),
        ('a * b ** 2 - +a', 2.0 * 9.0 - 2.0),
        ('min(a, b) + max(a, b)', 5.0),
        ('abs(-a) + sign(-b) + sqrt(4)', 3.0),
        ('log(exp(a)) + sin(0) + cos(0) + tanh(0)', 3.0),
        ('1e-3', 1e-3),
    ],
)
def test_a_formula_has_the_value_of_its_expression(text, expected):
    assert read_formula(text).value({'a': 2.0, 'b': 3.0}) == pytest.approx(expected)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_number_is_a_formula_of_itself(number):
    assert read_formula(number).value({}) == number


def test_a_column_is_what_numpy_computes_to_the_bit():
    motion = _motion()
    q, v, a = motion.position, motion.velocity, motion.acceleration
    column = read_formula('cos(q[pole]) * (2 * ddq[pole] + ddq["arm-1"]) - dq[pole] ** 2')
    np.testing.assert_array_equal(
        column.column(JOINTS)(motion), np.cos(q[:, 0]) * (2.0 * a[:, 0] + a[:, 1]) - v[:, 0] ** 2
    )


@pytest.mark.parametrize('name', SIGNALS)
def test_each_signal_is_its_channel(name):
    motion = _motion()
    column = read_formula(f'{name}[pole]').column(JOINTS)(motion)
    np.testing.assert_array_equal(column, getattr(motion, SIGNALS[name])[:, 0])


def test_a_formula_says_what_it_is_made_of():
    found = read_formula('k * tanh(dq[pole] / width) + k')
    assert found.parameters == {'k', 'width'}
    assert found.signals == {('dq', 'pole')}


@pytest.mark.parametrize(
    ('text', 'degree'),
    [
        ('sin(q[a])', 0),
        ('sin(q[a]) * ddq[a] + tau[b] / 2 - dq[a]', 1),
        ('ddq[a] * tau[a]', 2),
        ('ddq[a] ** 2', math.inf),
        ('1 / tau[a]', math.inf),
        ('abs(ddq[a])', math.inf),
        ('2 ** tau[a]', math.inf),
    ],
)
def test_the_degree_in_what_drives_is_known_without_numbers(text, degree):
    """Only what is affine may be a column of a regressor."""
    assert read_formula(text).driven_degree == degree


@pytest.mark.parametrize(
    'text',
    [
        '', '1 +', 'import os', '__import__("os")', 'open("x")', 'q.real', 'q[0]', 'q', 'sin',
        'x[a]', 'lambda: 1', '[1]', '{1}', 'a if b else c', 'a < b', 'a and b', 'not a', 'a // b',
        'a % b', 'a @ b', 'a := 1', 'sin(1, 2)', 'max(1)', 'sin(x=1)', 'sin(*a)', '"text"', '1j',
        'True', 'None', '~a', 'dq[a, b]', 'dq[a:b]', 'f(1)', '1e999', '\0', '(' * 500,
        '-' * 1999 + '1', 'a' * 3000, 'exp.reduce(1)', '9' * 400, 'a; b', 'a\nb',
    ],
)  # fmt: skip
def test_what_is_no_formula_is_refused_in_one_line(text):
    with pytest.raises(ConfigError) as caught:
        read_formula(text)
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize('value', [None, True, [1.0], {'a': 1}])
def test_what_is_neither_text_nor_number_is_refused(value):
    with pytest.raises(ConfigError, match='a text or a number'):
        read_formula(value)


@pytest.mark.parametrize('text', ['1 / a', 'log(-1)', '10.0 ** 1000', '(-1) ** 0.5', '9**9**9'])
def test_a_value_that_is_not_defined_is_not_finite_and_warns_of_nothing(text):
    """Who states the formula checks its value; it takes no time and raises nothing."""
    assert not math.isfinite(read_formula(text).value({'a': 0.0}))
