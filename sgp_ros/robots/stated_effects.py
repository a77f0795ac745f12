"""Effects that a robot YAML states beside its rigid-body tree.

    effects:
      - {effect: coulomb_friction, joint: elbow, parameters: {level: {value: 0.317, std: 0.002}}}

Names, parameters and signs are those of `diagnosis.json`, so that what a diagnosis found can be
written here as it is. A parameter without `std` is not known before: its value is a start. Laws
that no effect states have a formula, see `stated_laws`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from sgp_ros.physics.catalogue import COULOMB_FRICTION, EFFECTS, VISCOUS_FRICTION
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.law import NAME as LAW
from sgp_ros.physics.parts import Quantity, Value
from sgp_ros.physics.place import BASE, LAST, SIDES, TOOL
from sgp_ros.rigid.tree import Tree
from sgp_ros.robots.entries import Entries, is_positive
from sgp_ros.robots.nominal_prior import stated_dynamics
from sgp_ros.robots.observed_motion import ObservedMotion
from sgp_ros.robots.stated_laws import read_law
from sgp_ros.strangers import is_usable


def read_effects(entry: object, tree: Tree, problems: list[str]) -> tuple[EffectAt, ...]:
    """Return the effects that a robot YAML states; what is wrong is appended to `problems`.

    Args:
        entry: what stands under the key `effects`; None where there is no such key.
        tree: the robot.
        problems: collected so far.
    """
    if entry is None:
        return ()
    if not isinstance(entry, list):
        problems.append(f'effects is {entry!r}, not a list')
        return ()
    found = [_effect_or_law(item, f'effects[{i}]', tree, problems) for i, item in enumerate(entry)]
    return tuple(effect for effect in found if effect is not None)


def _effect_or_law(item: object, where: str, tree: Tree, problems: list[str]) -> EffectAt | None:
    if isinstance(item, dict) and item.get('effect') == LAW:
        return read_law({k: x for k, x in item.items() if k != 'effect'}, where, tree, problems)
    if isinstance(item, dict) and set(item) == {LAW}:
        return read_law(item[LAW], f'{where}.{LAW}', tree, problems)
    return _read(item, where, tree, problems)


def _read(item: object, where: str, tree: Tree, problems: list[str]) -> EffectAt | None:
    known = len(problems)
    if not isinstance(item, dict):
        problems.append(f'{where} is {item!r}, not {{effect, joint, parameters}}')
        return None
    entries = Entries(item, problems, f'{where}.')
    entries.refuse_others({'effect', 'joint', 'parameters'})
    name, joint = entries.text('effect', ''), entries.text('joint', '')
    given = entries.mapping('parameters') or {}
    if len(problems) == known and name not in EFFECTS:
        problems.append(f'{where}.effect is {name!r}, not one of {list(EFFECTS)}')
    if len(problems) > known:
        return None
    effect = EFFECTS[name]
    where = f'{where} {name} of {joint}'
    _check_joint(effect, joint, where, tree, problems)
    choices = _choices(effect, joint, tree)
    words = _words(choices, given, where, problems)
    if effect.kinds and effect.kind_word not in words:
        return None
    quantities = _quantities(effect, words.get(effect.kind_word, ''), joint, tree)
    problems.extend(
        f'{where}: unknown parameter {key!r}, not one of {[*quantities, *choices]}'
        for key in given if key not in quantities and key not in choices
    )  # fmt: skip
    values, std = _numbers(quantities, given, where, problems)
    if len(problems) > known:
        return None
    parameters: dict[str, Value] = {**values, **words}
    stated = EffectAt.stated(effect, joint, parameters, tree, std)
    if effect.is_force and not stated.is_possible(typical_motion(tree)):
        problems.append(f'{where}: the values {values} are physically impossible')
    return stated


def _check_joint(effect: Effect, joint: str, where: str, tree: Tree, problems: list[str]) -> None:
    allowed = [*tree.moving_names]
    if effect.site in {BASE, TOOL}:
        allowed = [effect.site.value]
        if effect.site is TOOL and not any(f.name == 'tool0' and f.body >= 0 for f in tree.frames):
            problems.append(f'{where}: the URDF has no moving link tool0')
    elif effect.site is LAST:
        allowed = [tree.moving_names[j] for j in tree.outermost]
    elif effect.needs_limits:
        limits = np.isfinite(tree.lower) & np.isfinite(tree.upper)
        allowed = [j for j, has in zip(tree.moving_names, limits, strict=False) if has]
    elif effect.takes_all:
        allowed.append('all')
    if joint not in allowed:
        problems.append(f'{where}: the joint is not one of {allowed}')


def _choices(effect: Effect, joint: str, tree: Tree) -> dict[str, tuple[str, ...]]:
    """Return the parameters that are words, with the words they may be."""
    choices: dict[str, tuple[str, ...]] = {effect.kind_word: effect.kinds} if effect.kinds else {}
    if effect.has_source:
        choices['source_joint'] = tuple(j for j in tree.moving_names if j != joint)
    if effect.edge:
        choices['side'] = tuple(SIDES)
    return choices


def _words(
    choices: Mapping[str, tuple[str, ...]], given: Mapping[Any, Any], where: str,
    problems: list[str],
) -> dict[str, str]:  # fmt: skip
    words = {}
    for key, allowed in choices.items():
        entry = given.get(key)
        value = entry.get('value') if isinstance(entry, dict) else entry
        if value in allowed:
            words[key] = str(value)
        elif key != 'side' or entry is not None:
            problems.append(f'{where}: {key} is {entry!r}, not one of {list(allowed)}')
    return words


def _quantities(effect: Effect, kind: str, joint: str, tree: Tree) -> dict[str, Quantity]:
    """Return the parameters that are numbers, with their units on this joint."""
    names = tree.moving_names
    prismatic = joint in names and bool(tree.is_prismatic[names.index(joint)])
    return {q.name: q.on(is_prismatic=prismatic) for q in effect.stated_quantities(kind)}


def _numbers(
    quantities: Mapping[str, Quantity], given: Mapping[Any, Any], where: str, problems: list[str]
) -> tuple[dict[str, float], dict[str, float]]:
    """Return values and standard deviations, both by name."""
    values, std = {}, {}
    for name, quantity in quantities.items():
        entry = given.get(name)
        if entry is None and quantity.is_optional:
            continue
        if not isinstance(entry, dict) or not {'value'} <= set(entry) <= {'value', 'std', 'unit'}:
            problems.append(f'{where}: {name} is {entry!r}, not {{value, std, unit}}')
            continue
        value, spread = entry['value'], entry.get('std')
        if not (is_positive if quantity.is_positive else is_usable)(value):
            sort = 'positive' if quantity.is_positive else 'finite'
            problems.append(f'{where}: {name} is {value!r}, not a {sort} number')
        elif spread is not None and not is_positive(spread):
            problems.append(f'{where}: std of {name} is {spread!r}, not positive')
        elif entry.get('unit', quantity.unit) != quantity.unit:
            problems.append(f'{where}: {name} in {entry["unit"]!r}, not in {quantity.unit!r}')
        else:
            values[name] = float(value)
            if spread is not None:
                std[name] = float(spread)
    return values, std


def typical_motion(tree: Tree) -> ObservedMotion:
    """Return one row at rest with the largest efforts."""
    k = tree.size
    still = np.zeros((1, k))
    limit = tree.effort_limit[:k]
    effort = np.where(np.isfinite(limit) & (limit > 0.0), limit, 1.0)[None]
    return ObservedMotion(tree, np.zeros(1), 0.0, still, still, still, effort, None)


def joint_friction(tree: Tree) -> tuple[EffectAt, ...]:
    """Return damping and dry friction of `<dynamics>` as effects."""
    (quantity,) = VISCOUS_FRICTION.quantities
    sizes = {j: stated_dynamics(tree, 'damping', i) for i, j in enumerate(tree.moving_names)}
    viscous = tuple(
        EffectAt.stated(VISCOUS_FRICTION, joint, {quantity.name: size}, tree)
        for joint, size in sizes.items()
        if size > 0.0
    )
    return (*viscous, *dry_friction(tree))


def dry_friction(tree: Tree) -> tuple[EffectAt, ...]:
    """Return the dry friction of `<dynamics>` as effects; damping is a part of the tree."""
    (quantity,) = COULOMB_FRICTION.quantities
    sizes = {j: stated_dynamics(tree, 'friction', i) for i, j in enumerate(tree.moving_names)}
    return tuple(
        EffectAt.stated(COULOMB_FRICTION, joint, {quantity.name: size}, tree)
        for joint, size in sizes.items()
        if size > 0.0
    )
