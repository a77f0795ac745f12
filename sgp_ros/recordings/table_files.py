"""Columns of CSV, NPZ and MAT files by name."""

from __future__ import annotations

import csv
import re
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from sgp_ros.errors import RecordingError
from sgp_ros.recordings.model_files import require_unpacked
from sgp_ros.recordings.table_apart import READERS, load_apart
from sgp_ros.recordings.table_formats import load_json, refuse
from sgp_ros.recordings.table_units import as_numbers, is_number
from sgp_ros.strangers import read_text, readable, require_file, require_within

Columns = dict[str, np.ndarray]
ENDINGS = (
    '.csv', '.tsv', '.txt', '.dat', '.npz', '.mat', '.h5', '.hdf5', '.parquet', '.json', '.jsonl',
)  # fmt: skip
"""Of files that are read."""
_DELIMITERS = (';', '\t', ',', ' ')
_COMMENTS = '#%'
_FEW = 0.1
"""Share of the cells of a column up to which those that are no numbers are mistakes."""
_IN_BRACKETS = re.compile(r'\[[^\[\]]*\]')
_APART = re.compile(r'\[[^\[\]]*\]|\S+')
_TIME = re.compile(r'\d{4}-\d\d-\d\d[T ]\d')


def load_columns(path: Path, remarks: list[str]) -> tuple[Columns, Sequence[int]]:
    """Return the arrays of a table file by name, and the line of each row; empty without lines.

    Texts of a CSV file stay texts.

    Args:
        path: with one of `ENDINGS`; of text, the first row names the columns.
        remarks: what is left out of it is appended here.

    Raises:
        RecordingError: no such file, another format, or a damaged one.
    """
    refuse(path)
    if not path.exists() or path.is_dir():
        raise RecordingError(f'no table at {path}', 'a CSV, NPZ or MAT file', 'check the path')
    require_file(path, 'TABLE_MB')
    with readable(path, RecordingError, f'one of {", ".join(ENDINGS)}'):
        return _load(path, path.suffix.lower(), remarks)


def _load(path: Path, suffix: str, remarks: list[str]) -> tuple[Columns, Sequence[int]]:
    if suffix == '.npz':
        return _load_npz(path, remarks), ()
    if suffix in READERS:
        return load_apart(path), ()
    if suffix in {'.json', '.jsonl', '.ndjson'}:
        return load_json(path), ()
    if suffix in {'.csv', '.tsv', '.txt', '.dat'}:
        return _load_csv(path, remarks)
    raise RecordingError(f'{path} has the file type {suffix!r}', f'one of {", ".join(ENDINGS)}')


def _load_csv(path: Path, remarks: list[str]) -> tuple[Columns, Sequence[int]]:
    try:
        lines = read_text(path, 'TABLE_MB').splitlines()
    except UnicodeDecodeError as error:
        raise RecordingError(
            f'{path} is not a text file ({error})', 'a CSV file in UTF-8'
        ) from error
    header, mark, rest = _header(path, lines)
    names = _names(path, header, mark, rest)
    rows: list[list[str]] = []
    taken: list[int] = []
    skipped, last = [], rest[-1][0] if rest else 0
    for number, line in rest:
        row = _cells(line, mark)
        if not rows and not any(map(_is_value, row)):
            skipped.append(number)  # a second line of the header, such as units
        elif len(row) == len(names):
            rows.append(row)
            taken.append(number)
        elif number == last and rows and len(row) < len(names):
            remarks.append(
                f'{path.name}: the last line, {number}, ends after {len(row)} of {len(names)} '
                'values; it is ignored, all rows before it are used'
            )
        else:
            raise RecordingError(
                f'{path} line {number} has {len(row)} values', f'{len(names)}, as in the header'
            )
    if not rows:
        raise RecordingError(f'{path} contains no data', 'a header row, then rows of numbers')
    if skipped:
        remarks.append(
            f'{path.name}: lines {skipped} contain no numbers and are taken as part of the header'
        )
    longest = max(len(cell) for row in rows for cell in row)
    megabytes = 4e-6 * longest * len(rows) * len(names)  # NumPy keeps the longest for all
    require_within(megabytes, 'UNPACKED_MB', f'size of the table {path} in MB')
    table = np.char.strip(np.array(rows, dtype=str))  # (n, number of columns)
    if mark == ';':
        table = np.char.replace(table, ',', '.')  # a decimal comma goes with semicolons
    columns = {name: _column(table[:, i]) for i, name in enumerate(names)}
    for name, column in columns.items():
        _require_numbers(path, name, column, taken, remarks)
    return columns, taken


