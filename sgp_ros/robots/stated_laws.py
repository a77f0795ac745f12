"""Laws of force that a robot YAML states by formulas, beside the effects of the catalogue.

    effects:
      - law:
          joint: elbow
          formula: -a*abs(dq[elbow])**0.5*sign(dq[elbow])
          parameters:
            a: {start: 0.3, unit: N m s0.5/rad0.5, range: [0, 5]}

A parameter with a `value` is known. A law with parameters that have a `start` instead is one that
the robot may have: a diagnosis tries it beside all others, with values from the range. One of the
tool says along which path it acts, `F_distance[tool] = a + b*s`, see `physics.tool_law`; where
`ax`, `ay` and `az` are not stated it acts on `tool0`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from sgp_ros.errors import ConfigError
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.formula import Formula, read_formula
from sgp_ros.physics.grammar import MEMORY
from sgp_ros.physics.law import NAME, FormulaLaw
from sgp_ros.physics.parts import LawParameter
from sgp_ros.physics.place import TOOL
from sgp_ros.physics.tool_law import ATTACHED, PATHS, STATED, UNITS, ToolLaw
from sgp_ros.physics.units import read_unit, unit_of, unit_text
from sgp_ros.rigid.tree import Tree
from sgp_ros.robots.entries import Entries, is_positive
from sgp_ros.strangers import is_usable

_KEYS = {'value', 'start', 'unit', 'range', 'std'}
_PARAMETER = '{value or start, unit, range, std}'


def read_law(item: object, where: str, tree: Tree, problems: list[str]) -> EffectAt | None:
    """Return the law that a robot YAML states; what is wrong is appended to `problems`.

    Args:
        item: joint, formula, parameters, and perhaps words for people.
        where: it stands in the file.
        tree: the robot.
        problems: collected so far.
    """
    known = len(problems)
    if not isinstance(item, dict):
        problems.append(f'{where} is {item!r}, not {{joint, formula, parameters}}')
        return None
    entries = Entries(item, problems, f'{where}.')
    entries.refuse_others({'joint', 'formula', 'parameters', 'words'})
    joint, words = entries.text('joint', ''), entries.text('words', 'a law of its own')
    given = dict(entries.mapping('parameters') or {})
    path = _path(entries, joint, given, tree)
    if len(problems) == known and not path and joint not in tree.moving_names:
        problems.append(f'{where}: the joint is {joint!r}, not one of {[*tree.moving_names]}')
    formula = _formula(entries, joint, tree, is_tool=bool(path))
    if formula is None or len(problems) > known:
        return None
    numbers = formula.parameters
    if path:
        numbers = (numbers - UNITS.keys()) | {*ToolLaw.point_names(path)}
    problems.extend(
        f'{where}: {key!r} is not in the formula' for key in given if key not in numbers
    )
    read = {name: _parameter(given.get(name), f'{where}: {name}', problems)
            for name in sorted(numbers)}  # fmt: skip
    if len(problems) > known:
        return None
    found = {n: p for n, p in read.items() if p}
    return _law(formula, path or joint, words, found, where, tree, problems, is_tool=bool(path))


def is_open(item: Mapping[str, Any]) -> bool:
    """Return whether an entry of `effects` is a law that the robot may have or not."""
    law = item.get(NAME, item)
    return any('start' in entry for entry in law.get('parameters', {}).values()
               if isinstance(entry, dict))  # fmt: skip


def _path(entries: Entries, joint: str, given: dict[str, Any], tree: Tree) -> str:
    """Return the path of a law of the tool, empty for one of a joint.

    Its point of attachment becomes that of `tool0` where none is stated.
    """
    left, _, right = str(entries.document.get('formula')).partition('=')
    match = STATED.fullmatch(left)
    if match is None or not right or joint != TOOL.value:
        return ''
    path, where = match[1], entries.prefix
    if path not in PATHS:
        entries.problems.append(f'{where}formula has the path {path!r}, not one of {[*PATHS]}')
    elif tree.tool_body < 0:
        entries.problems.append(f'{where}formula: several links are outermost, and none is tool0')
    elif not given.keys() & {*ATTACHED} and tree.tool is not None:
        at = zip(ATTACHED, tree.tool.translation.tolist(), strict=True)
        given.update({name: {'value': x, 'unit': 'm'} for name, x in at})
    return path


def _formula(entries: Entries, joint: str, tree: Tree, *, is_tool: bool) -> Formula | None:
    """Return the formula of a force on a joint; `tau_x[joint] =` may stand before it."""
    text = entries.document.get('formula')
    if isinstance(text, str) and '=' in text:
        left, _, text = text.partition('=')
        left = f'tau_x[{joint}]' if is_tool else left
        if left.replace(' ', '').replace('"', '').replace("'", '') != f'tau_x[{joint}]':
            entries.problems.append(
                f'{entries.prefix}formula states {left.strip()}, not tau_x[{joint}]'
            )
            return None
    try:
        formula = read_formula(text, is_law=True)
    except ConfigError as error:
        entries.problems.append(f'{entries.prefix}formula: {error}')
        return None
    if is_tool and (formula.signals or formula.functions & {*MEMORY}):
        entries.problems.append(
            f'{entries.prefix}formula is {formula.text!r}; a law of the tool is one of '
            f'{", ".join(UNITS)} alone, without memory'
        )
        return None
    others = sorted({j for _, j in formula.signals if j} - set(tree.moving_names))
    if others:
        entries.problems.append(
            f'{entries.prefix}formula has the joints {others}, which are not among '
            f'{[*tree.moving_names]}'
        )
        return None
    return formula


def _law(
    formula: Formula, place: str, words: str, read: Mapping[str, tuple[LawParameter, float]],
    where: str, tree: Tree, problems: list[str], *, is_tool: bool,
) -> EffectAt | None:  # fmt: skip
    """Return a law whose units are right, at its joint or along a path, with values or starts."""
    names = tree.moving_names

    def length_of(name: str) -> str:
        return 'm' if tree.is_prismatic[names.index(name)] else 'rad'

    expected = 'N' if is_tool or length_of(place) == 'm' else 'N m'
    units = {name: p.unit for name, (p, _) in read.items()} | (UNITS if is_tool else {})
    try:
        found = unit_of(formula, units, length_of)
    except ConfigError as error:
        problems.append(f'{where}.formula: {error}')
        return None
    if found != read_unit(expected):
        problems.append(
            f'{where}.formula has the unit {unit_text(found)}, not {expected} '
            f'({unit_text(read_unit(expected))})'
        )
        return None
    is_open = any(not p.is_known for p, _ in read.values())
    parameters = [p for p, _ in read.values()]
    if not is_open:  # all are stated: they are the numbers of the law
        parameters = [LawParameter(p.name, p.unit, p.low, start=p.start, high=p.high)
                      for p in parameters]  # fmt: skip
    law = (ToolLaw if is_tool else FormulaLaw)(formula, place, parameters, words, is_open=is_open)
    values = {p.name: p.start for p in parameters if not p.is_known}
    std = {name: x for name, (_, x) in read.items() if math.isfinite(x)}
    return EffectAt.stated(law, law.joint, values, tree, std)


def _parameter(
    entry: object, where: str, problems: list[str]
) -> tuple[LawParameter, float] | None:
    """Return a parameter and the standard deviation of its value, infinite where not known."""
    if not isinstance(entry, dict) or not set(entry) <= _KEYS or 'unit' not in entry:
        problems.append(f'{where} is {entry!r}, not {_PARAMETER}')
        return None
    if ('value' in entry) == ('start' in entry):
        problems.append(f'{where} is {entry!r}; it needs either a value or a start')
        return None
    start: Any = entry.get('value', entry.get('start'))
    ends: Any = entry.get('range', [-math.inf, math.inf])
    is_range = isinstance(ends, list) and len(ends) == 2 and all(map(_is_number, ends))
    if not is_usable(start):
        problems.append(f'{where} is {start!r}, not a finite number')
    elif not is_range or not ends[0] <= start <= ends[1] or ends[0] == ends[1]:
        problems.append(f'{where}: the range is {ends!r}, not [low, high] around {start:g}')
    elif 'std' in entry and not is_positive(entry['std']):
        problems.append(f'{where}: std is {entry["std"]!r}, not positive')
    else:
        return _read(entry, where, float(start), ends, problems)
    return None


def _read(
    entry: Mapping[str, Any], where: str, start: float, ends: list[float], problems: list[str]
) -> tuple[LawParameter, float] | None:
    unit, name = entry['unit'], where.rpartition(': ')[2]
    try:
        read_unit(unit if isinstance(unit, str) else repr(unit))
    except ConfigError as error:
        problems.append(f'{where}: {error}')
        return None
    low, high = map(float, ends)
    parameter = LawParameter(
        name, str(unit), low, start=start, high=high, is_known='value' in entry
    )
    return parameter, float(entry.get('std', math.inf))


def _is_number(value: object) -> bool:
    return (
        isinstance(value, (int, float)) and not isinstance(value, bool) and not math.isnan(value)
    )
