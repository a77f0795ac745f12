"""Sensors and transport written as text, `NAME=VALUE`, as on a command line."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from sgp_ros.errors import ConfigError
from sgp_ros.simulation.mechanism import SimulatedJoint
from sgp_ros.simulation.sensors import Sensors, encoder_resolution
from sgp_ros.simulation.transport import Transport

_YES, _NO = ('yes', 'true', '1'), ('no', 'false', '0')
_MOST_BITS = 40
_PER_JOINT = {'noise': 'position_noise', 'velocity_noise': 'velocity_noise'}
_SENSOR_TIMES = {'jitter': 'jitter_s', 'latency': 'command_latency_s'}
_SWITCHES = {'velocity': 'measures_velocity', 'effort': 'measures_effort'}
_TRANSPORT = {'stamp_noise': 'stamp_noise_s', 'log_latency': 'log_latency_s', 'drop': 'drop'}
_TRANSPORT_SWITCHES = {'permuted': 'is_permuted', 'named_commands': 'has_named_commands'}
SENSOR_NAMES = (
    'bits', 'resolution', *_PER_JOINT, *_SENSOR_TIMES, *_SWITCHES, *_TRANSPORT,
    *_TRANSPORT_SWITCHES,
)  # fmt: skip
"""Settable keys: `bits` of the encoders of revolute joints, `resolution` of those of prismatic
ones [m], standard deviations, times [s], shares, and switches."""


def parse_sensors(
    texts: Iterable[str], usual: Sensors, joints: Sequence[SimulatedJoint]
) -> tuple[Sensors, Transport]:
    """Return the sensors and the transport that texts such as `bits=14` describe.

    Args:
        texts: each `NAME=VALUE`.
        usual: sensors where nothing is said.
        joints: of the robot.

    Raises:
        ConfigError: unknown names or values that do not suit.
    """
    sensors: dict[str, Any] = {}
    transport: dict[str, Any] = {}
    resolution = np.broadcast_to(usual.resolution, len(joints)).tolist()
    for text in texts:
        name, _, word = (piece.strip() for piece in text.partition('='))
        if name in {'bits', 'resolution'}:
            step = _step(name, word)
            for i, joint in enumerate(joints):
                if joint.is_prismatic == (name == 'resolution'):
                    resolution[i] = step
        elif name in _PER_JOINT:
            sensors[_PER_JOINT[name]] = (_number(name, word),)
        elif name in _SENSOR_TIMES:
            sensors[_SENSOR_TIMES[name]] = _number(name, word)
        elif name in _SWITCHES:
            sensors[_SWITCHES[name]] = _switch(name, word)
        elif name in _TRANSPORT:
            transport[_TRANSPORT[name]] = _number(name, word)
        elif name in _TRANSPORT_SWITCHES:
            transport[_TRANSPORT_SWITCHES[name]] = _switch(name, word)
        else:
            raise ConfigError(
                f'sensor setting {text!r}', f'NAME=VALUE with one of {list(SENSOR_NAMES)}'
            )
    changed = replace(usual, resolution=tuple(resolution), **sensors)
    return changed, Transport(**transport).checked()


def _step(name: str, word: str) -> float:
    number = _number(name, word)
    if name == 'resolution':
        return number
    if not (number.is_integer() and 1 <= number <= _MOST_BITS):
        raise ConfigError(f'sensor setting bits={word}', f'an integer from 1 to {_MOST_BITS}')
    return encoder_resolution(int(number))


def _number(name: str, word: str) -> float:
    try:
        return float(word)
    except ValueError as error:
        raise ConfigError(f'sensor setting {name}={word}', 'a number') from error


def _switch(name: str, word: str) -> bool:
    if word not in _YES + _NO:
        raise ConfigError(f'sensor setting {name}={word}', 'yes or no')
    return word in _YES
