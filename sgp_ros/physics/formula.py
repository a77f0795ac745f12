"""Formulas as text, such as `level * sign(dq[elbow])`, read by a grammar and never run as code.

A formula is made of

- `q[J]`, `dq[J]`, `ddq[J]`, `tau[J]`: position, velocity, acceleration and effort of joint J,
  whose name stands in quotes where it is no plain word: `q["arm-1"]`;
- numbers and named parameters;
- `+ - * / **`, parentheses, and the functions of `FUNCTIONS`.

The standard library parses the text; whatever is not in this list is refused. What is left
becomes nested NumPy functions, so a formula costs what the same expression costs in Python.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from sgp_ros.errors import ConfigError
from sgp_ros.physics.term import Motion

SIGNALS: Mapping[str, str] = {
    'q': 'position', 'dq': 'velocity', 'ddq': 'acceleration', 'tau': 'effort',
}  # fmt: skip
"""Names of signals to the channels of a `Motion`."""
DRIVEN = ('ddq', 'tau')
"""Signals in which a regressor may be affine only."""
FUNCTIONS: Mapping[str, np.ufunc] = {
    'abs': np.abs, 'sign': np.sign, 'sin': np.sin, 'cos': np.cos, 'exp': np.exp, 'log': np.log,
    'sqrt': np.sqrt, 'tanh': np.tanh, 'min': np.minimum, 'max': np.maximum,
}  # fmt: skip
_OPERATORS: Mapping[type[ast.operator], Callable[..., object]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul,
    ast.Div: operator.truediv, ast.Pow: operator.pow,
}  # fmt: skip
_SIGNS: Mapping[type[ast.unaryop], Callable[..., object]] = {
    ast.UAdd: operator.pos, ast.USub: operator.neg,
}  # fmt: skip
_LONGEST = 2000
"""Characters of a formula."""
_EXPECTED = (
    f'numbers, parameters, {", ".join(f"{name}[J]" for name in SIGNALS)}, + - * / ** '
    f'and the functions {", ".join(FUNCTIONS)}'
)

Place = TypeVar('Place')
"""What a formula is evaluated on, such as a motion or a mapping of values."""


@dataclass(frozen=True, slots=True)
class Formula:
    """An expression that was found to follow the grammar.

    Attributes:
        text: as it was written.
        parameters: names in it that stand for numbers.
        signals: pairs such as `('dq', 'elbow')`.
        driven_degree: its degree as a polynomial in accelerations and efforts; 0 without them, 1
            where it is affine, infinite where it is no polynomial.

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
    driven_degree: float
    _tree: ast.expr = field(repr=False, compare=False)

    def compiled(
        self,
        parameter: Callable[[str], Callable[[Place], object]],
        signal: Callable[[str, str], Callable[[Place], object]],
    ) -> Callable[[Place], object]:
        """Return the formula as a function of a place.

        Args:
            parameter: from the name of a parameter to its value at a place.
            signal: likewise from a signal and a joint.
        """
        return _closure(self._tree, parameter, signal)

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


def read_formula(text: object) -> Formula:
    """Return the formula that a text or a number states.

    Raises:
        ConfigError: neither of the two, or the text is no formula; it says which part of it.
    """
    if isinstance(text, bool) or not isinstance(text, (str, int, float)):
        raise ConfigError(f'formula {text!r}', 'a text or a number')
    written = text if isinstance(text, str) else repr(float(text))
    if len(written) > _LONGEST:
        raise ConfigError(f'a formula of {len(written)} characters', f'{_LONGEST} at most')
    try:
        tree = ast.parse(written.strip(), mode='eval').body
        parameters: set[str] = set()
        signals: set[tuple[str, str]] = set()
        degree = _checked(tree, written, parameters, signals)
    except (SyntaxError, ValueError, RecursionError, MemoryError, OverflowError) as error:
        raise ConfigError(f'formula {written!r} cannot be read', _EXPECTED) from error
    return Formula(written, frozenset(parameters), frozenset(signals), degree, tree)


