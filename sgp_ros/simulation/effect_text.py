"""Effects and physical parameters written as text, as on a command line.

An effect is `NAME:joint=J,parameter=value,...`, a physical parameter `NAME=value`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from sgp_ros.errors import ConfigError
from sgp_ros.simulation.effects import (
    ChosenEffect,
    EffectKind,
    EffectParameter,
    ParameterValue,
    Place,
)
from sgp_ros.simulation.registry import EFFECTS

_EXAMPLE = 'write for example coulomb_friction:joint=pole,level=0.01'


def parse_effect(text: str) -> ChosenEffect:
    """Read `NAME:joint=J,parameter=value,...`.

    Raises:
        ConfigError: unknown name, missing, unknown, repeated or wrong parameters; all in one line.
    """
    name, _, rest = text.partition(':')
    kind = _kind(name.strip(), text)
    words: dict[str, str] = {}
    problems = []
    for part in filter(None, (piece.strip() for piece in rest.split(','))):
        key, equals, value = (piece.strip() for piece in part.partition('='))
        if not equals or not value:
            problems.append(f'{part!r} is no name=value')
        elif key in words:
            problems.append(f'{key} is given twice')
        else:
            words[key] = value
    place = kind.place.value if kind.place in {Place.BASE, Place.TOOL} else None
    joint = words.pop('joint', place)
    if joint is None:
        problems.append('joint is missing')
    known = {parameter.name: parameter for parameter in kind.parameters}
    values = {key: _value(known.get(key), word) for key, word in words.items()}
    _refuse(problems + _problems(kind, {**_defaults(kind), **values}), text, kind)
    return ChosenEffect(kind.name, str(joint), values)


def checked_effect(effect: ChosenEffect) -> EffectKind:
    """Return the kind of an effect whose values are complete and right.

    Raises:
        ConfigError: as `parse_effect`.
    """
    kind = _kind(effect.name, effect.name)
    _refuse(
        _problems(kind, {**_defaults(kind), **effect.parameters}),
        f'{effect.name} on {effect.joint}',
        kind,
    )
    return kind


def parse_physical(texts: Iterable[str]) -> dict[str, float]:
    """Read `NAME=value` texts; whether the names exist depends on the robot.

    Raises:
        ConfigError: a text that is no name with a number.
    """
    values = {}
    for text in texts:
        name, _, word = (piece.strip() for piece in text.partition('='))
        number = _number(word)
        if not name or number is None:
            raise ConfigError(
                f'physical parameter {text!r}', 'NAME=number', 'write for example pole_viscosity=0'
            )
        values[name] = number
    return values


def _kind(name: str, text: str) -> EffectKind:
    if name not in EFFECTS:
        raise ConfigError(
            f'effect {text!r} has the unknown name {name!r}', f'one of {list(EFFECTS)}', _EXAMPLE
        )
    return EFFECTS[name]


def _number(word: str) -> float | None:
    try:
        return float(word)
    except ValueError:
        return None


def _value(parameter: EffectParameter | None, word: str) -> ParameterValue:
    number = _number(word)
    is_word = parameter is not None and (bool(parameter.choices) or parameter.is_joint)
    return word if number is None or is_word else number


def _defaults(kind: EffectKind) -> dict[str, ParameterValue]:
    return {p.name: p.default for p in kind.parameters if p.default is not None}


def _problems(kind: EffectKind, values: Mapping[str, ParameterValue]) -> list[str]:
    wanted = [p for p in kind.parameters if p.only_kind in {'', values.get('kind')}]
    known = {parameter.name for parameter in wanted}
    problems = [f'there is no parameter {name}' for name in values if name not in known]
    for parameter in wanted:
        if parameter.name not in values:
            problems.append(f'{parameter.name} is missing')
        elif not _suits(parameter, values[parameter.name]):
            problems.append(f'{parameter.name} = {values[parameter.name]}')
    if not problems and kind.ordered:
        first, second = kind.ordered
        if float(values[first]) >= float(values[second]):
            problems.append(f'{first} is not below {second}')
    return problems


def _suits(parameter: EffectParameter, value: ParameterValue) -> bool:
    if parameter.choices:
        return value in parameter.choices
    if parameter.is_joint:
        return isinstance(value, str)
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return is_number and math.isfinite(float(value)) and float(value) >= parameter.low


def _refuse(problems: list[str], text: str, kind: EffectKind) -> None:
    if problems:
        needed = ', '.join(_description(parameter) for parameter in kind.parameters)
        raise ConfigError(
            f'effect {text!r}: ' + ' | '.join(problems), f'{kind.name}:joint=J with {needed}'
        )


def _description(parameter: EffectParameter) -> str:
    usual = '' if parameter.default is None else f', usually {parameter.default}'
    if parameter.choices:
        return f'{parameter.name} = ' + ' or '.join(parameter.choices) + usual
    if parameter.is_joint:
        return f'{parameter.name} = another joint'
    limit = f' >= {parameter.low:g}' if math.isfinite(parameter.low) else ''
    kind = f' for {parameter.only_kind}' if parameter.only_kind else ''
    return f'{parameter.name}{limit} [{parameter.unit or "1"}]{kind}{usual}'
