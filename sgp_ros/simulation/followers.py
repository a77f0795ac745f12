"""Joints of a URDF that follow another one by a gear: `<mimic>`, or parameters of ros2_control."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from xml.etree import ElementTree as ET

from sgp_ros.errors import ConfigError
from sgp_ros.simulation.urdf_elements import MOVING, number_of


@dataclass(frozen=True, slots=True)
class Follower:
    """A joint without a motion of its own, `position = multiplier * leader + offset`.

    Attributes:
        name: of the joint.
        leader: joint with a motion of its own.
        multiplier: position per position of the leader.
        offset: position where the leader is at 0 [rad or m].
    """

    name: str
    leader: str
    multiplier: float
    offset: float


def read_followers(root: ET.Element) -> dict[str, Follower]:
    """Return by name the joints that follow; who follows a follower follows its leader.

    Raises:
        ConfigError: a joint that follows none that moves, or itself.
    """
    moving = {j.get('name', ''): j for j in root.findall('joint') if j.get('type') in MOVING}
    said = {name: x for name, x in _by_control(root).items() if name in moving}
    for name, joint in moving.items():
        mimic = joint.find('mimic')
        if mimic is not None:
            said[name] = mimic
    direct = {name: _follower(name, mimic) for name, mimic in said.items()}
    return {name: _resolved(direct[name], direct, set(moving)) for name in direct}


def _by_control(root: ET.Element) -> dict[str, ET.Element]:
    """Return parameters of joints that say what a `<mimic>` would, in its form."""
    found = {}
    for block in root.iter('ros2_control'):
        for joint in block.iter('joint'):
            said = {p.get('name', ''): (p.text or '').strip() for p in joint.findall('param')}
            if 'mimic' in said:
                found[joint.get('name', '')] = ET.Element('mimic', said | {'joint': said['mimic']})
    return found


def _follower(name: str, mimic: ET.Element) -> Follower:
    multiplier, offset = number_of(mimic, 'multiplier', 1.0), number_of(mimic, 'offset', 0.0)
    return Follower(name, mimic.get('joint', ''), multiplier, offset)


def _resolved(first: Follower, direct: Mapping[str, Follower], moving: set[str]) -> Follower:
    multiplier, offset, leader = first.multiplier, first.offset, first.leader
    passed = {first.name}
    while leader in direct and leader not in passed:
        passed.add(leader)
        offset += multiplier * direct[leader].offset
        multiplier *= direct[leader].multiplier
        leader = direct[leader].leader
    if leader not in moving - passed:
        raise ConfigError(
            f'joint {first.name!r} follows {leader!r}', 'another joint that moves on its own'
        )
    return Follower(first.name, leader, multiplier, offset)
