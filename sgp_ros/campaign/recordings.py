"""Which recordings a campaign has, by names that stay, and what a table tells of each."""

from __future__ import annotations

import glob
import math
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timezone
from itertools import takewhile
from pathlib import Path, PurePosixPath

import numpy as np

from sgp_ros.errors import ConfigError, RecordingError
from sgp_ros.recordings.table_files import load_columns

RECORDING, ROBOT, TIME, SESSION = 'recording', 'robot', 'time', 'session'
"""Columns of a table of covariates that mean something by themselves; others are covariates."""
_ENDINGS = ('.mcap', '.bag', '.db3')
_EXPECTED = f'a folder, a recording ({", ".join(_ENDINGS)}, rosbag2 directory) or a pattern'


@dataclass(frozen=True, slots=True)
class TableRow:
    """Row of the table of covariates for one recording.

    Attributes:
        robot: which machine it is of; empty where the table does not say.
        session: from one switching-on to the next; empty likewise.
        time_s: when it began, in place of its stamps [s]; None likewise.
        covariates: numbers by name of their column.
    """

    robot: str = ''
    session: str = ''
    time_s: float | None = None
    covariates: Mapping[str, float] = field(default_factory=dict)


def find_recordings(places: Sequence[str]) -> dict[str, Path]:
    """Return the recordings below some places, by their path from what all have in common.

    A folder with a `metadata.yaml` is one recording. Order is that of the names.

    Args:
        places: folders, recordings, or patterns in which `**` stands for any folders.

    Raises:
        RecordingError: a place does not exist, or none holds a recording.
    """
    found: list[Path] = []
    roots: list[Path] = []
    for place in places:
        if Path(place).exists():
            matches, root = [Path(place)], Path(place)
        elif glob.has_magic(place):
            root = Path(*takewhile(lambda part: not glob.has_magic(part), Path(place).parts))
            matches = sorted(root.glob(str(Path(place).relative_to(root))))
        else:
            raise RecordingError(f'no file or folder at {place}', _EXPECTED, 'check the path')
        is_one = len(matches) == 1 and matches[0] == root and _is_recording(root)
        roots.append((root.parent if is_one else root).resolve())
        for match in matches:
            found += _below(match.resolve())
    if not found:
        raise RecordingError(f'no recording in {", ".join(places)}', _EXPECTED, 'check the path')
    base = Path(os.path.commonpath(roots))
    return {path.relative_to(base).as_posix(): path for path in sorted(set(found))}


def _is_recording(path: Path) -> bool:
    if path.is_dir():
        return (path / 'metadata.yaml').is_file()
    return path.suffix.lower() in _ENDINGS


def _below(path: Path) -> Iterable[Path]:
    """Yield what is a recording at a place or below it; hidden folders are left out."""
    if _is_recording(path):
        yield path
    elif path.is_dir():
        for entry in sorted(path.iterdir()):
            if not entry.name.startswith('.'):
                yield from _below(entry)


def read_covariates(
    path: str | None, names: Sequence[str], remarks: list[str]
) -> dict[str, TableRow]:
    """Return the rows of a table of covariates, by the names of recordings.

    Args:
        path: of a CSV file, or another table that `sgp import` reads, with a column `recording`;
            None for none.
        names: of the recordings; the table may give a file's name alone, or its stem.
        remarks: what is not used of the table is appended here.

    Raises:
        ConfigError: no column `recording`, or a recording twice.
        RecordingError: the file cannot be read.
    """
    found = {name: TableRow() for name in names}
    if path is None:
        return found
    columns, _ = load_columns(Path(path), remarks)
    if RECORDING not in columns:
        raise ConfigError(f'{path} has the columns {sorted(columns)}', f'a column {RECORDING}')
    known = _by_any_name(names)
    rows: dict[str, int] = {}
    strangers = []
    for row, cell in enumerate(columns[RECORDING].tolist()):
        name = known.get(str(cell).strip().removeprefix('./'))
        if name is None:
            strangers.append(str(cell))
        elif name in rows:
            raise ConfigError(f'{path} has {name} in two rows', 'one row per recording')
        else:
            rows[name] = row
    if strangers:
        remarks.append(f'{path}: {len(strangers)} rows match no recording, such as '
                       f'{strangers[0]}')  # fmt: skip
    if len(rows) < len(names):
        remarks.append(f'{path}: no row for {len(names) - len(rows)} of {len(names)} recordings')
    numbers = _numbers(columns, path, remarks)
    for name, row in rows.items():
        found[name] = TableRow(
            str(columns[ROBOT][row]) if ROBOT in columns else '',
            str(columns[SESSION][row]) if SESSION in columns else '',
            _seconds(str(columns[TIME][row]), path) if TIME in columns else None,
            {c: float(x[row]) for c, x in numbers.items() if math.isfinite(x[row])},
        )
    return found


def _by_any_name(names: Sequence[str]) -> dict[str, str]:
    """Return names by themselves, and by file name or stem where only one has it."""
    found: dict[str, str] = {}
    paths = [PurePosixPath(name) for name in names]
    for short in ([path.stem for path in paths], [path.name for path in paths]):
        found |= {s: n for s, n in zip(short, names, strict=True) if short.count(s) == 1}
    return found | {name: name for name in names}


def _numbers(
    columns: Mapping[str, np.ndarray], path: str, remarks: list[str]
) -> dict[str, np.ndarray]:
    """Return the columns that are numbers, empty cells as NaN."""
    found = {}
    for name, column in columns.items():
        if name in {RECORDING, ROBOT, SESSION, TIME}:
            continue
        try:
            found[name] = np.array(
                [float(cell) if str(cell).strip() else math.nan for cell in column.tolist()]
            )
        except (ValueError, TypeError):
            remarks.append(f'{path}: column {name} is not numeric and is not used')
    return found


def _seconds(cell: str, path: str) -> float:
    """Return a time of a table, a number of seconds or ISO 8601 (UTC unless it says) [s]."""
    try:
        return float(cell)
    except ValueError:
        pass
    try:
        found = datetime.fromisoformat(cell.strip().replace('Z', '+00:00'))
    except ValueError as error:
        raise ConfigError(
            f'{path}: {TIME} {cell!r}', 'seconds, or a date such as 2026-05-04T12:30:00'
        ) from error
    return (found if found.tzinfo else found.replace(tzinfo=timezone.utc)).timestamp()
