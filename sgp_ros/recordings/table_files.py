"""Columns of table files by name."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from sgp_ros.errors import RecordingError
from sgp_ros.recordings.model_files import require_unpacked
from sgp_ros.recordings.table_apart import READERS, load_apart, require_bounded
from sgp_ros.recordings.table_formats import refuse
from sgp_ros.recordings.table_text import load_text
from sgp_ros.strangers import readable, require_file

Columns = dict[str, np.ndarray]
ENDINGS = (
    '.csv', '.tsv', '.txt', '.dat', '.npz', '.mat', '.h5', '.hdf5', '.parquet', '.json', '.jsonl',
)  # fmt: skip
"""Of files that are read."""


def load_columns(path: Path, remarks: list[str]) -> tuple[Columns, Sequence[int]]:
    """Return the arrays of a table file by name, and the line of each row; empty without lines.

    Times of a CSV file that a float cannot hold stay texts.

    Args:
        path: with one of `ENDINGS`; of text, the first row names the columns.
        remarks: what is left out of it is appended here.

    Raises:
        RecordingError: no such file, another format, or a damaged one.
        TooMuchError: more than `ROWS` or `CELLS`, or beyond another bound.
    """
    refuse(path)
    if not path.exists() or path.is_dir():
        raise RecordingError(f'no table at {path}', 'a CSV, NPZ or MAT file', 'check the path')
    require_file(path, 'TABLE_MB')
    with readable(path, RecordingError, f'one of {", ".join(ENDINGS)}'):
        columns, lines = _load(path, path.suffix.lower(), remarks)
        require_bounded(path, columns)
        return columns, lines


def _load(path: Path, suffix: str, remarks: list[str]) -> tuple[Columns, Sequence[int]]:
    if suffix == '.npz':
        return _load_npz(path, remarks), ()
    if suffix in READERS:
        return load_apart(path), ()
    if suffix in {'.csv', '.tsv', '.txt', '.dat'}:
        return load_text(path, remarks)
    raise RecordingError(f'{path} has the file type {suffix!r}', f'one of {", ".join(ENDINGS)}')


def _load_npz(path: Path, remarks: list[str]) -> Columns:
    try:
        require_unpacked(path)
        with np.load(path, allow_pickle=False) as content:
            columns = dict(_plain_arrays(content))
            left = [name for name in content.files if name not in columns]
    except (ValueError, OSError, zipfile.BadZipFile, EOFError, AttributeError) as error:
        raise RecordingError(f'{path} cannot be read ({error})', 'a NumPy .npz file') from error
    if left:
        remarks.append(f'{path.name}: {left} contain Python objects and are not read')
    return columns


def _plain_arrays(content: np.lib.npyio.NpzFile) -> Iterator[tuple[str, np.ndarray]]:
    """Yield all arrays but those of Python objects, which would need pickle."""
    for name in content.files:
        try:
            array = content[name]
        except ValueError as error:
            if 'allow_pickle' not in str(error):
                raise
            continue
        yield name, np.atleast_1d(array)
