"""A folder of tables, one a quantity, such as `q.csv`, `dq.csv` and `tau.csv`, as one table.

What distinguishes the names of the files follows the names of their columns: `elbow` of
`arm_velocity.csv`, beside `arm_position.csv`, is `elbow.velocity`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from itertools import takewhile
from pathlib import Path

import numpy as np

from sgp_ros.errors import RecordingError
from sgp_ros.recordings.column_names import POSITION, TIME, meaning
from sgp_ros.recordings.table_units import as_numbers
from sgp_ros.strangers import require_file

Columns = dict[str, np.ndarray]
_APART = 'a folder of tables such as q.csv, dq.csv and tau.csv, with the same times'
_CLOSE = 0.5
"""Of a step, by which the times of two files may differ."""


def load_folder(path: Path, read: Callable[[Path], Columns], remarks: list[str]) -> Columns:
    """Return the columns of all CSV and NPY files of a folder by name.

    Args:
        path: of the folder.
        read: of the columns of a CSV file.
        remarks: the files that are read are appended here.

    Raises:
        RecordingError: there are none, they are recordings of their own, or their times differ.
    """
    files = sorted(p for p in path.iterdir() if p.suffix.lower() in {'.csv', '.tsv', '.npy'})
    if len(files) < 2:
        raise RecordingError(f'{path} contains {len(files)} tables', _APART, 'check the path')
    tables = {p.name: _array(p) if p.suffix.lower() == '.npy' else read(p) for p in files}
    whole = [name for name, columns in tables.items() if _is_recording(columns)]
    if whole:
        raise RecordingError(
            f'{path} contains several recordings: {", ".join(whole)}', 'one', 'import each alone'
        )
    remarks.append(f'{path.name}: {", ".join(tables)} are read as one table')
    found: Columns = {}
    for word, columns in zip(_distinct([p.stem for p in files]), tables.values(), strict=True):
        for name, array in columns.items():
            if meaning(name).role == TIME:
                _require_alike(path, found.setdefault(name, array), array)
            else:
                found[f'{name}.{word}' if name else word] = array
    return found


def _array(path: Path) -> Columns:
    require_file(path, 'TABLE_MB')
    try:
        return {'': np.array(np.load(path, mmap_mode='r', allow_pickle=False))}
    except (ValueError, OSError, EOFError) as error:
        raise RecordingError(f'{path} cannot be read ({error})', 'a NumPy .npy file') from error


def _is_recording(columns: Mapping[str, np.ndarray]) -> bool:
    """Return whether a table has positions and something else of a joint."""
    roles = {meaning(name).role for name in columns} - {'', TIME}
    return POSITION in roles and len(roles) > 1


def _distinct(stems: list[str]) -> list[str]:
    """Return the names without the words that all begin or end with."""
    words = [re.split(r'(?<=[._ -])|(?=[._ -])', stem) for stem in stems]
    first = _shared(words)
    last = _shared([w[first:][::-1] for w in words])
    return [''.join(w[first : len(w) - last]).strip('._ -') or s
            for w, s in zip(words, stems, strict=True)]  # fmt: skip


def _shared(words: list[list[str]]) -> int:
    """Return how many first words are the same."""
    return sum(1 for _ in takewhile(lambda x: len(set(x)) == 1, zip(*words, strict=False)))


def _require_alike(path: Path, times: np.ndarray, others: np.ndarray) -> None:
    a, b = as_numbers(times), as_numbers(others)
    if a is None or b is None:
        is_alike = np.array_equal(times, others)
    else:
        steps = np.median(np.abs(np.diff(a))) if len(a) > 1 else 0.0
        is_alike = a.shape == b.shape and bool(np.all(np.abs(a - b) <= _CLOSE * steps))
    if not is_alike:
        raise RecordingError(
            f'the tables of {path} have {len(times)} and {len(others)} rows, or other times',
            _APART, 'bring them to the same times',
        )  # fmt: skip
