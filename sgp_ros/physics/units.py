"""Units of formulas: read from text, and checked from the signals upwards.

A unit is a product of powers of kilogram, metre and second. An angle has none, so that `sin(q)`
and `q**2` may stand in one sum; a number but 0 has none either: what has a unit needs a name.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction
from itertools import accumulate

from sgp_ros.errors import ConfigError
from sgp_ros.physics.formula import Formula
from sgp_ros.physics.grammar import TIME, signal_of

Unit = tuple[Fraction, Fraction, Fraction]
"""Powers of kg, m, s."""

_BASE: Mapping[str, tuple[int, int, int]] = {
    '1': (0, 0, 0), 'rad': (0, 0, 0), 'revolution': (0, 0, 0), 'kg': (1, 0, 0), 'm': (0, 1, 0),
    's': (0, 0, 1), 'N': (1, 1, -2), 'Nm': (1, 2, -2), 'Hz': (0, 0, -1), 'J': (1, 2, -2),
    'W': (1, 2, -3), 'Pa': (1, -1, -2),
}  # fmt: skip
_TOKEN = re.compile(
    r'\s*(?:(?P<word>[A-Za-z]+|1)|(?P<sign>[/()]))(?:\^?(?P<power>-?\d+(?:\.\d+)?))?'
)
_NONE: Unit = (Fraction(0), Fraction(0), Fraction(0))
_KEPT = ('abs', 'min', 'max', 'lag', 'play', 'delay')
"""Functions whose value has the unit of their arguments."""
_CONSTANTS = {'lag': ('s', (0, 0, 1)), 'delay': ('s', (0, 0, 1))}
_EXAMPLE = 'a unit such as N m s/rad, N m s2/rad2, kg m2, rad, 1'


def read_unit(text: str) -> Unit:
    """Return the unit that a text states.

    Raises:
        ConfigError: it is none.

    Examples:
        >>> read_unit('N m s0.5/rad0.5') == read_unit('kg m^2 / s^1.5')
        True
        >>> read_unit('1/s') == read_unit('Hz') == read_unit('s^-1')
        True
    """
    plain = re.sub(r'[·*]', ' ', text.replace('**', '^').replace('²', '2').replace('³', '3'))
    tokens, at = list[re.Match[str]](), 0
    while plain[at:].strip():
        match = _TOKEN.match(plain, at)
        if match is None or (match['word'] and match['word'] not in _BASE):
            raise ConfigError(f'unknown {plain[at:].strip()!r} in the unit {text!r}', _EXAMPLE)
        tokens.append(match)
        at = match.end()
    steps = [{'(': 1, ')': -1}.get(t['sign'], 0) for t in tokens]
    depths = list(accumulate(steps))
    if not tokens or depths[-1] != 0 or min(depths) < 0 or tokens[-1]['sign'] == '/':
        raise ConfigError(f'unit {text!r}', _EXAMPLE)
    return _product(iter(tokens))[0]


def _product(tokens: Iterator[re.Match[str]]) -> tuple[Unit, Fraction]:
    """Return the product up to the end or a closing parenthesis, and the power behind it."""
    found, sign = _NONE, 1
    for token in tokens:
        power = Fraction(token['power'] or 1)
        if token['sign'] == ')':
            return found, power
        if token['sign'] == '/':
            sign = -1
            continue
        if token['word']:
            kg, m, s = _BASE[token['word']]
            part: Unit = Fraction(kg), Fraction(m), Fraction(s)
        else:
            part, power = _product(tokens)
        power *= sign
        found = (
            found[0] + power * part[0], found[1] + power * part[1], found[2] + power * part[2]
        )  # fmt: skip
    return found, Fraction(1)


def unit_text(unit: Unit) -> str:
    """Return a unit as text.

    Examples:
        >>> unit_text(read_unit('N m s/rad'))
        'kg m2/s'
    """
    over, under = (
        ' '.join(
            f'{name}{"" if abs(p) == 1 else format(float(abs(p)), "g")}'
            for name, p in zip(('kg', 'm', 's'), unit, strict=True) if p * sign > 0
        )
        for sign in (1, -1)
    )  # fmt: skip
    return (over or '1') + (f'/{under}' if under else '')


def unit_of(
    formula: Formula, parameters: Mapping[str, str], length_of: Callable[[str], str]
) -> Unit:
    """Return the unit of what a formula states.

    Args:
        formula: to look at.
        parameters: unit by name.
        length_of: unit of the position of a joint, `rad` or `m`.

    Raises:
        ConfigError: a sum of different units, or a function or power of what has a unit.
    """

    def leaf(node: ast.expr) -> Unit:
        found = signal_of(node)
        if found is not None and (found[0] != TIME or found in formula.signals):
            kind, joint = found
            length = length_of(joint) if joint else ''
            effort = 'N m' if length == 'rad' else 'N'
            signal_units = {'q': length, 'dq': f'{length}/s', 'ddq': f'{length}/s2', 'tau': effort}
            return read_unit((signal_units | {TIME: 's'})[kind])
        return read_unit(parameters[node.id]) if isinstance(node, ast.Name) else _NONE

    def inner(node: ast.expr, parts: list[Unit]) -> Unit:
        if isinstance(node, ast.UnaryOp):
            return parts[0]
        if isinstance(node, ast.BinOp):
            return _of_operation(node, parts[0], parts[1])
        assert isinstance(node, ast.Call)
        assert isinstance(node.func, ast.Name)
        return _of_function(node, node.func.id, parts)

    return formula.folded(leaf, inner)


def _of_operation(node: ast.BinOp, left: Unit, right: Unit) -> Unit:
    if isinstance(node.op, (ast.Add, ast.Sub)):
        _require_same(node, left, right)
        return left
    if isinstance(node.op, ast.Pow):
        power = _number(node.right)
        if left == _NONE and right == _NONE:
            return _NONE
        if power is None:
            raise ConfigError(
                f'the base of {ast.unparse(node)!r} has the unit {unit_text(left)}',
                'a number as the exponent, or a base without unit: divide it by a parameter',
            )
        return left[0] * power, left[1] * power, left[2] * power
    sign = 1 if isinstance(node.op, ast.Mult) else -1
    return left[0] + sign * right[0], left[1] + sign * right[1], left[2] + sign * right[2]


def _number(node: ast.expr) -> Fraction | None:
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        inner = _number(node.operand)
        return None if inner is None else -inner
    if not isinstance(node, ast.Constant) or not isinstance(node.value, (int, float)):
        return None
    return Fraction(node.value).limit_denominator(1000)


def _of_function(node: ast.Call, name: str, parts: list[Unit]) -> Unit:
    if name in _CONSTANTS:
        expected = tuple(Fraction(x) for x in _CONSTANTS[name][1])
        if parts[1] != expected:
            raise ConfigError(
                f'{ast.unparse(node.args[1])!r} in {ast.unparse(node)!r} has the unit '
                f'{unit_text(parts[1])}', _CONSTANTS[name][0],
            )  # fmt: skip
        return parts[0]
    if name in _KEPT:
        there = [x for x, part in zip(parts, node.args, strict=True) if not _is_zero(part)]
        for other in there[1:]:
            _require_same(node, there[0], other)
        return there[0] if there else _NONE
    if name == 'sqrt':
        return parts[0][0] / 2, parts[0][1] / 2, parts[0][2] / 2
    if name in {'sign', 'step'}:
        return _NONE
    if parts[0] != _NONE:
        raise ConfigError(
            f'the argument of {name} in {ast.unparse(node)!r} has the unit {unit_text(parts[0])}',
            'an argument without unit: divide it by a parameter of the same unit',
        )
    return _NONE


def _is_zero(node: ast.expr) -> bool:
    """Return whether a node is the number 0, which has any unit."""
    return isinstance(node, ast.Constant) and node.value == 0


def _require_same(node: ast.expr, left: Unit, right: Unit) -> None:
    if left != right:
        raise ConfigError(
            f'{ast.unparse(node)!r} combines the units {unit_text(left)} and {unit_text(right)}',
            'one unit',
        )
