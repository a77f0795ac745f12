"""Physics of a robot, sorted by the places that other programs have for it.

Bodies, damping and dry friction of joints, rotor inertia, springs, delay, lag, gains and limits
are numbers of joints that most formats know. Every other effect is named where a format is
written, so that nothing is lost unnoticed. A known standard deviation becomes a range of
`value +- 2 std`, for domain randomisation.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from sgp_ros.errors import ConfigError
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.robots.nominal import Nominal
from sgp_ros.robots.stated_values import stated_urdf

_STD = 2.0
"""Standard deviations to either side of a range."""
UNITS = {
    q.joint_number: q.unit for law in EFFECTS.values() for q in law.quantities if q.joint_number
} | {'kp': 'N m/rad', 'kd': 'N m s/rad'}
"""Of the numbers of a joint; on one that slides read N and m."""


@dataclass(slots=True)
class JointNumbers:
    """Numbers of one joint, see `UNITS`; those of no drive are 0.

    Attributes:
        is_driven: whether a motor acts on it.
        gain: what the motor delivers of what it is asked for.
        effort: limit, infinite for none [N m or N].
        ranges: `value +- 2 std` of the numbers that have a standard deviation.
    """

    is_driven: bool
    damping: float = 0.0
    friction: float = 0.0
    armature: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0
    delay: float = 0.0
    lag: float = 0.0
    gain: float = 1.0
    kp: float = 0.0
    kd: float = 0.0
    effort: float = math.inf
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)

    def has(self, name: str) -> bool:
        """Return whether a number is there."""
        return bool(getattr(self, name) != (1.0 if name == 'gain' else 0.0))


@dataclass(slots=True)
class Handover:
    """A robot for other programs.

    Attributes:
        nominal: the robot.
        urdf: with its bodies, damping and dry friction.
        joints: numbers by name of the joint.
        others: effects that are not numbers of a joint, in words.
        holds_gravity: whether drives of positions hold gravity.
    """

    nominal: Nominal
    urdf: str
    joints: dict[str, JointNumbers]
    others: list[str]
    holds_gravity: bool = False

    @property
    def has_targets(self) -> bool:
        """Whether the drives take targets, not efforts."""
        return any(j.kp or j.kd for j in self.joints.values())

    def left_out(self, held: Iterable[str]) -> list[str]:
        """Return what a format that holds these numbers cannot say, a sentence each."""
        places = set(held)
        found = [
            f'{joint}: {name} {getattr(numbers, name):.4g} {UNITS[name]}'.rstrip(' 1')
            for joint, numbers in self.joints.items()
            for name in UNITS
            if name not in places and name != 'rest' and numbers.has(name)
        ]
        if self.holds_gravity and 'gravity' not in places:
            found.append('drives that hold gravity')
        return [*found, *self.others]

    def ranges(self) -> dict[str, dict[str, list[float]]]:
        """Return the ranges by joint and number; joints without any are left out."""
        found = {j: {k: list(x) for k, x in n.ranges.items()} for j, n in self.joints.items()}
        return {joint: each for joint, each in found.items() if each}


def hand_over(nominal: Nominal) -> Handover:
    """Return a robot sorted for other programs.

    Raises:
        ConfigError: bodies that no URDF can hold.
    """
    tree = nominal.tree
    names = tree.moving_names
    joints = {
        name: JointNumbers(
            bool(tree.is_actuated[i]), float(tree.damping[i]), float(tree.friction[i]),
            effort=float(tree.effort_limit[i]),
        )
        for i, name in enumerate(names)
    }  # fmt: skip
    found = Handover(nominal, '', joints, [])
    for effect, std in zip(nominal.effects, _spreads(nominal), strict=True):
        _enter(effect, std, found)
    gains: Any = nominal.robot.source.get('gains') or {}
    for key in ('kp', 'kd'):
        for name, value in gains.get(key, {}).items():
            setattr(joints[name], key, float(value))
    found.holds_gravity = gains.get('feedforward') == 'gravity'
    dynamics = {name: (max(j.damping, 0.0), max(j.friction, 0.0)) for name, j in joints.items()}
    bodies = nominal.without_stated(tree.parameters)
    text = stated_urdf(nominal.robot, bodies, dynamics)
    if text is None:
        raise ConfigError(
            f'robot {nominal.robot.name} has bodies that a URDF cannot express',
            'physically possible bodies',
        )
    found.urdf = text
    return found


def _spreads(nominal: Nominal) -> list[dict[str, float]]:
    """Return the standard deviations that the robot YAML states of each of its effects."""
    entries: Any = nominal.robot.source.get('effects') or []
    spreads = [
        {
            name: float(x['std'])
            for name, x in entry.get('parameters', {}).items()
            if isinstance(x, dict) and x.get('std')
        }
        for entry in entries
    ]
    return [*spreads, *({} for _ in nominal.effects)][: len(nominal.effects)]


def _enter(effect: EffectAt, std: Mapping[str, float], found: Handover) -> None:
    """Enter an effect as numbers of its joints, or in words."""
    known = effect.effect.stated_quantities(effect.kind)
    places = {q.name: q.joint_number for q in known if q.joint_number}
    is_whole = bool(known) and len(set(places.values())) == len(known)
    words = f'{effect.joint}: {effect.effect.words}, ' + ', '.join(
        f'{name} {x:.4g}' if isinstance(x, float) else f'{name} {x}'
        for name, x in effect.parameters.items()
    )
    if places and not is_whole and effect.joint in found.joints:  # dry friction of some form
        level = float(np.mean([effect.numbers[name] for name in places]))
        found.joints[effect.joint].friction += level
        found.others.append(f'{words} (written as dry friction of {level:.4g})')
        return
    if not is_whole or effect.kind:
        if effect.effect.is_body:  # a load is part of the bodies, which no URDF splits again
            words += ' (add it to the link of this joint)'
        found.others.append(words)
        return
    driven = [j for j in found.joints.values() if j.is_driven]
    for joint in driven if effect.joint == 'all' else [found.joints[effect.joint]]:
        for name, place in places.items():
            before = getattr(joint, place) if place not in {'rest', 'gain'} else 0.0
            value = before + effect.numbers[name]
            setattr(joint, place, value)
            if name in std:
                low = value - _STD * std[name]
                low = low if place == 'rest' else max(low, 0.0)
                joint.ranges[place] = (low, value + _STD * std[name])


def numbers_of(joint: JointNumbers) -> dict[str, Any]:
    """Return the numbers of a joint that are there, for JSON."""
    return {
        f.name: getattr(joint, f.name) for f in fields(joint)
        if f.name in UNITS and (joint.has(f.name))
    }  # fmt: skip
