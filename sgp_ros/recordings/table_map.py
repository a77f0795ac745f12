"""Maps from the columns of a table to quantities with units.

The map is a YAML file, here for a CSV file with the columns `t_s`, `q_m`, `force_N`:

    time: {column: t_s, unit: s}        # s, ms, us or ns; or {rate: 1000.0} without a column
    joints:
      axis:                             # name of the joint
        position: {column: q_m, unit: m}
        effort: {column: force_N, unit: N}

A time may also be a text such as `2024-05-01T12:00:00.25Z`, whatever its unit.
Keys of `time`: `column`, `unit`, `index`, `rate` [Hz], `start`, the epoch [s] that belongs to the
zero of the column (0 by default), and `episode`, a column that numbers parts whose clocks begin
anew: they follow each other. A joint has a `position`, and may have `velocity` and `effort`.
One of which only the velocity was logged, such as a wheel, has no `position`: it is the integral
of the velocity, from zero.
`commands` lists joints the same way. `command_type` is the type in which they are written
(`sensor_msgs/JointState` by default, see `command_types` for the others; one without names has
them in the order of this list, which must be that of the robot). In their place, `targets` lists
what drives are told to reach, and `gains` what they do about it:

    targets: {axis: {position: {column: q_des, unit: m}, velocity: {column: dq_des, unit: m/s}}}
    gains: {kp: {axis: 300.0}, kd: {axis: 10.0}}    # or {axis: {column: kp}}

Keys of a quantity: `column`, `unit`, `index` (which column of a matrix in NPZ or MAT, from 0),
`scale` and `offset`:

    value in SI = scale * (column in unit) + offset

Units are those of `table_units.UNITS`. counts, A, V and % need a `scale` that leads to SI, or to
the unit of effort that the robot states; mA the one of A. A member of a MAT structure is written
`data.q`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import numpy as np

from sgp_ros.engine.samples import CommandSample
from sgp_ros.errors import ConfigError
from sgp_ros.markup import YAMLError, load_yaml
from sgp_ros.recordings.command_types import COMMAND_TYPES
from sgp_ros.recordings.messages import JOINT_STATE
from sgp_ros.recordings.table_files import Columns
from sgp_ros.recordings.table_units import SCALED_AS, TIME_UNITS, UNITS
from sgp_ros.recordings.typestore import new_message
from sgp_ros.strangers import read_text


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
        episode: column that numbers episodes, whose clocks begin anew; empty without.
    """

    quantity: Quantity | None
    rate_hz: float
    start_ns: int
    episode: str = ''


@dataclass(frozen=True, slots=True)
class TableMap:
    """A checked map.

    Attributes:
        time: where stamps come from.
        joints: joint to channel (`position`, `velocity`, `effort`) to its column.
        commands: joint to the column of its command, in the order in which they are written.
        command_type: message type of the commands.
        targets: joint to `position` and `velocity` that its drive is told to reach.
    """

    time: TimeBase
    joints: Mapping[str, Mapping[str, Quantity]]
    commands: Mapping[str, Quantity]
    command_type: str
    targets: Mapping[str, Mapping[str, Quantity]]


def read_map(path: str | Path) -> Mapping[str, object]:
    """Return the content of a YAML map, unchecked.

    Raises:
        ConfigError: no such file, or no mapping in it.
    """
    path = Path(path)
    if not path.is_file():
        raise ConfigError(f'no map at {path}', 'a YAML file', 'see config/import for examples')
    try:
        content = load_yaml(read_text(path))
    except (YAMLError, UnicodeDecodeError) as error:
        raise ConfigError(f'map {path} is not YAML ({error})', 'a YAML file') from error
    if not isinstance(content, dict):
        raise ConfigError(f'map {path} is not a mapping', 'the keys time and joints')
    return content


def check_map(content: Mapping[str, object], columns: Columns) -> TableMap:
    """Check a map against the columns of a table.

    Raises:
        ConfigError: everything that is wrong, in one error that lists the columns there are.
    """
    check = _Check(columns)
    check.keys('map', content, {'time', 'joints', 'commands', 'command_type', 'targets', 'gains'})
    time = check.time(check.mapping('time', content.get('time')))
    joints = {
        str(joint): check.joint(f'joints.{joint}', parts)
        for joint, parts in check.mapping('joints', content.get('joints')).items()
    }
    if not joints:
        check.problems.append('joints: at least one joint is needed')
    commands = {
        str(joint): check.scaled(f'commands.{joint}', parts, UNITS['effort'])
        for joint, parts in check.mapping('commands', content.get('commands', {})).items()
    }
    targets = {
        str(joint): check.target(f'targets.{joint}', parts)
        for joint, parts in check.mapping('targets', content.get('targets', {})).items()
    }
    if commands and targets:
        check.problems.append('commands and targets: only one of them may be given')
    kind = check.command_type(content.get('command_type', JOINT_STATE), tuple(commands or targets))
    if check.problems:
        raise ConfigError(
            f'{len(check.problems)} problems in the map: ' + ' | '.join(check.problems),
            '',
            'the table has ' + ', '.join(f'{n} {list(a.shape)}' for n, a in columns.items()),
        )
    return TableMap(time, joints, commands, kind, targets)


