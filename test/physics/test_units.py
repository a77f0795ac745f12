"""Units as text, and the unit of what a formula states."""

from __future__ import annotations

import pytest

from sgp_ros.errors import ConfigError
from sgp_ros.physics.formula import read_formula
from sgp_ros.physics.units import read_unit, unit_of, unit_text

SAME = {
    'N m s/rad': 'kg m2/s', 'N m (s/rad)^0.5': 'kg m2/s1.5', 'N m s0.5/rad0.5': 'kg m2/s1.5',
    'N m/(rad/s)': 'kg m2/s', 's^-1': 'Hz', 'N*m': 'Nm', 'N s2/m2': 'kg/m', '1': 'rad',
}  # fmt: skip
WRONG = ('', 'foo', 'N m)', '(N m', 'N m ^', 'N m/', '3')
RIGHT = {
    '-a*abs(dq[e])**0.5*sign(dq[e])': {'a': 'N m s0.5/rad0.5'},
    '-a*tanh(dq[e]/v0)*cos(q[e])': {'a': 'N m', 'v0': 'rad/s'},
    '-a*lag(q[e], T)*step(t - t0)': {'a': 'N m/rad', 'T': 's', 't0': 's'},
    '-k*(q[e] - r*x[s])**3': {'k': 'N m/rad3', 'r': 'rad/m'},
    'c*tau[e]*exp(-(q[e]/w)**2)': {'c': '1', 'w': 'rad'},
    '-a*(abs(dq[e])/v0)**n*sign(dq[e])': {'a': 'N m', 'v0': 'rad/s', 'n': '1'},
}
REFUSED = {
    'tanh(dq[e]/0.05)': 'the argument of tanh in .* has the unit 1/s',
    'a*abs(dq[e])**n': 'the base of .* has the unit 1/s',
    'q[e] + dq[e]': 'combines the units 1 and 1/s',
    'lag(q[e], a)': 'has the unit kg m2/s2',
    'max(q[e], t)': 'combines the units',
}


@pytest.mark.parametrize(('text', 'same'), SAME.items())
def test_one_unit_has_many_texts(text, same):
    """Powers with or without a sign, products, parentheses; angles have none."""
    assert read_unit(text) == read_unit(same)
    assert read_unit(unit_text(read_unit(text))) == read_unit(text)


@pytest.mark.parametrize('text', WRONG)
def test_what_is_no_unit_is_refused(text):
    """In one line that shows one."""
    with pytest.raises(ConfigError, match='unit'):
        read_unit(text)


@pytest.mark.parametrize(('text', 'units'), RIGHT.items())
def test_a_formula_has_the_unit_of_a_force(text, units):
    """A joint that slides has positions in metres."""
    formula = read_formula(text.replace('x[s]', 'q[s]'), is_law=True)
    assert unit_of(formula, units, lambda joint: 'm' if joint == 's' else 'rad') == read_unit(
        'N m'
    )


@pytest.mark.parametrize(('text', 'why'), REFUSED.items())
def test_what_cannot_be_added_or_taken_a_function_of_is_refused(text, why):
    """With the part of the formula that is wrong."""
    formula = read_formula(text, is_law=True)
    units = {'a': 'N m', 'n': '1'}
    with pytest.raises(ConfigError, match=why.replace('(', r'\(')):
        unit_of(formula, units, lambda _joint: 'rad')
