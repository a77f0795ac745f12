"""Columns of text tables, read block by block, so that memory holds about the numbers alone.

A cell that is a number becomes one where nothing of it is lost: times since 1970 with all their
decimals stay texts.
"""

from __future__ import annotations

import csv
import re
from array import array
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import chain
from pathlib import Path

import numpy as np

from sgp_ros.errors import RecordingError
from sgp_ros.recordings.table_units import as_numbers, is_number
from sgp_ros.strangers import read_lines, require_within

Columns = dict[str, np.ndarray]
Numbered = tuple[int, str]
"""A line and its number."""

_OF_SPREADSHEETS = 'Windows-1252'
_DELIMITERS = (';', '\t', ',', ' ')
_COMMENTS = '#%'
_COMMENTS_KEPT, _TITLES = 100, 20
"""Lines of comment that may hold the header, and lines without a number behind it."""
_FEW = 0.1
"""Share of the cells of a column up to which cells without a number are mistakes."""
_IN_BRACKETS = re.compile(r'\[[^\[\]]*\]')
_APART = re.compile(r'\[[^\[\]]*\]|\S+')
_TIME = re.compile(r'\d{4}-\d\d-\d\d[T ]\d')
_BLOCK = 1 << 22
"""Characters of a block: its rows times its longest line."""
_DIGITS, _FINE = 15, 1e6
"""Precision of a float: that many digits, or below that magnitude 1e-10 of a unit."""
_RAGGED = '[lists of different lengths]'


def load_text(path: Path, remarks: list[str]) -> tuple[Columns, Sequence[int]]:
    """Return the columns of a CSV file by name, and the line of each row.

    Args:
        path: of the file.
        remarks: what is left out of it is appended here.

    Raises:
        RecordingError: no table.
        TooMuchError: more of it than `TABLE_MB`, `LINE`, `ROWS`, `CELLS` or `UNPACKED_MB`.
    """
    with suppress(UnicodeDecodeError):
        return _load(path, remarks, 'utf-8-sig')
    try:
        found = _load(path, remarks, _OF_SPREADSHEETS)
    except UnicodeDecodeError as error:
        raise RecordingError(
            f'{path} is not a text file ({error})', 'a CSV file in UTF-8'
        ) from error
    remarks.append(f'{path.name} is not in UTF-8; it is read as {_OF_SPREADSHEETS}')
    return found


def _load(path: Path, remarks: list[str], encoding: str) -> tuple[Columns, Sequence[int]]:
    with path.open('rb') as stream:
        n = sum(data.count(b'\n') for data in iter(lambda: stream.read(1 << 20), b''))
    require_within(n, 'ROWS', f'number of lines of {path}')
    read = read_lines(path, 'TABLE_MB', encoding)
    lines = ((i, x) for i, x in enumerate(read, start=1) if x.strip())
    header, mark, rest = _header(path, lines)
    names = _names(path, header, mark)
    require_within(n * len(names), 'CELLS', f'number of cells of {path}')
    table = _Blocks(path, names, mark)
    skipped: list[int] = []
    for number, line in rest:
        if '\0' in line:
            raise RecordingError(f'{path} contains NUL characters', 'a CSV file in UTF-8')
        row = _cells(line, mark)
        if not table.lines and not any(map(_is_value, row)):
            skipped.append(number)  # a second line of the header, such as units
            if len(skipped) > _TITLES:
                break
        elif len(row) == len(names):
            table.add(number, row, len(line))
        elif table.lines and len(row) < len(names) and next(rest, None) is None:
            remarks.append(
                f'{path.name}: the last line, {number}, ends after {len(row)} of {len(names)} '
                'values; it is ignored, all rows before it are used'
            )
        else:
            raise RecordingError(
                f'{path} line {number} has {len(row)} values', f'{len(names)}, as in the header'
            )
    if not table.lines:
        raise RecordingError(f'{path} contains no data', 'a header row, then rows of numbers')
    if skipped:
        remarks.append(
            f'{path.name}: lines {skipped} contain no numbers and are taken as part of the header'
        )
    columns = table.columns()
    for name, column in columns.items():
        _require_numbers(path, name, column, table.lines, remarks)
    return columns, table.lines


class _Blocks:
    """The rows of a table, as arrays of some thousand.

    Attributes:
        lines: the line of each row.
    """

    def __init__(self, path: Path, names: Sequence[str], mark: str) -> None:
        self._path, self._names, self._mark = path, names, mark
        self._rows: list[list[str]] = []
        self._longest = self._bytes = self._cells = 0
        self._blocks: list[list[np.ndarray]] = [[] for _ in names]
        self.lines = array('q')

    def add(self, number: int, row: list[str], length: int) -> None:
        """Add the cells of a line."""
        self.lines.append(number)
        self._rows.append(row)
        self._longest = max(self._longest, length)
        if len(self._rows) * self._longest > _BLOCK:
            self._flush()

    def _flush(self) -> None:
        for blocks, cells in zip(self._blocks, zip(*self._rows, strict=True), strict=True):
            texts = np.char.strip(np.array(cells, dtype=str))  # (n,)
            if self._mark == ';':
                texts = np.char.replace(texts, ',', '.')  # a decimal comma goes with semicolons
            blocks.append(_compact(_column(texts)))
            self._bytes += blocks[-1].nbytes
            self._cells += blocks[-1].size
        self._require(self._bytes)
        require_within(self._cells, 'CELLS', f'number of cells of {self._path}')
        self._rows.clear()
        self._longest = 0

    def columns(self) -> Columns:
        """Return the columns by name."""
        self._flush()
        found = {}
        for name, blocks in zip(self._names, self._blocks, strict=True):
            widest = max(block.dtype.itemsize for block in blocks)
            self._require(widest * sum(block.size for block in blocks))
            found[name] = _joined(blocks)
            blocks.clear()
        return found

    def _require(self, size: int) -> None:
        require_within(size / (1 << 20), 'UNPACKED_MB', f'size of the table {self._path} in MB')


