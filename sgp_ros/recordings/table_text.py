"""Columns of text tables, read block by block, so that memory holds about the numbers alone.

A cell that is a number becomes one where nothing of it is lost: times since 1970 with all their
decimals stay texts.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from sgp_ros.errors import RecordingError
from sgp_ros.recordings.table_header import (
    TITLES,
    cells_of,
    header_of,
    is_value,
    names_of,
    with_units,
)
from sgp_ros.recordings.table_units import as_numbers, is_number
from sgp_ros.strangers import read_lines, require_within

Columns = dict[str, np.ndarray]

_OF_SPREADSHEETS = 'Windows-1252'
_FEW = 0.1
"""Share of the cells of a column up to which cells without a number are mistakes."""
_BLOCK = 1 << 22
"""Characters of a block: its rows times its longest line."""
_DIGITS, _FINE = 15, 1e6
"""Precision of a float: that many digits, or below that magnitude 1e-10 of a unit."""
_RAGGED = '[lists of different lengths]'


def load_text(path: Path, remarks: list[str]) -> tuple[Columns, Sequence[int]]:
    """Return the columns of a CSV file by name, and the line of each row.

    A unit in a line below the header follows the name: `angle [deg]`.

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
    header, mark, rest = header_of(path, lines)
    names = names_of(path, header, mark)
    require_within(n * len(names), 'CELLS', f'number of cells of {path}')
    table = _Blocks(path, names, mark)
    skipped: list[int] = []
    called = names
    for number, line in rest:
        if '\0' in line:
            raise RecordingError(f'{path} contains NUL characters', 'a CSV file in UTF-8')
        row = cells_of(line, mark)
        if not table.lines and not any(map(is_value, row)):
            skipped.append(number)  # a second line of the header, such as units
            called = with_units(called, row)
            if len(skipped) > TITLES:
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
    return dict(zip(called, columns.values(), strict=True)), table.lines


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


def _column(cells: np.ndarray) -> np.ndarray:
    """Return a column (n,) of texts; of lists in its cells, the matrix (n, m)."""
    if {cell[:1] + cell[-1:] for cell in cells} not in ({'[]'}, {'()'}):
        return cells
    rows = [cell[1:-1].replace(',', ' ').replace(';', ' ').split() for cell in cells]
    if len({len(row) for row in rows}) > 1:
        return cells
    try:
        numbers = np.array(rows, dtype=np.float64)
    except ValueError:
        return np.char.strip(np.array(rows, dtype=str), '\'"')
    is_exact = '_' not in ''.join(cells) and not np.any(np.abs(numbers) >= _FINE)
    return numbers if is_exact else np.array(rows, dtype=str)
