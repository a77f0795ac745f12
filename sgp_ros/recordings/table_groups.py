"""The recording that is meant of a file, one row a time."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from sgp_ros.errors import RecordingError
from sgp_ros.recordings.column_names import POSITION, TIME, meaning
from sgp_ros.recordings.table_entries import Columns

_PART = re.compile(
    r'(.+)[._ -](train|training|test|val|valid|validation|estimation)', re.IGNORECASE
)
"""Name of a column whose last word tells which recording it belongs to."""
_LISTED = 8
"""Recordings of a file that are listed."""
_SLIM = 20
"""Columns per row from which on a matrix lies on its side, if no time tells its length."""


def one_recording(path: Path, columns: Columns, group: str | None, *, is_guessed: bool) -> Columns:
    """Return the columns of a recording, one row a time.

    Groups with times and positions of their own are recordings, such as `sim.q` and `real.q`;
    so are columns whose names differ in a last word alone, such as `q_train` and `q_test`, and
    the parts 0, 1, ... of arrays of three dimensions.

    Args:
        path: of the file.
        columns: all of the file by name.
        group: whose columns are read, without its name; None for all.
        is_guessed: whether no map says which columns are meant.

    Raises:
        RecordingError: there are several and none is chosen, or there is no such group.
    """
    groups = _groups(columns)
    parts = _parts(columns) or _episodes(columns)
    several = [name for name, found in groups.items() if _is_recording(found)] + [*parts]
    if group is None and is_guessed and len(several) > 1:
        raise RecordingError(
            f'{path.name} contains several recordings: {_list(several)}', 'one',
            f'choose it, such as by --group {several[0]}',
        )  # fmt: skip
    if group is None:
        return _upright(columns)
    found = parts.get(group) or groups.get(group)
    if not found:
        known = sorted({*groups, *parts})
        raise RecordingError(f'{path.name} has no group {group!r}', f'one of {_list(known)}')
    return _upright(found)


def _groups(columns: Columns) -> dict[str, Columns]:
    """Return the columns below each first part of dotted names, under the rest of their names."""
    found: dict[str, Columns] = {}
    for name, array in columns.items():
        head, _, rest = name.partition('.')
        if rest:
            found.setdefault(head, {})[rest] = array
    return found


def _is_recording(columns: Columns) -> bool:
    said = [meaning(name) for name in columns]
    return {TIME, POSITION} <= {x.role for x in said if not x.is_target}


def _parts(columns: Columns) -> dict[str, Columns]:
    """Return the columns of each last word that tells recordings apart; none of only one.

    Columns without such a word belong to each of them.
    """
    found: dict[str, Columns] = {}
    for name, array in columns.items():
        match = _PART.fullmatch(name)
        if match is not None:
            found.setdefault(match[2], {})[match[1]] = array
    shared = set.intersection(*(set(x) for x in found.values())) if found else set()
    if len(found) < 2 or len(shared) < 2:
        return {}
    rest = {name: x for name, x in columns.items() if _PART.fullmatch(name) is None}
    return {word: rest | x for word, x in found.items()}


def _episodes(columns: Columns) -> dict[str, Columns]:
    """Return the parts of arrays (k, n, m) by their number; none without such arrays.

    Columns of fewer dimensions belong to each of them, but for those with k rows.
    """
    sizes = {len(x) for x in columns.values() if x.ndim == 3}
    if len(sizes) != 1:
        return {}
    (count,) = sizes
    return {
        str(i): {name: x[i] if len(x) == count else x for name, x in columns.items()}
        for i in range(count)
    }


def _list(names: list[str]) -> str:
    more = f', ... ({len(names)} in all)' if len(names) > _LISTED else ''
    return ', '.join(names[:_LISTED]) + more


def _upright(columns: Columns) -> Columns:
    """Return columns whose matrices have one row a time, also where they had one row a joint."""
    wide = [x for x in columns.values() if x.ndim == 2 and x.dtype.kind in 'fiub']
    times = {
        x.size for name, x in columns.items()
        if meaning(name).role == TIME and 1 < x.size == max(x.shape)
    }  # fmt: skip
    if not times and all(_SLIM * x.shape[0] <= x.shape[1] for x in wide):
        times = {x.shape[1] for x in wide}
    if len(times) != 1:
        return columns
    (rows,) = times
    return {name: _turned(array, rows) for name, array in columns.items()}


def _turned(array: np.ndarray, rows: int) -> np.ndarray:
    if array.ndim != 2 or array.shape[1] != rows or array.shape[0] == rows:
        return array
    return array[0] if len(array) == 1 else array.T
