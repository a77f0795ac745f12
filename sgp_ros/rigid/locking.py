"""Which joints of a URDF move, which are locked, and which follow another."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from sgp_ros.errors import ConfigError
from sgp_ros.rigid.urdf_model import MOVING, Urdf


@dataclass(frozen=True, slots=True)
class Plan:
    """The part that each moving joint of a URDF plays.

    Attributes:
        names: joints that move, first the independent ones, then those that follow them.
        locked: position of the joints that do not [rad or m].
        leaders: per name in `names`, the independent joint it follows; itself if it is one.
        multipliers: its position per position of its leader.
        offsets: its position where the leader is at 0 [rad or m].
        actuated: independent joints on which an effort acts.
    """

    names: tuple[str, ...]
    locked: dict[str, float]
    leaders: dict[str, str]
    multipliers: dict[str, float]
    offsets: dict[str, float]
    actuated: frozenset[str]


def plan_joints(
    urdf: Urdf,
    joints: Sequence[str] | None,
    locked: Mapping[str, float],
    passive: Sequence[str] | None,
) -> Plan:
    """Return which joints move; arguments as in `tree.read_urdf`.

    Raises:
        ConfigError: names that are not in the file, follow another joint, or stand in two places.
    """
    chains = {name: leader_of(urdf, name) for name, j in urdf.joints.items() if j.kind in MOVING}
    free = [name for name, (leader, _, _) in chains.items() if leader == name]
    chosen = [name for name in free if name not in locked] if joints is None else list(joints)
    for what, names in (('joints', chosen), ('locked', locked), ('passive', passive or ())):
        _check(urdf.place, what, list(names), free)
    both = sorted(set(chosen) & set(locked))
    if both:
        raise ConfigError(f'{urdf.place}: {both} in both joints and locked', 'one of the two')
    if not chosen:
        raise ConfigError(f'{urdf.place}: all joints are locked', 'a joint that moves')
    wrong = {name: x for name, x in locked.items() if not math.isfinite(x)}
    if wrong:
        raise ConfigError(f'{urdf.place}: locked at {wrong}', 'finite positions')
    followers = [n for n, (leader, _, _) in chains.items() if leader in chosen and leader != n]
    names = (*chosen, *followers)
    resting = {
        name: multiplier * locked.get(leader, 0.0) + offset
        for name, (leader, multiplier, offset) in chains.items()
        if name not in names
    }
    return Plan(
        names,
        resting,
        {name: chains[name][0] for name in names},
        {name: chains[name][1] for name in names},
        {name: chains[name][2] for name in names},
        _actuated(urdf, chosen, passive),
    )


def leader_of(urdf: Urdf, name: str) -> tuple[str, float, float]:
    """Return the independent joint behind a chain of followers, multiplier and offset."""
    multiplier, offset = 1.0, 0.0
    joint = urdf.joints[name]
    while joint.follows is not None:
        offset += multiplier * joint.offset
        multiplier *= joint.multiplier
        joint = urdf.joints[joint.follows]
    return joint.name, multiplier, offset


def _actuated(urdf: Urdf, chosen: Sequence[str], passive: Sequence[str] | None) -> frozenset[str]:
    if passive is not None:
        return frozenset(chosen) - set(passive)
    return frozenset(chosen) if urdf.commanded is None else frozenset(chosen) & urdf.commanded


def _check(place: str, what: str, names: list[str], free: list[str]) -> None:
    unknown = [name for name in names if name not in free]
    if unknown:
        raise ConfigError(
            f'{place}: {what} {unknown} are not joints that move on their own', f'some of {free}'
        )
    if len(set(names)) != len(names):
        raise ConfigError(f'{place}: {what} {names} repeats a name', 'different names')