def _compact(texts: np.ndarray) -> np.ndarray:
    """Return numbers where they say what the texts say."""
    numbers = as_numbers(texts)
    if numbers is None or texts.dtype.kind == 'f':
        return texts
    try:
        whole = texts.astype(np.int64)
    except (ValueError, OverflowError):
        largest = np.abs(numbers, where=np.isfinite(numbers), out=np.zeros(numbers.shape)).max()
        is_exact = texts.dtype.itemsize <= 4 * _DIGITS or largest < _FINE
        return numbers if is_exact else texts
    return whole if np.array_equal(whole.astype(str), texts) else texts  # 007 may be a name


def _joined(blocks: list[np.ndarray]) -> np.ndarray:
    """Return one column of its blocks: numbers, texts where one block has some."""
    if len({block.shape[1:] for block in blocks}) > 1:
        blocks = [b if b.ndim == 1 else np.full(len(b), _RAGGED) for b in blocks]
    if len({block.dtype.kind == 'U' for block in blocks}) > 1:
        blocks = [b if b.dtype.kind == 'U' else _texts(b) for b in blocks]
    return np.concatenate(blocks)


def _texts(numbers: np.ndarray) -> np.ndarray:
    return np.where(np.isnan(numbers), '', numbers.astype(str))


def _require_numbers(
    path: Path, name: str, cells: np.ndarray, lines: Sequence[int], remarks: list[str]
) -> None:
    """Refuse a column (n,) of numbers with a few other cells; remark on it where they are many.

    Such a column would be left out like a column of texts, without a notice.
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
    remarks.append(f'{said} is not a number; a column with {len(wrong)} such cells is not used')


def _header(path: Path, lines: Iterator[Numbered]) -> tuple[str, str, Iterator[Numbered]]:
    """Return the header, what separates its cells, and the numbered lines behind it.

    Lines of comment are left out; the last one before the numbers is the header where no other is.
    """
    kept: deque[str] = deque(maxlen=_COMMENTS_KEPT)
    first: Numbered = (0, '')
    for number, line in lines:
        if line.lstrip()[0] not in _COMMENTS:
            first = number, line
            break
        kept.append(line.lstrip(_COMMENTS + ' '))
    comments, is_empty = list(kept), not first[1]
    rest = ((i, line) for i, line in lines if line.lstrip()[0] not in _COMMENTS)
    mark = _mark(first[1] or (comments[-1] if comments else ''))
    if not is_empty and not any(map(_is_value, _cells(first[1], mark))):
        header, below = _below_titles(first, rest)
        return header, _mark(header), below
    titles = [line for line in comments if len(_cells(line, _mark(line))) > 1]
    width = len(_cells(first[1], mark))
    fitting = [line for line in titles if is_empty or len(_cells(line, _mark(line))) == width]
    if not fitting and not is_empty:
        raise RecordingError(
            f'{path} has no header: line {first[0]} already contains numbers',
            'column names in the first line, such as t,q,tau',
            'add that line',
        )
    return (fitting or comments or [''])[-1], mark, chain([] if is_empty else [first], rest)


def _below_titles(first: Numbered, rest: Iterator[Numbered]) -> tuple[str, Iterator[Numbered]]:
    """Return the line of the names of columns, below titles of the log, and the lines behind it.

    It is the first one with as many cells as the numbers, all different; else the very first.
    """
    above = [first]
    for numbered in rest:
        above.append(numbered)
        if len(above) > _TITLES or any(map(_is_value, _cells(numbered[1], _mark(numbered[1])))):
            break
    for i, (_, line) in enumerate(above[:-1]):
        cells = _cells(line, mark := _mark(line))
        if len(cells) == len(_cells(above[-1][1], mark)) == len(set(cells)):
            return line, chain(above[i + 1 :], rest)
    return first[1], chain(above[1:], rest)


def _names(path: Path, header: str, mark: str) -> list[str]:
    """Return the names of the columns."""
    if '\0' in header:
        raise RecordingError(f'{path} contains NUL characters', 'a CSV file in UTF-8')
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
    """Return a column (n,) of texts; of lists in its cells, the matrix (n, m)."""
    if not all(cell.startswith('[') and cell.endswith(']') for cell in cells):
        return cells
    rows = [cell[1:-1].replace(',', ' ').replace(';', ' ').split() for cell in cells]
    if len({len(row) for row in rows}) > 1:
        return cells
    try:
        numbers = np.array(rows, dtype=np.float64)
    except ValueError:
        return np.array(rows, dtype=str)
    is_exact = '_' not in ''.join(cells) and not np.any(np.abs(numbers) >= _FINE)
    return numbers if is_exact else np.array(rows, dtype=str)
