"""Say which column of a table is which quantity, in which unit.

The map is a YAML file, here for a CSV file with the columns `t_s`, `q_m`, `force_N`:

    time: {column: t_s, unit: s}        # s, ms, us or ns; or {rate: 1000.0} without a column
    joints:
      axis:                             # name of the joint
        position: {column: q_m, unit: m}
        effort: {column: force_N, unit: N}

Keys of `time`: `column`, `unit`, `index`, `rate` [Hz], `start`, the epoch [s] that belongs to the
zero of the column (0 by default). A joint has a `position`, and may have `velocity` and `effort`.
`commands` lists joints the same way; they are written in that order, as the type `command_type`
(`std_msgs/Float64MultiArray` by default, or `sensor_msgs/JointState` with names).

Keys of a quantity: `column`, `unit`, `index` (which column of a matrix in NPZ or MAT, from 0),
`scale` and `offset`:

    value in SI = scale * (column in unit) + offset

Units are m, mm, rad, deg, rev and counts for positions, the same `/s` and rpm for velocities; N,
kN, N m, mN m, A, V and counts for efforts. counts, A and V need a `scale` that leads to SI, or to
the unit of effort that the robot states. A member of a MAT structure is written `data.q`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import yaml

from sgp_ros.errors import ConfigError

_ANGLE = math.pi / 180.0
_POSITION = {'m': 1.0, 'mm': 1e-3, 'rad': 1.0, 'deg': _ANGLE, 'rev': 2.0 * math.pi}
UNITS: dict[str, dict[str, float | None]] = {
    'position': {**_POSITION, 'counts': None},
    'velocity': {
        **{f'{unit}/s': factor for unit, factor in _POSITION.items()},
        'rpm': 2.0 * math.pi / 60.0,
        'counts/s': None,
    },
    'effort': {
        'N': 1.0, 'kN': 1e3, 'N m': 1.0, 'Nm': 1.0, 'mN m': 1e-3, 'mNm': 1e-3,
        'A': None, 'V': None, 'counts': None,
    },
}  # fmt: skip
"""Unit to its factor to SI, per quantity; None where only a `scale` can tell."""

TIME_UNITS = {'s': 1_000_000_000, 'ms': 1_000_000, 'us': 1000, 'ns': 1}


@dataclass(frozen=True, slots=True)
class Quantity:
    """One column: SI value = factor * value + offset.

    Attributes:
        column: its name.
        index: which column of a matrix, None for a vector.
        factor: SI per unit of the column.
        offset: [SI].
    """

    column: str
    index: int | None = None
    factor: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, slots=True)
class TimeBase:
    """Where stamps come from: a column, or a rate.

    Attributes:
        quantity: the column; its factor is the nanoseconds per unit. None with a rate.
        rate_hz: samples per second, 0 with a column.
        start_ns: stamp of time zero [ns].
    """

    quantity: Quantity | None
    rate_hz: float
    start_ns: int


@dataclass(frozen=True, slots=True)
class TableMap:
    """A checked map.

    Attributes:
        time: where stamps come from.
        joints: joint to channel (`position`, `velocity`, `effort`) to its column.
        commands: joint to the column of its command, in the order in which they are written.
        command_type: message type of the commands.
    """

    time: TimeBase
    joints: Mapping[str, Mapping[str, Quantity]]
    commands: Mapping[str, Quantity]
    command_type: str


def read_map(path: str | Path) -> Mapping[str, object]:
    """Return the content of a YAML map, unchecked.

    Raises:
        ConfigError: no such file, or no mapping in it.
    """
    path = Path(path)
    if not path.is_file():
        raise ConfigError(f'no map at {path}', 'a YAML file', 'see config/import for examples')
    try:
        content = yaml.safe_load(path.read_text(encoding='utf-8'))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigError(f'map {path} is not YAML ({error})', 'a YAML file') from error
    if not isinstance(content, dict):
        raise ConfigError(f'map {path} holds no mapping', 'keys time and joints')
    return content
