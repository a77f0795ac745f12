"""Formulas as text, such as `level * sign(dq[elbow])`, read by a grammar and never run as code.

A formula is made of

- `q[J]`, `dq[J]`, `ddq[J]`, `tau[J]`: position, velocity, acceleration and effort of joint J,
  whose name stands in quotes unless it is a plain word: `q["arm-1"]`;
- numbers and named parameters;
- `+ - * / **`, parentheses, and the functions of `FUNCTIONS`;
- in a law of force also `t`, the time since the beginning of a recording, and functions that
  remember: `lag(x, T)`, `play(x, width)` over the full width, `delay(x, T)`.

The standard library parses the text; whatever is not in this list is refused. What is left
becomes nested NumPy functions, so a formula costs what the same expression costs in Python.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from sgp_ros.errors import ConfigError
from sgp_ros.physics.grammar import (
    EXPECTED,
    FUNCTIONS,
    LONGEST,
    OPERATORS,
    SIGNALS,
    SIGNS,
    Contents,
    combined,
    signal_of,
)
from sgp_ros.physics.term import Motion

Place = TypeVar('Place')
"""Point at which a formula is evaluated, such as a motion or a mapping of values."""
T = TypeVar('T')
Special = Callable[[str, frozenset[tuple[str, str]]], Callable[..., object] | None]
"""From a function and the signals in its arguments to what takes a place and these arguments."""


@dataclass(frozen=True, slots=True)
class Formula:
    """An expression that was found to follow the grammar.

    Attributes:
        text: as it was written.
        parameters: names in it that stand for numbers.
        signals: pairs such as `('dq', 'elbow')`; `('t', '')` for the time.
        functions: names of those in it.
        driven_degree: its degree as a polynomial in accelerations and efforts; 0 without them, 1
            where it is affine, infinite where it is not a polynomial.

    Examples:
        >>> friction = read_formula('level * sign(dq[elbow])')
        >>> sorted(friction.parameters), sorted(friction.signals)
        (['level'], [('dq', 'elbow')])
        >>> read_formula('2 * mass ** 2').value({'mass': 3.0})
        18.0
    """

    text: str
    parameters: frozenset[str]
    signals: frozenset[tuple[str, str]]
    functions: frozenset[str]
    driven_degree: float
    _tree: ast.expr = field(repr=False, compare=False)

    def compiled(
        self,
        parameter: Callable[[str], Callable[[Place], object]],
        signal: Callable[[str, str], Callable[[Place], object]],
        special: Special = lambda _name, _signals: None,
    ) -> Callable[[Place], object]:
        """Return the formula as a function of a place.

        Args:
            parameter: from the name of a parameter to its value at a place.
            signal: likewise from a signal and a joint.
            special: what stands for a function of `FUNCTIONS` or `MEMORY`; None for the usual.
        """
        return _closure(self._tree, parameter, signal, special)

    def folded(self, leaf: Callable[[ast.expr], T], inner: Callable[[ast.expr, list[T]], T]) -> T:
        """Return what a rule makes of the formula, from its names and numbers upwards.

        Args:
            leaf: value of a number, a name or a signal.
            inner: value of an operation or a function of the values of its parts.
        """
        return _folded(self._tree, leaf, inner)

    def linear(self, names: Sequence[str]) -> tuple[str, ...]:
        """Return parameters c of which the formula is `sum_i c_i g_i`, as many as there are.

        Empty where some part of it has none of them as a factor.
        """
        chosen: tuple[str, ...] = ()
        for name in names:
            if _degrees(self._tree, {*chosen, name})[1] <= 1.0:
                chosen += (name,)
        return chosen if chosen and _degrees(self._tree, set(chosen)) == (1.0, 1.0) else ()

    def value(self, values: Mapping[str, float]) -> float:
        """Return the value without a motion; not finite where none is defined.

        Args:
            values: by name, at least of `parameters`.
        """
        evaluate: Callable[[Mapping[str, float]], object] = self.compiled(
            lambda name: lambda given: np.float64(given[name]), _no_signal
        )
        with np.errstate(all='ignore'):
            return float(evaluate(values))  # type: ignore[arg-type]  # numbers all through

    def column(self, joints: Sequence[str]) -> Callable[[Motion], np.ndarray]:
        """Return the formula as a function from a motion of n times to (n,).

        Args:
            joints: of the motion, among them all of `signals`.
        """

        def signal(name: str, joint: str) -> Callable[[Motion], object]:
            channel, index = SIGNALS[name], list(joints).index(joint)
            return lambda motion: getattr(motion, channel)[:, index]

        evaluate: Callable[[Motion], object] = self.compiled(_no_parameter, signal)
        return lambda motion: np.asarray(evaluate(motion), dtype=np.float64)


def read_formula(text: object, *, is_law: bool = False) -> Formula:
    """Return the formula that a text or a number states.

    Args:
        text: of the formula.
        is_law: whether it is a law of force, which may see the time and remember.

    Raises:
        ConfigError: neither of the two, or the text is not a formula; it says which part.
    """
    if isinstance(text, bool) or not isinstance(text, (str, int, float)):
        raise ConfigError(f'formula {text!r}', 'a text or a number')
    written = text if isinstance(text, str) else repr(float(text))
    if len(written) > LONGEST:
        raise ConfigError(f'a formula of {len(written)} characters', f'at most {LONGEST}')
    try:
        tree = ast.parse(written.strip(), mode='eval').body
        found = Contents(written, is_law)
        degree = found.degree(tree)
    except (SyntaxError, ValueError, RecursionError, MemoryError, OverflowError) as error:
        raise ConfigError(f'formula {written!r} cannot be read', EXPECTED) from error
    return Formula(
        written.strip(), frozenset(found.parameters), frozenset(found.signals),
        frozenset(found.functions), degree, tree,
    )  # fmt: skip


def _folded(
    node: ast.expr, leaf: Callable[[ast.expr], T], inner: Callable[[ast.expr, list[T]], T]
) -> T:
    parts = _parts(node)
    return inner(node, [_folded(p, leaf, inner) for p in parts]) if parts else leaf(node)


def _parts(node: ast.expr) -> list[ast.expr]:
    if isinstance(node, ast.UnaryOp):
        return [node.operand]
    if isinstance(node, ast.BinOp):
        return [node.left, node.right]
    return node.args if isinstance(node, ast.Call) else []


def _degrees(tree: ast.expr, names: Collection[str]) -> tuple[float, float]:
    """Return the least and the greatest degree in some parameters; infinite for no polynomial."""

    def leaf(node: ast.expr) -> tuple[float, float]:
        here = float(isinstance(node, ast.Name) and node.id in names)
        return here, here

    def inner(node: ast.expr, parts: list[tuple[float, float]]) -> tuple[float, float]:
        if isinstance(node, ast.UnaryOp):
            return parts[0]
        if isinstance(node, ast.BinOp):
            (a, b), (c, d) = parts
            is_sum = isinstance(node.op, (ast.Add, ast.Sub))
            return min(a, c) if is_sum else combined(node, a, c), combined(node, b, d)
        return (0.0, 0.0) if max(b for _, b in parts) == 0.0 else (0.0, math.inf)

    return _folded(tree, leaf, inner)


def _closure(
    node: ast.expr,
    parameter: Callable[[str], Callable[[Place], object]],
    signal: Callable[[str, str], Callable[[Place], object]],
    special: Special = lambda _name, _signals: None,
) -> Callable[[Place], object]:
    def of(part: ast.expr) -> Callable[[Place], object]:
        return _closure(part, parameter, signal, special)

    if isinstance(node, ast.Constant):
        number = np.float64(node.value)  # type: ignore[arg-type]  # checked to be a number
        return lambda _: number
    if isinstance(node, ast.Name):
        return parameter(node.id)
    if isinstance(node, ast.Subscript):
        found = signal_of(node)
        assert found is not None
        return signal(*found)
    parts = [of(part) for part in _parts(node)]
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        nodes = [x for x in ast.walk(node) if isinstance(x, ast.expr)]
        own = special(node.func.id, frozenset(found for x in nodes if (found := signal_of(x))))
        if own is not None:
            return lambda place: own(place, *(part(place) for part in parts))
    combine = _operation(node)
    return lambda place: combine(*(part(place) for part in parts))


def _operation(node: ast.expr) -> Callable[..., object]:
    if isinstance(node, ast.UnaryOp):
        return SIGNS[type(node.op)]
    if isinstance(node, ast.BinOp):
        return OPERATORS[type(node.op)]
    assert isinstance(node, ast.Call)
    assert isinstance(node.func, ast.Name)
    return FUNCTIONS[node.func.id]


def _no_parameter(name: str) -> Callable[[Place], object]:
    raise ValueError(f'parameter {name!r} in the column of a regressor')


def _no_signal(name: str, joint: str) -> Callable[[Place], object]:
    raise ValueError(f'signal {name}[{joint}] without a motion')
