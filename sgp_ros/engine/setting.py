"""Declaration of one setting before it has a value: type, unit, range, default."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import cast

from sgp_ros.engine.samples import SettingValue

KINDS = {
    'bool': 'true or false',
    'int': 'an integer',
    'float': 'a number',
    'str': 'a string',
    'float_array': 'a list of numbers',
    'str_array': 'a list of strings',
}

EFFORT_SOURCES = {
    'auto': 'auto', 'measured': 'state', 'commanded': 'command', 'state': 'state',
    'command': 'command',
}  # fmt: skip
"""Choices of `--effort` of the commands, to the value of the setting `effort.source`."""


@dataclass(frozen=True, slots=True)
class Setting:
    """Declaration of one setting before it has a value.

    Attributes:
        name: dotted name, such as `filter.window`.
        kind: a key of `KINDS`.
        default: the value when none is given.
        description: one sentence for `ros2 param describe`.
        unit: SI unit, empty for none.
        low, high: inclusive range of a number.
        choices: the only values of a string, empty for any.
        read_only: whether a running node refuses to change it.
    """

    name: str
    kind: str
    default: SettingValue
    description: str
    unit: str = ''
    low: float = -math.inf
    high: float = math.inf
    choices: Collection[str] = ()
    read_only: bool = False

    def problem(self, value: object) -> str | None:
        """Say what is wrong with `value`, or None."""
        prefix = f'{self.name} = {value!r}: expected {self._expected()}'
        if not has_kind(value, self.kind):
            return prefix
        numbers: Iterable[object] = value if isinstance(value, (list, tuple)) else (value,)
        for number in numbers:
            if isinstance(number, (int, float)) and not isinstance(number, bool):
                if not _is_finite(number) or not self.low <= number <= self.high:
                    return prefix
            elif self.choices and number not in self.choices:
                return prefix
        return None

    def convert(self, value: object) -> SettingValue:
        """Return `value` in the type the dataclass holds, once `problem` is None."""
        if self.kind == 'float':
            return float(cast('float', value))
        if self.kind == 'float_array':
            return tuple(float(number) for number in cast('Iterable[float]', value))
        if self.kind == 'str_array':
            return tuple(cast('Iterable[str]', value))
        return cast('SettingValue', value)

    def _expected(self) -> str:
        text = KINDS[self.kind]
        if self.choices:
            text += ', one of ' + ', '.join(self.choices)
        if math.isfinite(self.low) and math.isfinite(self.high):
            text += f' from {self.low:g} to {self.high:g}'
        elif math.isfinite(self.low):
            text += f' of at least {self.low:g}'
        return f'{text} [{self.unit}]' if self.unit else text


def _is_finite(number: float) -> bool:
    """Whether a number has a finite float; an integer may be too large for one."""
    try:
        return math.isfinite(number)
    except OverflowError:
        return False


def has_kind(value: object, kind: str) -> bool:
    """Whether `value` is of a kind out of `KINDS`."""
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if kind == 'bool':
        return isinstance(value, bool)
    if kind == 'int':
        return isinstance(value, int) and not isinstance(value, bool)
    if kind == 'float':
        return number
    if kind == 'str':
        return isinstance(value, str)
    if not isinstance(value, (list, tuple)):
        return False
    return all(has_kind(item, kind.removesuffix('_array')) for item in value)
