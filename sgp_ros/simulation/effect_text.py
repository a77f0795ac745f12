"""Effects and physical parameters written as text, as on a command line.

An effect is `NAME:joint=J,parameter=value,...`, a physical parameter `NAME=value`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from sgp_ros.errors import ConfigError
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.example import example_effect
from sgp_ros.physics.law import FormulaLaw
from sgp_ros.physics.parts import Value
from sgp_ros.physics.place import BASE, TOOL
from sgp_ros.simulation.effects import EffectParameter, Law
from sgp_ros.simulation.formula_law import formula_law
from sgp_ros.simulation.registry import LAWS

_EXAMPLE = f'write for example {example_effect("pole", 0.01)}'


def parse_effect(text: str) -> EffectAt:
    """Read `NAME:joint=J,parameter=value,...`.

    Raises:
        ConfigError: unknown name, missing, unknown, repeated or wrong parameters; all in one line.
    """
    name, _, rest = text.partition(':')
    effect, law = _known(name.strip(), text)
    words: dict[str, str] = {}
    problems = []
    for part in filter(None, (piece.strip() for piece in rest.split(','))):
        key, equals, value = (piece.strip() for piece in part.partition('='))
        if not equals or not value:
            problems.append(f'{part!r} is not of the form name=value')
        elif key in words:
            problems.append(f'{key} is given twice')
        else:
            words[key] = value
    place = effect.site.value if effect.site in {BASE, TOOL} else None
    joint = words.pop('joint', place)
    if joint is None:
        problems.append('joint is missing')
    parameters = law.parameters(effect)
    known = {parameter.name: parameter for parameter in parameters}
    values = {key: _value(known.get(key), word) for key, word in words.items()}
    _refuse(problems + _problems(law, parameters, values), text, effect.name, parameters)
    return EffectAt.wanted(effect, str(joint), values)


def checked_law(chosen: EffectAt) -> tuple[Effect, Law]:
    """Return the effect of the catalogue and its law, the values being complete and right.

    Raises:
        ConfigError: as `parse_effect`.
    """
    if isinstance(chosen.effect, FormulaLaw):
        return chosen.effect, formula_law(chosen.effect)
    effect, law = _known(chosen.name, chosen.name)
    parameters = law.parameters(effect)
    problems = _problems(law, parameters, chosen.parameters)
    _refuse(problems, f'{chosen.name} on {chosen.joint}', effect.name, parameters)
    return effect, law


def parse_physical(texts: Iterable[str]) -> dict[str, float]:
    """Read `NAME=value` texts; whether the names exist depends on the robot.

    Raises:
        ConfigError: a text that is not a name with a number.
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


def _known(name: str, text: str) -> tuple[Effect, Law]:
    if name not in LAWS:
        raise ConfigError(
            f'effect {text!r} has the unknown name {name!r}', f'one of {list(LAWS)}', _EXAMPLE
        )
    return EFFECTS[name], LAWS[name]


def _number(word: str) -> float | None:
    try:
        return float(word)
    except ValueError:
        return None


def _value(parameter: EffectParameter | None, word: str) -> Value:
    number = _number(word)
    is_word = parameter is not None and (bool(parameter.choices) or parameter.is_joint)
    return word if number is None or is_word else number


def with_defaults(
    parameters: Iterable[EffectParameter], given: Mapping[str, Value]
) -> dict[str, Value]:
    """Return the given values and those of parameters of their kind that have a default."""
    wanted = _of_kind(parameters, given)
    return {p.name: p.default for p in wanted if p.default is not None} | dict(given)


def _of_kind(
    parameters: Iterable[EffectParameter], given: Mapping[str, Value]
) -> list[EffectParameter]:
    """Return the parameters that an effect has by the words among its values."""
    words = {given.get(p.name) for p in parameters if p.choices}
    return [p for p in parameters if not p.kinds or words & set(p.kinds)]


def _problems(
    law: Law, parameters: Iterable[EffectParameter], given: Mapping[str, Value]
) -> list[str]:
    values = with_defaults(parameters, given)
    wanted = _of_kind(parameters, values)
    known = {parameter.name for parameter in wanted}
    problems = [f'there is no parameter {name}' for name in values if name not in known]
    for parameter in wanted:
        if parameter.name not in values:
            problems.append(f'{parameter.name} is missing')
        elif not _suits(parameter, values[parameter.name]):
            problems.append(f'{parameter.name} = {values[parameter.name]}')
    if not problems and law.ordered:
        first, second = law.ordered
        if float(values[first]) >= float(values[second]):
            problems.append(f'{first} is not below {second}')
    return problems


def _suits(parameter: EffectParameter, value: Value) -> bool:
    if parameter.choices:
        return value in parameter.choices
    if parameter.is_joint:
        return isinstance(value, str)
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return is_number and math.isfinite(float(value)) and float(value) >= parameter.low


def _refuse(
    problems: list[str], text: str, name: str, parameters: Iterable[EffectParameter]
) -> None:
    if problems:
        needed = ', '.join(_description(parameter) for parameter in parameters)
        raise ConfigError(
            f'effect {text!r}: ' + ' | '.join(problems), f'{name}:joint=J with {needed}'
        )


def _description(parameter: EffectParameter) -> str:
    usual = '' if parameter.default is None else f', usually {parameter.default}'
    if parameter.choices:
        return f'{parameter.name} = ' + ' or '.join(parameter.choices) + usual
    if parameter.is_joint:
        return f'{parameter.name} = another joint'
    limit = f' >= {parameter.low:g}' if math.isfinite(parameter.low) else ''
    kind = f' for {" or ".join(parameter.kinds)}' if parameter.kinds else ''
    return f'{parameter.name}{limit} [{parameter.unit or "1"}]{kind}{usual}'
