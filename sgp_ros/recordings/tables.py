"""Tables of numbers as the events of the engine, by means of a map.

A row becomes one state, and one command where the map names commands. Times are written as they
are, also where they do not grow: the engine refuses and counts such samples. See `table_map` for
the map.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sgp_ros.engine.samples import (
    EFFORT,
    POSITION,
    VELOCITY,
    CommandSample,
    JointSample,
    frozen_array,
)
from sgp_ros.errors import ConfigError, RecordingError
from sgp_ros.recordings.command_types import COMMAND_TYPES
from sgp_ros.recordings.table_files import Columns, load_columns
from sgp_ros.recordings.table_gains import row_gains
from sgp_ros.recordings.table_map import Quantity, TableMap, check_map
from sgp_ros.recordings.table_stamps import column_of, row_stamps
from sgp_ros.recordings.table_units import as_numbers, is_number

_GREATEST = 1e150
"""Above this a number has no square, so nothing can be computed of it."""
_LISTED = 5
"""Refused rows that are listed by number."""


@dataclass(frozen=True, slots=True)
class Table:
    """A table in SI, n rows.

    Attributes:
        stamps_ns: n stamps [ns].
        joints: joint names, m of them.
        channels: `position`, `velocity`, `effort` to (n, m), NaN for a joint without; a channel
            that no joint has is absent.
        commands: (n, c) commands, None without.
        command_joints: their joints, c of them.
        command_type: message type of the commands.
        remarks: what was left out of the file.
        command_kind: what the commands are, see `CommandSample`.
        command_rates: (n, c) target velocities beside commanded positions, None without.
        command_gains: (n, 2, c) gains of the drives, kp before kd; None where they are constant.
    """

    stamps_ns: tuple[int, ...]
    joints: tuple[str, ...]
    channels: Mapping[str, np.ndarray]
    commands: np.ndarray | None
    command_joints: tuple[str, ...]
    command_type: str
    remarks: tuple[str, ...] = ()
    command_kind: str = EFFORT
    command_rates: np.ndarray | None = None
    command_gains: np.ndarray | None = None

    def events(self) -> Iterator[JointSample | CommandSample]:
        """Yield the rows in order, the command of a row before its state."""
        has_names = COMMAND_TYPES[self.command_type].has_names
        names = self.command_joints if has_names else None
        for row, stamp_ns in enumerate(self.stamps_ns):
            if self.commands is not None:
                rates = None if self.command_rates is None else self.command_rates[row]
                yield CommandSample(
                    stamp_ns, frozen_array(self.commands[row]), names, self.command_kind,
                    None if rates is None else frozen_array(rates), self._gains(row),
                )  # fmt: skip
            values = {name: frozen_array(array[row]) for name, array in self.channels.items()}
            yield JointSample(stamp_ns, self.joints, **values)

    def _gains(self, row: int) -> dict[str, tuple[float, float]] | None:
        if self.command_gains is None:
            return None
        kp, kd = self.command_gains[row].tolist()
        return {j: (p, d) for j, p, d in zip(self.command_joints, kp, kd, strict=True)}


def read_table(
    path: str | Path, content: Mapping[str, object],
    loaded: tuple[Columns, Sequence[int]] | None = None,
) -> Table:  # fmt: skip
    """Read a table.

    Args:
        path: CSV, NPZ or MAT file.
        content: the map, see `table_map`.
        loaded: what `load_columns` gave, where it has been called.

    Raises:
        ConfigError: what is wrong with the map, all in one error.
        RecordingError: the file cannot be read, or holds something other than numbers and times.
    """
    path = Path(path)
    remarks: list[str] = []
    columns, lines = loaded or load_columns(path, remarks)
    bare = {n.rpartition(' [')[0]: x for n, x in columns.items() if n.endswith(']')}
    columns = bare | dict(columns)  # a map may leave out units that stood beside the name
    table_map = check_map(content, columns)
    quantities = {
        f'{joint}.{channel}': quantity
        for joint, parts in table_map.joints.items()
        for channel, quantity in parts.items()
    }
    quantities |= {f'command {joint}': q for joint, q in table_map.commands.items()}
    quantities |= {
        f'target {joint} {channel}': quantity
        for joint, parts in table_map.targets.items()
        for channel, quantity in parts.items()
    }
    values = {place: _values(path, columns, quantity) for place, quantity in quantities.items()}
    lengths = {place: len(array) for place, array in values.items()}
    n = next(iter(lengths.values()))
    stamps_ns = row_stamps(path, columns, table_map.time, n)
    lengths['time'] = len(stamps_ns)
    if set(lengths.values()) != {n}:
        raise ConfigError(f'{path}: columns of different lengths {lengths}', 'equal lengths')
    for joint, parts in table_map.joints.items():
        if POSITION not in parts:
            values[f'{joint}.position'] = _integral(values[f'{joint}.velocity'], stamps_ns)
            remarks.append(f'{path.name}: the position of {joint} is the integral of its velocity')
    table = _assemble(table_map, values, stamps_ns)
    gains = row_gains(content.get('gains'), columns, table.command_joints, n)
    table = replace(table, command_gains=gains)
    return _without_impossible(path, table, lines, remarks)


def _assemble(
    table_map: TableMap, values: Mapping[str, np.ndarray], stamps_ns: tuple[int, ...]
) -> Table:
    missing = np.full(len(stamps_ns), np.nan)
    channels = {}
    for channel in ('position', 'velocity', 'effort'):
        if channel == POSITION or any(channel in x for x in table_map.joints.values()):
            stack = [values.get(f'{joint}.{channel}', missing) for joint in table_map.joints]
            channels[channel] = np.stack(stack, axis=1)  # (n, m)
    joints, kind = tuple(table_map.joints), table_map.command_type
    if table_map.commands:
        stack = [values[f'command {joint}'] for joint in table_map.commands]
        commands = np.stack(stack, axis=1)  # (n, c)
        return Table(stamps_ns, joints, channels, commands, tuple(table_map.commands), kind)
    if not table_map.targets:
        return Table(stamps_ns, joints, channels, None, (), kind)
    asked = {
        channel: np.stack(
            [values.get(f'target {j} {channel}', missing) for j in table_map.targets], axis=1
        )
        for channel in (POSITION, VELOCITY)
        if any(channel in parts for parts in table_map.targets.values())
    }  # (n, c) each
    first = POSITION if POSITION in asked else VELOCITY
    rates = asked.get(VELOCITY) if first == POSITION else None
    return Table(
        stamps_ns, joints, channels, asked[first], tuple(table_map.targets), kind,
        command_kind=first, command_rates=rates,
    )  # fmt: skip


def _integral(velocity: np.ndarray, stamps_ns: Sequence[int]) -> np.ndarray:
    """Return the integral of a velocity (n,) from zero, by trapezoids; backward steps add none."""
    known = np.flatnonzero(np.isfinite(velocity))
    if not len(known):
        return np.full(len(velocity), np.nan)
    whole = np.interp(np.arange(len(velocity)), known, velocity[known])
    seconds = np.maximum(np.diff(np.array(stamps_ns, dtype=np.int64)) * 1e-9, 0.0)
    return np.concatenate([[0.0], np.cumsum(0.5 * (whole[1:] + whole[:-1]) * seconds)])


def _without_impossible(
    path: Path, table: Table, lines: Sequence[int], remarks: list[str]
) -> Table:
    """Return a table less the rows that no robot can have shown, which are counted.

    A row may lack velocity, effort or command, but not a position.
    """
    asked = (table.commands, table.command_rates)
    arrays = [x for x in (*table.channels.values(), *asked) if x is not None]
    wrong = np.isnan(table.channels['position']).any(axis=1)
    for array in arrays:
        wrong |= (np.isinf(array) | (np.abs(np.nan_to_num(array)) > _GREATEST)).any(axis=1)
    if not wrong.any():
        return replace(table, remarks=tuple(remarks))
    what = 'lines' if lines else 'rows from 0'
    listed = ', '.join(str(lines[i] if lines else i) for i in np.flatnonzero(wrong)[:_LISTED])
    more = ', ...' if wrong.sum() > _LISTED else ''
    said = f'{path.name}: {wrong.sum()} of {len(wrong)} rows ignored, {what} {listed}{more}'
    if wrong.all():
        raise RecordingError(said, 'finite numbers below 1e150', 'correct the table')
    kept = ~wrong
    return replace(
        table,
        stamps_ns=tuple(s for s, k in zip(table.stamps_ns, kept, strict=True) if k),
        channels={name: array[kept] for name, array in table.channels.items()},
        commands=None if table.commands is None else table.commands[kept],
        command_rates=None if table.command_rates is None else table.command_rates[kept],
        command_gains=None if table.command_gains is None else table.command_gains[kept],
        remarks=(
            *remarks,
            f'{said}: a position is missing, or a number is infinite or above 1e150',
        ),
    )


def _values(path: Path, columns: Columns, quantity: Quantity) -> np.ndarray:
    """Return one quantity in SI, (n,)."""
    column = column_of(columns, quantity)
    if column.dtype.kind != 'U':
        return column.astype(np.float64) * quantity.factor + quantity.offset
    numbers = as_numbers(column)
    if numbers is None:
        wrong = next(str(cell) for cell in column if cell and not is_number(str(cell)))
        raise RecordingError(
            f'{path}, column {quantity.column}: {wrong[:40]!r}',
            'numbers, or an empty cell for a missing value',
        )
    return numbers * quantity.factor + quantity.offset