def _require_numbers(
    path: Path, name: str, cells: np.ndarray, lines: list[int], remarks: list[str]
) -> None:
    """Refuse a column (n,) of numbers with a few cells that are none; say it where they are more.

    Such a column would be left out as one of texts is, and nobody would know.
    """
    if cells.ndim > 1 or as_numbers(cells) is not None:
        return
    wrong = [i for i, cell in enumerate(cells) if cell and not is_number(cell)]
    if not wrong or len(wrong) == np.count_nonzero(cells):
        return
    said = f'{path.name} line {lines[wrong[0]]}, column {name}: {str(cells[wrong[0]])[:40]!r}'
    if len(wrong) < _FEW * len(cells):
        raise RecordingError(
            said, 'a number, or an empty cell for a missing one', 'correct it, or drop the column'
        )
    remarks.append(f'{said} is no number; a column with {len(wrong)} such cells is not used')


def _header(path: Path, lines: list[str]) -> tuple[str, str, list[tuple[int, str]]]:
    """Return the header, what separates its cells, and the numbered lines behind it.

    Lines of comment are left out; the last one before the numbers is the header where no other is.
    """
    numbered = [(i, line) for i, line in enumerate(lines, start=1) if line.strip()]
    plain = [(i, line) for i, line in numbered if line.lstrip()[0] not in _COMMENTS]
    first = plain[0] if plain else (len(lines) + 1, '')
    comments = [line.lstrip(_COMMENTS + ' ') for i, line in numbered if i < first[0]]
    mark = _mark(first[1] or (comments[-1] if comments else ''))
    if not plain or any(map(_is_value, _cells(first[1], mark))):
        titles = [line for line in comments if len(_cells(line, _mark(line))) > 1]
        width = len(_cells(first[1], mark)) if plain else 0
        fitting = [line for line in titles if not plain or len(_cells(line, _mark(line))) == width]
        if not fitting and plain:
            raise RecordingError(
                f'{path} has no header: line {first[0]} already contains numbers',
                'column names in the first line, such as t,q,tau',
                'add that line',
            )
        return (fitting or comments or [''])[-1], mark, plain
    return first[1], mark, plain[1:]


def _names(path: Path, header: str, mark: str, rest: list[tuple[int, str]]) -> list[str]:
    """Return the names of the columns, once it is sure that the text can be a table."""
    if '\0' in header or any('\0' in line for _, line in rest):
        raise RecordingError(f'{path} contains NUL characters', 'a CSV file in UTF-8')
    require_within(
        max((len(line) for _, line in rest), default=0), 'LINE', f'length of a line of {path}'
    )
    names = [name.strip().strip('"') for name in _cells(header, mark)]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise RecordingError(f'{path} has several columns named {twice}', 'unique names')
    return names


def _mark(line: str) -> str:
    """Return what separates the cells of a line; what stands in brackets does not count."""
    bare = _IN_BRACKETS.sub('', line)
    return next((mark for mark in _DELIMITERS if mark in bare.strip()), ',')


def _cells(line: str, mark: str) -> list[str]:
    """Return the cells of a line; a list in brackets or quotes is one cell."""
    if mark == ' ':
        return line.split() if '[' not in line else _APART.findall(line)
    kept = _IN_BRACKETS.sub(lambda m: m.group().replace(mark, '\0'), line)
    cells = next(csv.reader([kept], delimiter=mark), [])
    return [cell.replace('\0', mark) for cell in cells]


def _is_value(cell: str) -> bool:
    """Return whether a cell holds a number, a list or a time."""
    text = cell.strip()
    if text.startswith('[') or _TIME.match(text):
        return True
    return is_number(text.replace(',', '.'))


def _column(cells: np.ndarray) -> np.ndarray:
    """Return a column (n,) of texts; of lists in its cells, the matrix (n, m) of their texts."""
    if not all(cell.startswith('[') and cell.endswith(']') for cell in cells):
        return cells
    rows = [cell[1:-1].replace(',', ' ').replace(';', ' ').split() for cell in cells]
    return np.array(rows, dtype=str) if len({len(row) for row in rows}) == 1 else cells


def _load_npz(path: Path, remarks: list[str]) -> Columns:
    try:
        require_unpacked(path)
        with np.load(path, allow_pickle=False) as content:
            columns = dict(_plain_arrays(content))
            left = [name for name in content.files if name not in columns]
    except (ValueError, OSError, zipfile.BadZipFile, EOFError, AttributeError) as error:
        raise RecordingError(f'{path} cannot be read ({error})', 'a NumPy .npz file') from error
    if left:
        remarks.append(f'{path.name}: {left} hold Python objects and are not read')
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
