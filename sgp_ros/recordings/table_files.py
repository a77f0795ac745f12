"""Columns of CSV, NPZ and MAT files by name."""

from __future__ import annotations

import csv
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.io import loadmat
from scipy.io.matlab import MatReadError

from sgp_ros.errors import RecordingError

Columns = dict[str, np.ndarray]
_DELIMITERS = (';', '\t', ',', ' ')


def load_columns(path: Path) -> Columns:
    """Return the arrays of a table file by name; texts of a CSV file stay texts.

    Args:
        path: `.csv`, `.tsv`, `.txt`, `.dat` with a header row; `.npz`; `.mat` up to version 7.

    Raises:
        RecordingError: no such file, another format, or a damaged one.
    """
    if not path.is_file():
        raise RecordingError(f'no table at {path}', 'a CSV, NPZ or MAT file', 'check the path')
    suffix = path.suffix.lower()
    if suffix == '.npz':
        return _load_npz(path)
    if suffix == '.mat':
        return _load_mat(path)
    if suffix in {'.csv', '.tsv', '.txt', '.dat'}:
        return _load_csv(path)
    raise RecordingError(f'{path} with ending {suffix!r}', '.csv, .tsv, .txt, .dat, .npz or .mat')


def _load_csv(path: Path) -> Columns:
    try:
        lines = path.read_text(encoding='utf-8-sig').splitlines()
    except UnicodeDecodeError as error:
        raise RecordingError(f'{path} is no text ({error})', 'a CSV file in UTF-8') from error
    header = lines[0].lstrip('# ') if lines else ''
    delimiter = next((mark for mark in _DELIMITERS if mark in header), ',')
    names = [name.strip() for name in next(csv.reader([header], delimiter=delimiter), [])]
    rows = []
    for number, line in enumerate(lines[1:], start=2):
        if line.strip():
            row = line.split() if delimiter == ' ' else line.split(delimiter)
            if len(row) != len(names):
                raise RecordingError(
                    f'{path} line {number} has {len(row)} values', f'{len(names)} as the header'
                )
            rows.append(row)
    if not rows:
        raise RecordingError(f'{path} holds no row', 'a header row, then rows of numbers')
    table = np.char.strip(np.array(rows, dtype=str))  # (n, number of columns)
    if delimiter == ';':
        table = np.char.replace(table, ',', '.')  # a decimal comma goes with semicolons
    return {name: table[:, column] for column, name in enumerate(names)}


def _load_npz(path: Path) -> Columns:
    try:
        with np.load(path, allow_pickle=False) as content:
            return dict(_plain_arrays(content))
    except (ValueError, OSError, zipfile.BadZipFile, EOFError, AttributeError) as error:
        raise RecordingError(f'{path} cannot be read ({error})', 'a NumPy .npz file') from error


def _plain_arrays(content: np.lib.npyio.NpzFile) -> Iterator[tuple[str, np.ndarray]]:
    """Yield all arrays but those of Python objects, which would need pickle."""
    for name in content.files:
        try:
            array = content[name]
        except ValueError:
            continue
        if array.ndim:
            yield name, array


def _load_mat(path: Path) -> Columns:
    try:
        content = loadmat(path, simplify_cells=True)
    except NotImplementedError as error:
        raise RecordingError(
            f'{path} is a MAT file of version 7.3 (HDF5)',
            'version 7 or older',
            "save it in MATLAB with save(file, '-v7')",
        ) from error
    except (MatReadError, ValueError, TypeError, KeyError, IndexError, zlib.error) as error:
        raise RecordingError(f'{path} cannot be read ({error})', 'a MATLAB .mat file') from error
    return dict(_flattened('', content))


def _flattened(prefix: str, content: dict[str, object]) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the arrays of nested structures under dotted names."""
    for name, value in content.items():
        if isinstance(value, dict):
            yield from _flattened(f'{prefix}{name}.', value)
        elif isinstance(value, np.ndarray) and value.ndim and value.dtype.kind in 'fiub':
            yield prefix + name, value
