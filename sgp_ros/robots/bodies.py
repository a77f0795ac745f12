"""Nominal bodies of a robot that a few lumped coefficients describe.

The bodies are the simplest that have these coefficients: links with parallel axes, one behind the
other, of which a robot YAML states each number as a formula. What the coefficients do not
determine is chosen there, and changes no motion; mass and centre of a link are not measurements.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from sgp_ros.errors import ConfigError
from sgp_ros.physics.formula import Formula
from sgp_ros.physics.term import Coefficient, Joint
from sgp_ros.rigid.chain_urdf import ChainBody, chain_urdf
from sgp_ros.robots.entries import Entries

_NUMBERS = ('mass', 'centre', 'inertia', 'damping', 'place')
"""Of a link, as `ChainBody` names them."""


@dataclass(frozen=True, slots=True, eq=False)
class _Effect:
    """An effect beside the bodies; each of its numbers with its unit."""

    name: str
    joint: str
    numbers: Mapping[str, tuple[Formula, str]]


@dataclass(frozen=True, slots=True, eq=False)
class LumpedBodies:
    """Formulas of the bodies that have the coefficients of a robot.

    Attributes:
        joints: names of the joints, as the formulas know them.
        constants: numbers by name.
        values: nominal values of coefficients; None where none is known.
        derived: formulas of constants, coefficients and those before them.
        links: numbers of the link on each joint.
        effects: physics beside them.
        effort_gain: torque per unit of the command, by joint.
    """

    joints: tuple[str, ...]
    constants: Mapping[str, float]
    values: Mapping[str, float | None]
    derived: Mapping[str, Formula]
    links: tuple[Mapping[str, Formula], ...]
    effects: tuple[_Effect, ...]
    effort_gain: Mapping[str, Formula]

    def document(
        self, name: str, joints: Sequence[Joint], coefficients: Sequence[Coefficient]
    ) -> dict[str, object]:
        """Return the entries of a robot YAML with URDF that describe the same robot.

        Numbers that a robot YAML states under `parameters`, as priors, come before the nominal.

        Args:
            name: of the robot.
            joints: those of the robot, in the same order, perhaps with other names.
            coefficients: of the robot with their priors.

        Raises:
            ConfigError: a coefficient without a value, or values that no bodies have.
        """
        values = self._coefficients(name, coefficients)
        numbers = {**self.constants, **values}
        for key, formula in self.derived.items():
            numbers[key] = formula.value(numbers)
        slides = [joint.kind == 'prismatic' for joint in joints]
        bodies = [
            ChainBody(**{key: f.value(numbers) for key, f in link.items()}, slides=is_sliding)
            for link, is_sliding in zip(self.links, slides, strict=True)
        ]
        if not all(body.can_exist for body in bodies):
            listed = ', '.join(f'{key} = {value:g}' for key, value in values.items())
            raise ConfigError(
                f'robot {name} with {listed}', 'bodies with positive inertia',
                'correct the parameters of its robot YAML',
            )  # fmt: skip
        new = dict(zip(self.joints, (joint.name for joint in joints), strict=True))
        document: dict[str, object] = {'name': name, 'urdf': chain_urdf(name, joints, bodies)}
        if not any(joint.is_actuated for joint in joints):
            document['passive'] = list(new.values())
        if self.effort_gain:
            document['effort_gain'] = {
                new[joint]: f.value(numbers) for joint, f in self.effort_gain.items()
            }
        effects = [_entry(effect, new, numbers) for effect in self.effects]
        if any(effects):
            document['effects'] = [effect for effect in effects if effect]
        return document

    def _coefficients(self, name: str, coefficients: Sequence[Coefficient]) -> dict[str, float]:
        values, missing = {}, []
        for c in coefficients:
            nominal = self.values.get(c.name)
            if c.prior_mean != 0.0 or math.isfinite(c.prior_std):
                values[c.name] = c.prior_mean
            elif nominal is None:
                missing.append(c.name)
            else:
                values[c.name] = nominal
        if missing:
            raise ConfigError(
                f'robot {name} has no nominal values of {", ".join(missing)}',
                'a robot YAML that states them under `parameters`',
                'sgp identify writes one: robot_identified.yaml',
            )
        return values


def _entry(
    effect: _Effect, new: Mapping[str, str], numbers: Mapping[str, float]
) -> dict[str, object]:
    """Return an effect as a robot YAML states it; nothing where its numbers are zero."""
    values = {key: (f.value(numbers), unit) for key, (f, unit) in effect.numbers.items()}
    if not any(value for value, _ in values.values()):
        return {}
    stated = {key: {'value': value, 'unit': unit} for key, (value, unit) in values.items()}
    return {'effect': effect.name, 'joint': new[effect.joint], 'parameters': stated}


def read_bodies(
    stated: Mapping[str, Any] | None, joints: Sequence[Joint], constants: Mapping[str, float],
    values: Mapping[str, float | None], problems: list[str],
) -> LumpedBodies | None:  # fmt: skip
    """Return the bodies that stand under the key `bodies` of a robot YAML.

    Args:
        stated: what stands there; None where there is no such key, and then no bodies are known.
        joints: of the robot, from the base on.
        constants: by name.
        values: of all coefficients; None where none is stated.
        problems: what is wrong is appended here.
    """
    if stated is None:
        return None
    entries = Entries(stated, problems, 'bodies.')
    entries.refuse_others({'derived', 'links', 'effects', 'effort_gain'})
    names, known = [joint.name for joint in joints], {*constants, *values}
    derived, inner = {}, _inner(entries, 'derived')
    for key in inner.document:
        derived[str(key)] = inner.formula(key, known)
        known.add(str(key))
    links, inner = [], _inner(entries, 'links')
    for name in names:
        link = _inner(inner, name)
        link.refuse_others(_NUMBERS)
        links.append({key: link.formula(key, known) for key in _NUMBERS})
    if set(inner.document) != set(names):
        problems.append(f'bodies.links has {list(inner.document)}, not {names}')
    inner = _inner(entries, 'effort_gain')
    inner.refuse_others(names)
    gains = {str(joint): inner.formula(joint, known) for joint in inner.document}
    return LumpedBodies(
        tuple(names), constants, values, _whole(derived), tuple(map(_whole, links)),
        _effects(entries, names, known), _whole(gains),
    )  # fmt: skip


def _inner(entries: Entries, key: str) -> Entries:
    return replace(entries, document=entries.mapping(key) or {}, prefix=f'{entries.prefix}{key}.')


def _whole(formulas: Mapping[str, Formula | None]) -> dict[str, Formula]:
    """Leave out formulas that could not be read, of which the problems tell."""
    return {key: formula for key, formula in formulas.items() if formula is not None}


def _effects(entries: Entries, joints: Sequence[str], known: set[str]) -> tuple[_Effect, ...]:
    stated = entries.document.get('effects', [])
    if not isinstance(stated, list) or not all(isinstance(item, dict) for item in stated):
        entries.problems.append(f'bodies.effects is {stated!r}, not a list of effects')
        return ()
    effects = []
    for i, item in enumerate(stated):
        inner = Entries(item, entries.problems, f'bodies.effects[{i}].')
        inner.refuse_others({'effect', 'joint', 'parameters'})
        name, joint = inner.text('effect', ''), inner.text('joint', '')
        if joint not in joints:
            entries.problems.append(f'{inner.prefix}joint is {joint!r}, not one of {joints}')
        numbers, given = {}, _inner(inner, 'parameters')
        for key in given.document:
            parameter = _inner(given, key)
            parameter.refuse_others({'value', 'unit'})
            formula = parameter.formula('value', known)
            if formula is not None:
                numbers[str(key)] = formula, parameter.text('unit', '1')
        effects.append(_Effect(name, joint, numbers))
    return tuple(effects)
