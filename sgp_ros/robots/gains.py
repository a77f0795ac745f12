"""Gains of drives that hold position targets, from a file.

    kp: {shoulder: 300.0, elbow: 25.0}   # N m/rad or N/m
    kd: {shoulder: 10.0, elbow: 0.9}     # N m s/rad or N s/m
    feedforward: gravity                 # none unless stated

`tau = kp (q_des - q) + kd (dq_des - dq) + tau_ff`, tau_ff the nominal torque against gravity.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from sgp_ros.errors import ConfigError
from sgp_ros.markup import load_yaml
from sgp_ros.physics.servo import servo_parts
from sgp_ros.strangers import GREATEST, is_usable, read_text

_KEYS = ('kp', 'kd', 'feedforward')
_FEEDFORWARD = ('none', 'gravity')


@dataclass(frozen=True, slots=True, eq=False)
class Gains:
    """Gains of k joints; those of joints without a drive are 0.

    Attributes:
        kp: (k,) [N m/rad or N/m].
        kd: (k,) [N m s/rad or N s/m].
        holds_gravity: whether the drives add what the nominal robot takes against gravity.
        is_recorded: whether the gains stand in the recording, beside each target; `kp` and `kd`
            are then factors of these [1].
        rotors: (k,) inertia that they move beside that of the robot file [kg m^2 or kg].
    """

    kp: np.ndarray
    kd: np.ndarray
    holds_gravity: bool = False
    is_recorded: bool = False
    rotors: np.ndarray | None = None

    def effort(self, target: np.ndarray, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Return what the drives make of targets, without feed-forward, (k,) [N m or N].

        Args:
            target: positions, then velocities, that are asked for, (2 k,).
            position: (k,) [rad or m].
            velocity: (k,) [rad/s or m/s].
        """
        k = len(self.kp)
        parts = servo_parts(self.kp, self.kd, target[:k] - position, target[k:] - velocity)
        return sum(parts, np.zeros(k))

    def scaled(self, kp: np.ndarray, kd: np.ndarray) -> Gains:
        """Return the gains times factors, (k,) each."""
        return replace(self, kp=self.kp * kp, kd=self.kd * kd)

    def content(self, joints: Sequence[str]) -> dict[str, Any]:
        """Return the gains as a file states them."""
        driven = [(j, float(p), float(d)) for j, p, d in
                  zip(joints, self.kp, self.kd, strict=True) if p or d]  # fmt: skip
        found: dict[str, Any] = {
            'kp': {j: p for j, p, _ in driven},
            'kd': {j: d for j, _, d in driven},
        }
        return found | ({'feedforward': 'gravity'} if self.holds_gravity else {})


def read_gains(path: Path, joints: Sequence[str], actuated: Sequence[str]) -> Gains:
    """Return the gains that a file states.

    Args:
        path: YAML file.
        joints: names of all joints, in the order of the result.
        actuated: joints that have a drive; each must have both gains.

    Raises:
        ConfigError: no such file, or not one number of each kind for each drive.
    """
    try:
        content = load_yaml(read_text(path))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        reason = str(error).splitlines()[0]
        raise ConfigError(
            f'gains {path.name} cannot be read ({reason})', 'a YAML file with kp and kd by joint'
        ) from None
    return checked_gains(content, path.name, joints, actuated)


def stated_gains(
    source: Mapping[str, Any], joints: Sequence[str], actuated: Sequence[str]
) -> Gains | None:
    """Return the gains that the file of a robot states, if they tell all of the efforts.

    None without gains, with wrong ones, and where drives hold more, such as gravity.

    Args:
        source: content of its file.
        joints: names of all joints.
        actuated: joints that have a drive.
    """
    try:
        found = checked_gains(source.get('gains'), 'gains of the robot', joints, actuated)
    except ConfigError:
        return None
    return None if found.holds_gravity else found


def checked_gains(
    content: Any, place: str, joints: Sequence[str], actuated: Sequence[str]
) -> Gains:
    """Return gains from the content of a file, see `read_gains`.

    Args:
        content: to be a mapping with the keys `kp`, `kd` and perhaps `feedforward`.
        place: where it stands, for messages.
        joints: names of all joints.
        actuated: joints that have a drive.

    Raises:
        ConfigError: not one number of each kind for each drive.
    """
    if not isinstance(content, dict) or not set(content) <= set(_KEYS):
        raise ConfigError(f'{place}: {_description(content)}', f'the keys {", ".join(_KEYS)}')
    feedforward = content.get('feedforward', 'none')
    if feedforward not in _FEEDFORWARD:
        raise ConfigError(f'{place}: feedforward {feedforward!r}', ' or '.join(_FEEDFORWARD))
    kp, kd = (_column(place, content.get(key), key, joints, actuated) for key in ('kp', 'kd'))
    return Gains(kp, kd, feedforward == 'gravity')


def _column(
    place: str, found: Any, key: str, joints: Sequence[str], actuated: Sequence[str]
) -> np.ndarray:
    if found is not None and not isinstance(found, Mapping):
        description = f'{len(found)} numbers' if isinstance(found, list) else repr(found)
        raise ConfigError(f'{place}: {key} is {description} without names',
                          f'one number for each of {sorted(actuated)}, by name')  # fmt: skip
    table = found or {}
    if set(table) != set(actuated):
        raise ConfigError(f'{place}: {key} is given for {sorted(map(str, table))}',
                          f'one number for each of {sorted(actuated)}')  # fmt: skip
    for joint, x in table.items():
        if not is_usable(x) or x < 0.0:
            expected = f'a number from 0 to {GREATEST:g}'
            raise ConfigError(f'{place}: {key} of {joint} is {x!r}', expected)
    return np.array([float(table.get(joint, 0.0)) for joint in joints])


def _description(content: Any) -> str:
    return (
        f'the keys {sorted(map(str, content))}' if isinstance(content, dict) else 'not a mapping'
    )