def _checked(
    node: ast.expr, text: str, parameters: set[str], signals: set[tuple[str, str]]
) -> float:
    """Return the degree of a node in accelerations and efforts; note what it is made of."""

    def degree(part: ast.expr) -> float:
        return _checked(part, text, parameters, signals)

    if isinstance(node, ast.UnaryOp) and type(node.op) in _SIGNS:
        return degree(node.operand)
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        return _combined(node, degree(node.left), degree(node.right))
    if isinstance(node, ast.Call) and _is_known(node):
        return 0.0 if max(map(degree, node.args)) == 0.0 else math.inf
    if isinstance(node, ast.Name) and node.id not in FUNCTIONS and node.id not in SIGNALS:
        parameters.add(node.id)
        return 0.0
    signal = _signal(node)
    if signal is not None:
        signals.add(signal)
        return 1.0 if signal[0] in DRIVEN else 0.0
    if _is_number(node):
        return 0.0
    raise ConfigError(f'{ast.unparse(node)!r} in the formula {text!r}', _EXPECTED)


def _combined(node: ast.BinOp, left: float, right: float) -> float:
    if isinstance(node.op, (ast.Add, ast.Sub)):
        return max(left, right)
    if isinstance(node.op, ast.Mult):
        return left + right
    if isinstance(node.op, ast.Div):
        return math.inf if right else left
    return math.inf if left or right else 0.0


def _signal(node: ast.expr) -> tuple[str, str] | None:
    """Return signal and joint of `dq[J]`; None where it is something else."""
    if not isinstance(node, ast.Subscript) or not isinstance(node.value, ast.Name):
        return None
    name, joint = node.value.id, node.slice
    if name in SIGNALS and isinstance(joint, ast.Name):
        return name, joint.id
    if name in SIGNALS and isinstance(joint, ast.Constant) and isinstance(joint.value, str):
        return name, joint.value
    return None


def _is_number(node: ast.expr) -> bool:
    if not isinstance(node, ast.Constant) or type(node.value) not in {int, float}:
        return False
    return math.isfinite(float(node.value))  # type: ignore[arg-type]  # a number


def _is_known(call: ast.Call) -> bool:
    """Whether it is a known function of as many arguments as it takes."""
    function = FUNCTIONS.get(call.func.id) if isinstance(call.func, ast.Name) else None
    return function is not None and not call.keywords and function.nin == len(call.args)


def _closure(
    node: ast.expr,
    parameter: Callable[[str], Callable[[Place], object]],
    signal: Callable[[str, str], Callable[[Place], object]],
) -> Callable[[Place], object]:
    def of(part: ast.expr) -> Callable[[Place], object]:
        return _closure(part, parameter, signal)

    if isinstance(node, ast.Constant):
        number = np.float64(node.value)  # type: ignore[arg-type]  # checked to be a number
        return lambda _: number
    if isinstance(node, ast.Name):
        return parameter(node.id)
    if isinstance(node, ast.Subscript):
        found = _signal(node)
        assert found is not None
        return signal(*found)
    if isinstance(node, ast.UnaryOp):
        sign, operand = _SIGNS[type(node.op)], of(node.operand)
        return lambda place: sign(operand(place))
    if isinstance(node, ast.BinOp):
        combine, left, right = _OPERATORS[type(node.op)], of(node.left), of(node.right)
        return lambda place: combine(left(place), right(place))
    assert isinstance(node, ast.Call)
    assert isinstance(node.func, ast.Name)
    function, parts = FUNCTIONS[node.func.id], [of(part) for part in node.args]
    return lambda place: function(*(part(place) for part in parts))


def _no_parameter(name: str) -> Callable[[Place], object]:
    raise ValueError(f'parameter {name!r} in the column of a regressor')


def _no_signal(name: str, joint: str) -> Callable[[Place], object]:
    raise ValueError(f'signal {name}[{joint}] without a motion')