class _Check:
    """Reads parts of a map and gathers what is wrong with them."""

    def __init__(self, columns: Columns) -> None:
        self._columns = columns
        self.problems: list[str] = []

    def mapping(self, place: str, value: object) -> dict[str, object]:
        if isinstance(value, dict):
            return value
        self.problems.append(f'{place}: expected a mapping, found {value!r}')
        return {}

    def keys(self, place: str, content: Mapping[str, object], known: set[str]) -> None:
        for key in content:
            if key not in known:
                self.problems.append(f'{place}: unknown key {key!r}, known are {sorted(known)}')

    def time(self, content: dict[str, object]) -> TimeBase:
        start_ns = round(Decimal(str(self._number('time', content, 'start', 0.0))) * 10**9)
        content = {key: value for key, value in content.items() if key != 'start'}
        if 'rate' not in content:
            self.keys('time', content, {'column', 'unit', 'index', 'rate', 'start', 'episode'})
            units: dict[str, float | None] = {**TIME_UNITS}
            episode = str(content.get('episode', ''))
            if episode and episode not in self._columns:
                self.problems.append(f'time.episode {episode!r}: not in the table')
            return TimeBase(self.quantity('time', content, units), 0.0, start_ns, episode)
        self.keys('time', content, {'rate'})
        rate = self._number('time', content, 'rate', 1.0)
        if not rate > 0.0:
            self.problems.append(f'time.rate {rate!r}: expected a rate above 0 Hz')
        return TimeBase(None, rate, start_ns)

    def command_type(self, kind: object, joints: tuple[str, ...]) -> str:
        known = COMMAND_TYPES.get(str(kind))
        if known is None:
            self.problems.append(f'command_type {kind!r}: expected {" or ".join(COMMAND_TYPES)}')
        elif joints:
            names = joints if known.has_names else None
            try:
                known.message(new_message, CommandSample(0, np.zeros(len(joints)), names))
            except ValueError as error:
                self.problems.append(f'command_type {kind}: {error}')
        return str(kind)

    def joint(self, place: str, parts: object) -> dict[str, Quantity]:
        content = self.mapping(place, parts)
        self.keys(place, content, set(UNITS))
        if not {'position', 'velocity'} & set(content):
            self.problems.append(f'{place}: position is missing, and no velocity is given')
        return {
            channel: self.scaled(f'{place}.{channel}', content[channel], UNITS[channel])
            for channel in UNITS
            if channel in content
        }

    def target(self, place: str, parts: object) -> dict[str, Quantity]:
        content = self.mapping(place, parts)
        self.keys(place, content, {'position', 'velocity'})
        if not content:
            self.problems.append(f'{place}: expected position, velocity or both')
        return {
            channel: self.scaled(f'{place}.{channel}', content[channel], UNITS[channel])
            for channel in ('position', 'velocity')
            if channel in content
        }

    def scaled(self, place: str, parts: object, units: Mapping[str, float | None]) -> Quantity:
        content = self.mapping(place, parts)
        self.keys(place, content, {'column', 'unit', 'index', 'scale', 'offset'})
        return self.quantity(place, content, units)

    def quantity(
        self, place: str, content: dict[str, object], units: Mapping[str, float | None]
    ) -> Quantity:
        factor = self._factor(place, content, units)
        index = content.get('index')
        if index is not None and (not isinstance(index, int) or isinstance(index, bool)):
            self.problems.append(f'{place}.index {index!r}: expected an integer')
            index = None
        column = content.get('column')
        self._check_column(place, column, index)
        scale = self._number(place, content, 'scale', 1.0)
        offset = self._number(place, content, 'offset', 0.0)
        return Quantity(str(column), index, factor * scale, offset)

    def _factor(
        self, place: str, content: dict[str, object], units: Mapping[str, float | None]
    ) -> float:
        unit = content.get('unit')
        if not isinstance(unit, str) or unit not in units:
            said = f'{place}.unit {unit!r}: expected one of {", ".join(units)}'
            is_target = place.startswith('commands.') and unit in UNITS['position']
            said += '; position targets are listed under `targets`' * is_target
            self.problems.append(said)
            return 1.0
        factor = units[unit]
        if factor is None and 'scale' not in content:
            self.problems.append(f'{place}: unit {unit} needs a scale that converts it to SI')
        return SCALED_AS.get(unit, (unit, 1.0))[1] if factor is None else factor

    def _number(self, place: str, content: dict[str, object], key: str, default: float) -> float:
        value = content.get(key, default)
        if isinstance(value, (int, float, str)) and not isinstance(value, bool):
            with suppress(ValueError, OverflowError):
                number = float(value)  # also of a text, because YAML reads 1e-3 as one
                if math.isfinite(number):
                    return number
        self.problems.append(f'{place}.{key} {value!r}: expected a number')
        return default

    def _check_column(self, place: str, column: object, index: int | None) -> None:
        if not isinstance(column, str) or column not in self._columns:
            self.problems.append(f'{place}.column {column!r}: not in the table')
            return
        array = self._columns[column]
        if array.dtype.kind not in 'fiubU':
            self.problems.append(f'{place}.column {column}: is not numeric')
        width = array.shape[1] if array.ndim == 2 else 1
        if array.ndim > 2:
            self.problems.append(f'{place}.column {column}: has {array.ndim} dimensions')
        elif index is None and width > 1:
            self.problems.append(f'{place}: {column} has {width} columns, expected an index')
        elif index is not None and not 0 <= index < width:
            self.problems.append(f'{place}.index {index}: {column} has {width} columns')
