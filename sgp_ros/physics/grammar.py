"""The grammar of formulas: what may stand in one, and what it is made of.

`formula` says it in words. The standard library has parsed the text by then; each node of its
tree is looked at here, and refused unless it is known.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from sgp_ros.errors import ConfigError

SIGNALS: Mapping[str, str] = {
    'q': 'position', 'dq': 'velocity', 'ddq': 'acceleration', 'tau': 'effort',
}  # fmt: skip
"""Names of signals to the channels of a `Motion`."""
DRIVEN = ('ddq', 'tau')
"""Signals in which a regressor may be affine only."""
FUNCTIONS: Mapping[str, Callable[..., object]] = {
    'abs': np.abs, 'sign': np.sign, 'sin': np.sin, 'cos': np.cos, 'exp': np.exp, 'log': np.log,
    'sqrt': np.sqrt, 'tanh': np.tanh, 'min': np.minimum, 'max': np.maximum,
    'step': lambda x: np.heaviside(x, 0.5),
}  # fmt: skip
MEMORY = ('lag', 'play', 'delay')
"""Functions of a signal and a constant that see earlier times too."""
TIME = 't'
"""Time since the beginning of a recording [s]."""
_PAIRS = ('min', 'max', *MEMORY)
"""Functions of two arguments; all others have one."""
OPERATORS: Mapping[type[ast.operator], Callable[..., object]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul,
    ast.Div: operator.truediv, ast.Pow: operator.pow,
}  # fmt: skip
SIGNS: Mapping[type[ast.unaryop], Callable[..., object]] = {
    ast.UAdd: operator.pos, ast.USub: operator.neg,
}  # fmt: skip
LONGEST = 2000
"""Characters of a formula."""
EXPECTED = (
    f'numbers, parameters, {", ".join(f"{name}[J]" for name in SIGNALS)}, + - * / ** '
    f'and the functions {", ".join(FUNCTIONS)}'
)


@dataclass(slots=True)
class Contents:
    """Contents of a text, noted while it is checked."""

    text: str
    is_law: bool
    parameters: set[str] = field(default_factory=set)
    signals: set[tuple[str, str]] = field(default_factory=set)
    functions: set[str] = field(default_factory=set)

    def degree(self, node: ast.expr) -> float:
        """Return the degree of a node in accelerations and efforts; note what it is made of."""
        if isinstance(node, ast.UnaryOp) and type(node.op) in SIGNS:
            return self.degree(node.operand)
        if isinstance(node, ast.BinOp) and type(node.op) in OPERATORS:
            return combined(node, self.degree(node.left), self.degree(node.right))
        if isinstance(node, ast.Call) and self._is_known(node):
            self.functions.add(node.func.id)  # type: ignore[attr-defined]  # a name, as checked
            return 0.0 if max(map(self.degree, node.args)) == 0.0 else math.inf
        signal = signal_of(node, is_law=self.is_law)
        if signal is not None:
            self.signals.add(signal)
            return 1.0 if signal[0] in DRIVEN else 0.0
        taken = {*FUNCTIONS, *SIGNALS} | ({*MEMORY} if self.is_law else set())
        if isinstance(node, ast.Name) and node.id not in taken:
            self.parameters.add(node.id)
            return 0.0
        if is_number(node):
            return 0.0
        expected = f'{EXPECTED}, {TIME}, {", ".join(MEMORY)}' if self.is_law else EXPECTED
        raise ConfigError(
            f'{ast.unparse(node)!r} is not allowed in the formula {self.text!r}', expected
        )

    def _is_known(self, call: ast.Call) -> bool:
        """Whether it is a known function of as many arguments as it takes."""
        name = call.func.id if isinstance(call.func, ast.Name) else ''
        if call.keywords or len(call.args) != (2 if name in _PAIRS else 1):
            return False
        if name in MEMORY and self.is_law:
            return not any(signal_of(x) for x in ast.walk(call.args[1]) if isinstance(x, ast.expr))
        return name in FUNCTIONS


def combined(node: ast.BinOp, left: float, right: float) -> float:
    """Return the degree of an operation from those of its sides; infinite for no polynomial."""
    if isinstance(node.op, (ast.Add, ast.Sub)):
        return max(left, right)
    if isinstance(node.op, ast.Mult):
        return left + right
    if isinstance(node.op, ast.Div):
        return math.inf if right else left
    return math.inf if left or right else 0.0


def signal_of(node: ast.expr, *, is_law: bool = True) -> tuple[str, str] | None:
    """Return signal and joint of `dq[J]`; None where it is something else."""
    if is_law and isinstance(node, ast.Name) and node.id == TIME:
        return TIME, ''
    if not isinstance(node, ast.Subscript) or not isinstance(node.value, ast.Name):
        return None
    name, joint = node.value.id, node.slice
    if name in SIGNALS and isinstance(joint, ast.Name):
        return name, joint.id
    if name in SIGNALS and isinstance(joint, ast.Constant) and isinstance(joint.value, str):
        return name, joint.value
    return None


def is_number(node: ast.expr) -> bool:
    """Return whether a node is a finite number."""
    if not isinstance(node, ast.Constant) or type(node.value) not in {int, float}:
        return False
    return math.isfinite(float(node.value))  # type: ignore[arg-type]  # a number
