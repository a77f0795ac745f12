"""Typed reading of a mapping from a robot YAML, which lists all that is wrong with it."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from sgp_ros.errors import ConfigError
from sgp_ros.physics.formula import Formula, read_formula
from sgp_ros.strangers import LEAST, is_usable


@dataclass(frozen=True, slots=True)
class Entries:
    """Entries of a mapping; a wrong one is described in `problems` and read as a default.

    Attributes:
        document: the mapping.
        problems: collected so far, also those of others.
        prefix: of the keys in messages.
    """

    document: Mapping[Any, Any]
    problems: list[str]
    prefix: str = ''

    def refuse_others(self, known: Collection[str]) -> None:
        """Complain of keys that mean nothing."""
        self.problems.extend(
            f'unknown key {self.prefix + str(key)!r}' for key in self.document if key not in known
        )

    def text(self, key: str, default: str) -> str:
        """Return a text that is not empty."""
        value = self.document.get(key, default)
        if not isinstance(value, str) or not value:
            return self._wrong(key, value, 'a text', default)
        return value

    def names(self, key: str) -> list[str] | None:
        """Return a list of names; None where there is none."""
        value = self.document.get(key)
        if value is not None and not (
            isinstance(value, list) and all(isinstance(name, str) for name in value)
        ):
            return self._wrong(key, value, 'a list of names', None)
        return value

    def mapping(self, key: str) -> Mapping[Any, Any] | None:
        """Return a mapping; None where there is none."""
        value = self.document.get(key)
        if value is not None and not isinstance(value, dict):
            return self._wrong(key, value, 'a mapping', None)
        return value

    def numbers(self, key: str) -> dict[str, float]:
        """Return a mapping from names to finite numbers, possibly empty."""
        value = self.document.get(key, {})
        if not isinstance(value, dict) or not all(
            isinstance(name, str) and is_usable(number) and (number == 0.0 or abs(number) >= LEAST)
            for name, number in value.items()
        ):
            return self._wrong(key, value, 'a mapping from names to numbers', {})
        return {name: float(number) for name, number in value.items()}

    def positive(self, key: str, default: float | None) -> float:
        """Return a positive number; without a default it must be there."""
        value = self.document.get(key, default)
        if not is_positive(value):
            return self._wrong(key, value, 'a positive number', 1.0)
        return float(value)

    def formula(self, key: str, names: Collection[str]) -> Formula | None:
        """Return a formula of known names, 0 where there is none; None where it is wrong."""
        try:
            formula = read_formula(self.document.get(key, 0.0))
        except ConfigError as error:
            self.problems.append(f'{self.prefix}{key}: {error}')
            return None
        if formula.signals or not formula.parameters <= set(names):
            self.problems.append(
                f'{self.prefix}{key} is {formula.text!r}; it may use only {sorted(names)}'
            )
            return None
        return formula

    def vector(self, key: str, size: int) -> tuple[float, ...]:
        """Return a list of finite numbers; zeros where there is none."""
        value = self.document.get(key, [0.0] * size)
        if not isinstance(value, list) or len(value) != size or not all(map(is_usable, value)):
            return self._wrong(key, value, f'{size} numbers', (0.0,) * size)
        return tuple(float(number) for number in value)

    def _wrong(self, key: str, value: object, expected: str, default: Any) -> Any:
        self.problems.append(f'{self.prefix}{key} is {value!r}, not {expected}')
        return default


def is_positive(value: object) -> bool:
    """Whether a value of a YAML file is a positive number that one can divide by."""
    return is_usable(value) and value >= LEAST  # type: ignore[operator]  # a number by now
