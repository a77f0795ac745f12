"""Gains of drives that a table states: once, one for each joint, or in each row."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sgp_ros.errors import ConfigError, RecordingError
from sgp_ros.recordings.column_names import KD, KP, meaning
from sgp_ros.recordings.table_entries import Columns, Entry, Guess, chosen
from sgp_ros.recordings.table_units import as_numbers, is_constant


def add_gains(
    columns: Columns, entries: Sequence[Entry], joints: Mapping[str, str], rows: int, guess: Guess
) -> None:
    """Enter gains into a guess: numbers, or columns where they change with time.

    Args:
        columns: of the table.
        entries: its columns of numbers, by quantity.
        joints: label of a column to the name of its joint.
        rows: of the table.
        guess: of the map, which is completed.

    Raises:
        RecordingError: neither one gain nor one for each joint.
    """
    found: dict[str, dict[str, Any]] = {}
    for role in (KP, KD):
        given = {joints[x]: e for x, e in chosen(entries, role, guess).items() if x in joints}
        values: dict[str, Any] = {
            j: float(e.numbers[0]) if is_constant(e.numbers) else _place(e)
            for j, e in given.items()
        }
        for name, array in columns.items():
            numbers = as_numbers(array.ravel())
            if meaning(name).role != role or len(array) == rows or numbers is None:
                continue
            if numbers.size not in {1, len(joints)}:
                raise RecordingError(
                    f'{name} contains {numbers.size} gains for {len(joints)} joints',
                    'one gain, one per joint, or one per joint and row',
                    'correct it, or write a map without this column',
                )  # fmt: skip
            each = np.broadcast_to(numbers, len(joints))
            values = {j: float(each[i]) for i, j in enumerate(joints.values())}
        if values:
            found[role] = values
    if set(found) == {KP, KD} and set(found[KP]) == set(found[KD]):
        guess.content['gains'] = found
    elif found:
        guess.unsure.append(f'Of the gains only {" and ".join(found)} is given: not used.')


def _place(entry: Entry) -> dict[str, Any]:
    index = {} if entry.index is None else {'index': entry.index}
    return {'column': entry.column, **index}


def is_recorded(stated: object) -> bool:
    """Return whether gains of a map are columns, of which there is one number a row."""
    tables = stated.values() if isinstance(stated, dict) else ()
    return any(isinstance(x, dict) for t in tables if isinstance(t, dict) for x in t.values())


def row_gains(
    stated: object, columns: Columns, joints: Sequence[str], rows: int
) -> np.ndarray | None:
    """Return the gains of each row, (n, 2, c), kp before kd; None where they do not change.

    Args:
        stated: entry `gains` of a map.
        columns: of the table.
        joints: that have a target, c of them.
        rows: n.

    Raises:
        ConfigError: no such columns, another length, or a gain that is not a number of at least 0.
    """
    if not is_recorded(stated):
        return None
    assert isinstance(stated, dict)
    found = np.zeros((rows, 2, len(joints)))
    for i, role in enumerate((KP, KD)):
        table = stated.get(role) or {}
        if set(table) != set(joints):
            raise ConfigError(f'map: gains.{role} is given for {sorted(map(str, table))}',
                              f'the joints with targets: {sorted(joints)}')  # fmt: skip
        for j, joint in enumerate(joints):
            found[:, i, j] = _gain(table[joint], columns, rows, f'{role} of {joint}')
    return found


def _gain(entry: object, columns: Columns, rows: int, place: str) -> np.ndarray:
    """Return one gain in each row, (n,)."""
    if not isinstance(entry, dict):
        entry_numbers = np.full(rows, entry if isinstance(entry, int | float) else np.nan)
    else:
        array, index = columns.get(str(entry.get('column'))), entry.get('index', 0)
        if array is None:
            raise ConfigError(f'map: gains: {place} in column {entry.get("column")!r}',
                              f'one of {sorted(columns)}')  # fmt: skip
        wide = array if array.ndim == 2 else array[:, None]
        if len(wide) != rows or not isinstance(index, int) or not 0 <= index < wide.shape[1]:
            raise ConfigError(f'map: gains: {place} has {len(wide)} rows and index {index!r}',
                              f'{rows} rows and an index below {wide.shape[1]}')  # fmt: skip
        found = as_numbers(wide[:, index])
        entry_numbers = np.full(rows, np.nan) if found is None else found
    wrong = np.flatnonzero(~(np.isfinite(entry_numbers) & (entry_numbers >= 0.0)))
    if len(wrong):
        raise ConfigError(f'map: gains: {place} is {entry_numbers[wrong[0]]:g} in row '
                          f'{wrong[0]}', 'a number of at least 0')  # fmt: skip
    return entry_numbers
