"""Check a map against the columns of a table, and list everything that is wrong at once."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from decimal import Decimal

from sgp_ros.errors import ConfigError
from sgp_ros.recordings.messages import FLOAT64_ARRAY, JOINT_STATE
from sgp_ros.recordings.table_files import Columns
from sgp_ros.recordings.table_map import TIME_UNITS, UNITS, Quantity, TableMap, TimeBase


def check_map(content: Mapping[str, object], columns: Columns) -> TableMap:
    """Check a map against the columns of a table.

    Raises:
        ConfigError: everything that is wrong, in one error that lists the columns there are.
    """
    check = _Check(columns)
    check.keys('map', content, {'time', 'joints', 'commands', 'command_type'})
    time = check.time(check.mapping('time', content.get('time')))
    joints = {
        str(joint): check.joint(f'joints.{joint}', parts)
        for joint, parts in check.mapping('joints', content.get('joints')).items()
    }
    if not joints:
        check.problems.append('joints: at least one is needed')
    commands = {
        str(joint): check.scaled(f'commands.{joint}', parts, UNITS['effort'])
        for joint, parts in check.mapping('commands', content.get('commands', {})).items()
    }
    kinds = (FLOAT64_ARRAY, JOINT_STATE)
    kind = content.get('command_type', FLOAT64_ARRAY)
    if kind not in kinds:
        check.problems.append(f'command_type {kind!r}: expected {" or ".join(kinds)}')
    if check.problems:
        raise ConfigError(
            f'{len(check.problems)} problems in the map: ' + ' | '.join(check.problems),
            '',
            'the table has ' + ', '.join(f'{n} {list(a.shape)}' for n, a in columns.items()),
        )
    return TableMap(time, joints, commands, str(kind))


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
        start = self._number('time', content, 'start', 0.0)
        start_ns = round(Decimal(str(start)) * 1_000_000_000)
        content = {key: value for key, value in content.items() if key != 'start'}
        if 'rate' not in content:
            self.keys('time', content, {'column', 'unit', 'index', 'rate', 'start'})
            units: dict[str, float | None] = {**TIME_UNITS}
            return TimeBase(self.quantity('time', content, units), 0.0, start_ns)
        self.keys('time', content, {'rate'})
        rate = self._number('time', content, 'rate', 1.0)
        if not rate > 0.0:
            self.problems.append(f'time.rate {rate!r}: expected more than 0 Hz')
        return TimeBase(None, rate, start_ns)

    def joint(self, place: str, parts: object) -> dict[str, Quantity]:
        content = self.mapping(place, parts)
        self.keys(place, content, set(UNITS))
        if 'position' not in content:
            self.problems.append(f'{place}: no position')
        return {
            channel: self.scaled(f'{place}.{channel}', content[channel], UNITS[channel])
            for channel in UNITS
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
            self.problems.append(f'{place}.unit {unit!r}: expected one of {", ".join(units)}')
            return 1.0
        factor = units[unit]
        if factor is None and 'scale' not in content:
            self.problems.append(f'{place}: unit {unit} needs a scale that leads to SI')
        return 1.0 if factor is None else factor

    def _number(self, place: str, content: dict[str, object], key: str, default: float) -> float:
        value = content.get(key, default)
        if isinstance(value, (int, float, str)) and not isinstance(value, bool):
            with suppress(ValueError):
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
            self.problems.append(f'{place}.column {column}: holds no numbers')
        width = array.shape[1] if array.ndim == 2 else 1
        if array.ndim > 2:
            self.problems.append(f'{place}.column {column}: has {array.ndim} dimensions')
        elif index is None and width > 1:
            self.problems.append(f'{place}: {column} has {width} columns, expected an index')
        elif index is not None and not 0 <= index < width:
            self.problems.append(f'{place}.index {index}: {column} has {width} columns')
