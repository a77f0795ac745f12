"""Effects that a robot YAML states beside its rigid-body tree.

    effects:
      - {effect: coulomb_friction, joint: elbow, parameters: {level: {value: 0.317, std: 0.002}}}

Names, parameters and signs are those of `diagnosis.json`, so that what a diagnosis found can be
written here as it is. A parameter without `std` is not known before: its value is a start.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect import Effect, Fitted, Place
from sgp_ros.physics.observed_motion import ObservedMotion
from sgp_ros.physics.stated import (
    KINDS,
    PLACED,
    SIDED,
    SIDES,
    VELOCITY_FILTER_LAG,
    coefficient_std,
    effect_names,
    place_of,
    shape_and_coefficients,
    stated_quantities,
)
from sgp_ros.rigid.tree import Tree
from sgp_ros.robots.entries import Entries, is_finite

NOT_ONLINE = (
    'command_delay', 'actuator_lag', 'backlash', 'hysteresis', 'friction_drift',
    VELOCITY_FILTER_LAG,
)  # fmt: skip
"""Effects that depend on more than position, velocity, acceleration and effort at one time."""
_POSITIVE = (
    'stribeck_velocity', 'time_constant', 'presliding', 'mass', 'width', 'limit', 'delay', 'gap',
    'gain', 'motor_inertia',
)  # fmt: skip
_OPTIONAL = ('motor_inertia',)
"""Numbers that a model does without."""
_WHOLE_ROBOT = {'command_delay': 'all'}


@dataclass(frozen=True, slots=True, eq=False)
class StatedEffect:
    """An effect with its values.

    Attributes:
        name: in the schema of a diagnosis.
        joint: as stated.
        kind: where the effect comes in kinds; empty elsewhere.
        numbers: by name, SI.
        place, shape, coefficients: as `Effect.columns` takes them; None, empty and empty for an
            effect that exerts no force.
        std: (m,) standard deviations of the coefficients; infinite where not known.
    """

    name: str
    joint: str
    kind: str
    numbers: Mapping[str, float]
    place: Place | None
    shape: np.ndarray
    coefficients: np.ndarray
    std: np.ndarray

    @property
    def effect(self) -> Effect | None:
        """What is known of such effects; None for one that exerts no force."""
        return EFFECTS.get(self.name)

    @property
    def is_online(self) -> bool:
        """Whether a model that sees one time at once can hold it."""
        return self.name not in NOT_ONLINE

    @property
    def is_holding(self) -> bool:
        """Whether it can hold a joint at rest."""
        effect = self.effect
        return effect is not None and self.place is not None and effect.holds(self.place)

    @property
    def is_complete(self) -> bool:
        """Whether the stated numbers say what it does; of backlash they do not say enough."""
        return bool(np.isfinite(self.shape).all() and np.isfinite(self.coefficients).all())

    def force(self, motion: ObservedMotion) -> np.ndarray:
        """Return what it exerts in a motion, (n, k) [N m or N]; nothing where it is no force."""
        force = np.zeros(motion.position.shape)
        if self.effect is None or self.place is None:
            return force
        x = self.effect.columns(motion, self.place, self.shape) @ self.coefficients
        if x.ndim == 2:
            return force + x
        force[:, self.place.joint] = x
        return force


def read_effects(entry: object, tree: Tree, problems: list[str]) -> tuple[StatedEffect, ...]:
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
    found = [_read(item, f'effects[{i}]', tree, problems) for i, item in enumerate(entry)]
    return tuple(effect for effect in found if effect is not None)


def _read(item: object, where: str, tree: Tree, problems: list[str]) -> StatedEffect | None:
    known = len(problems)
    if not isinstance(item, dict):
        problems.append(f'{where} is {item!r}, not {{effect, joint, parameters}}')
        return None
    entries = Entries(item, problems, f'{where}.')
    entries.refuse_others({'effect', 'joint', 'parameters'})
    name, joint = entries.text('effect', ''), entries.text('joint', '')
    given = entries.mapping('parameters') or {}
    if len(problems) == known and name not in effect_names():
        problems.append(f'{where}.effect is {name!r}, not one of {list(effect_names())}')
    if len(problems) > known:
        return None
    where = f'{where} {name} of {joint}'
    _check_joint(name, joint, where, tree, problems)
    choices = _choices(name, joint, tree)
    words = _words(choices, given, where, problems)
    if name in KINDS and 'kind' not in words:
        return None
    quantities = _quantities(name, words.get('kind', ''), joint, tree)
    problems.extend(
        f'{where}: unknown parameter {key!r}, not one of {[*quantities, *choices]}'
        for key in given if key not in quantities and key not in choices
    )  # fmt: skip
    values, std = _numbers(quantities, given, where, problems)
    if len(problems) > known:
        return None
    stated = _stated(name, joint, words, values, std, tree)
    if not _is_possible(stated, tree):
        problems.append(f'{where}: no such effect exists with the values {values}')
    return stated


def _check_joint(name: str, joint: str, where: str, tree: Tree, problems: list[str]) -> None:
    if name in PLACED:
        allowed = [PLACED[name]]
        if name == 'tip_force' and not any(f.name == 'tool0' and f.body >= 0 for f in tree.frames):
            problems.append(f'{where}: the URDF has no moving link tool0')
    elif name == 'payload':
        allowed = [tree.moving_names[-1]]
    elif name == 'limit_friction':
        limits = np.isfinite(tree.lower) & np.isfinite(tree.upper)
        allowed = [j for j, has in zip(tree.moving_names, limits, strict=False) if has]
    else:
        allowed = [*tree.moving_names]
        allowed += [_WHOLE_ROBOT[name]] if name in _WHOLE_ROBOT else []
    if joint not in allowed:
        problems.append(f'{where}: the joint is not one of {allowed}')


def _choices(name: str, joint: str, tree: Tree) -> dict[str, tuple[str, ...]]:
    """Return the parameters that are words, with the words they may be."""
    choices: dict[str, tuple[str, ...]] = {}
    if name in KINDS:
        choices['kind'] = KINDS[name]
    if name == 'joint_coupling':
        choices['source_joint'] = tuple(j for j in tree.moving_names if j != joint)
    if name in SIDED:
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


def _quantities(name: str, kind: str, joint: str, tree: Tree) -> dict[str, str]:
    """Return the parameters that are numbers, with their units on this joint."""
    names = tree.moving_names
    prismatic = joint in names and bool(tree.is_prismatic[names.index(joint)])
    return {
        q.name: q.unit_on(is_prismatic=prismatic) for q in stated_quantities(name, kind)
    }  # fmt: skip


def _numbers(
    quantities: Mapping[str, str], given: Mapping[Any, Any], where: str, problems: list[str]
) -> tuple[dict[str, float], dict[str, float]]:
    """Return values and standard deviations, both by name."""
    values, std = {}, {}
    for name, unit in quantities.items():
        entry = given.get(name)
        if entry is None and name in _OPTIONAL:
            continue
        if not isinstance(entry, dict) or not {'value'} <= set(entry) <= {'value', 'std', 'unit'}:
            problems.append(f'{where}: {name} is {entry!r}, not {{value, std, unit}}')
            continue
        value, spread = entry['value'], entry.get('std')
        if not is_finite(value) or (name in _POSITIVE and value <= 0.0):
            sort = 'positive' if name in _POSITIVE else 'finite'
            problems.append(f'{where}: {name} is {value!r}, not a {sort} number')
        elif spread is not None and not (is_finite(spread) and spread > 0.0):
            problems.append(f'{where}: std of {name} is {spread!r}, not positive')
        elif entry.get('unit', unit) != unit:
            problems.append(f'{where}: {name} in {entry["unit"]!r}, not in {unit!r}')
        else:
            values[name] = float(value)
            if spread is not None:
                std[name] = float(spread)
    return values, std


def _stated(
    name: str, joint: str, words: Mapping[str, str], values: dict[str, float],
    std: dict[str, float], tree: Tree,
) -> StatedEffect:  # fmt: skip
    kind = words.get('kind', '')
    if name not in EFFECTS:
        return StatedEffect(name, joint, kind, values, None, *(np.zeros(0),) * 3)
    place = place_of(name, joint, words, values, tree)
    shape, coefficients = shape_and_coefficients(name, kind, values)
    spread = coefficient_std(name, kind, values, std)
    return StatedEffect(name, joint, kind, values, place, shape, coefficients, spread)


def _is_possible(stated: StatedEffect, tree: Tree) -> bool:
    effect = stated.effect
    if effect is None or stated.place is None:
        return True
    k = tree.size
    still = np.zeros((1, k))
    limit = tree.effort_limit[:k]
    effort = np.where(np.isfinite(limit) & (limit > 0.0), limit, 1.0)[None]
    motion = ObservedMotion(tree, np.zeros(1), 0.0, still, still, still, effort, None)
    return effect.is_possible(Fitted(motion, stated.place, stated.shape, stated.coefficients))
