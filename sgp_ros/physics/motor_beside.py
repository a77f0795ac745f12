"""Motors of springs whose inertia the robot file does not have.

A spring with the encoder on the motor and a rotor beside it are one motor: the inertia of the
spring's is then that of the rotor, and not a part of what the file has.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.elasticity import JointElasticity, is_on_motor, some_poses
from sgp_ros.physics.memory import BARE
from sgp_ros.physics.motion import SeenMotion
from sgp_ros.physics.place import Place

_MOST_OF_MOTOR = 0.5
"""Of the inertia in the robot file, from which on a rotor beside it is the motor."""


def has_rotor(place: Place, effects: Sequence[EffectAt]) -> bool:
    """Return whether the motor of a spring is in the nominal robot, or among these effects."""
    return place.kind != BARE or Place(place.joint) in {s.place for s in effects
                                                        if s.effect.is_inertial}  # fmt: skip


def is_in_file(place: Place) -> bool:
    """Return whether what is behind a motor with the encoder takes that motor from the file."""
    return is_on_motor(place) and place.kind != BARE


def is_bare(joint: int, effects: Sequence[EffectAt], motion: SeenMotion) -> bool:
    """Return whether effects add most of a motor to a joint, whose file then has none."""
    added = sum(float(s.coefficients[0]) for s in effects
                if s.effect.is_inertial and s.place == Place(joint))  # fmt: skip
    return added > _MOST_OF_MOTOR * motion.free_inertia(joint, some_poses(motion))


def tied(effects: Sequence[EffectAt]) -> list[tuple[int, int]]:
    """Return the indices of springs and of the rotors beside them: their J is one number."""
    rotors = {s.place: i for i, s in enumerate(effects) if s.effect.is_inertial}
    return [
        (i, rotors[own]) for i, s in enumerate(effects)
        if isinstance(s.effect, JointElasticity) and s.place.kind == BARE
        and (own := Place(s.place.joint)) in rotors and effects[rotors[own]].coefficients[0] > 0.0
    ]  # fmt: skip


def with_rotors(effects: Sequence[EffectAt]) -> tuple[EffectAt, ...]:
    """Return effects with one J, that of the rotor, where it is beside its spring."""
    found = list(effects)
    for i, rotor in tied(effects):
        found[i] = found[i].with_shape(np.array([*found[rotor].coefficients, *found[i].shape[1:]]))
    return tuple(found)


def beside_rotors(effects: Sequence[EffectAt], motion: SeenMotion) -> tuple[EffectAt, ...]:
    """Return effects with the motor of a spring outside the robot file where it has a rotor."""
    return tuple(
        replace(s, place=replace(s.place, kind=BARE))
        if isinstance(s.effect, JointElasticity) and is_in_file(s.place)
        and is_bare(s.place.joint, effects, motion) else s
        for s in effects
    )  # fmt: skip
