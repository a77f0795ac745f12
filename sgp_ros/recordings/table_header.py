"""The header of a text table: names of columns, units below them, titles and comments around."""

from __future__ import annotations

import csv
import re
from collections import deque
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path

from sgp_ros.errors import RecordingError
from sgp_ros.recordings.column_names import meaning
from sgp_ros.recordings.table_units import is_number

Numbered = tuple[int, str]
"""A line and its number."""

_DELIMITERS = (';', '\t', ',', ' ')
_COMMENTS = '#%'
_COMMENTS_KEPT, TITLES = 100, 20
"""Lines of comment that may hold the header, and lines without a number behind it."""
_IN_BRACKETS = re.compile(r'\[[^\[\]]*\]')
_APART = re.compile(r'\[[^\[\]]*\]|\S+')
_AROUND = ' "()[]'
_TIME = re.compile(r'\d{4}-\d\d-\d\d[T ]\d')


def header_of(path: Path, lines: Iterator[Numbered]) -> tuple[str, str, Iterator[Numbered]]:
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
    mark = mark_of(first[1] or (comments[-1] if comments else ''))
    if not is_empty and not any(map(is_value, cells_of(first[1], mark))):
        header, below = _below_titles(first, rest)
        return header, mark_of(header), below
    titles = [line for line in comments if len(cells_of(line, mark_of(line))) > 1]
    width = len(cells_of(first[1], mark))
    fitting = [line for line in titles if is_empty or len(cells_of(line, mark_of(line))) == width]
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
        if len(above) > TITLES or any(map(is_value, cells_of(numbered[1], mark_of(numbered[1])))):
            break
    for i, (_, line) in enumerate(above[:-1]):
        cells = cells_of(line, mark := mark_of(line))
        if len(cells) == len(cells_of(above[-1][1], mark)) == len(set(cells)):
            return line, chain(above[i + 1 :], rest)
    return first[1], chain(above[1:], rest)


def names_of(path: Path, header: str, mark: str) -> list[str]:
    """Return the names of the columns."""
    if '\0' in header:
        raise RecordingError(f'{path} contains NUL characters', 'a CSV file in UTF-8')
    names = [name.strip().strip('"') for name in cells_of(header, mark)]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise RecordingError(f'{path} has several columns named {twice}', 'unique names')
    return names


def mark_of(line: str) -> str:
    """Return what separates the cells of a line; what stands in brackets does not count."""
    bare = _IN_BRACKETS.sub('', line)
    return next((mark for mark in _DELIMITERS if mark in bare.strip()), ',')


def cells_of(line: str, mark: str) -> list[str]:
    """Return the cells of a line; a list in brackets or quotes is one cell."""
    if mark == ' ':
        return line.split() if '[' not in line else _APART.findall(line)
    kept = _IN_BRACKETS.sub(lambda m: m.group().replace(mark, '\0'), line)
    cells = next(csv.reader([kept], delimiter=mark), [])
    return [cell.replace('\0', mark) for cell in cells]


def is_value(cell: str) -> bool:
    """Return whether a cell holds a number, a list or a time."""
    text = cell.strip()
    if text.startswith('['):
        return not meaning(f'value {text}').unit
    if _TIME.match(text):
        return True
    return is_number(text.replace(',', '.'))


def with_units(names: Sequence[str], cells: Sequence[str]) -> list[str]:
    """Return names followed by their units, `angle [deg]`, of a line below the header.

    Args:
        names: of the columns.
        cells: of that line; if less than half of it are units, the names are returned as they are.
    """
    units = [meaning(f'value [{cell}]').unit for cell in cells]
    if len(units) != len(names) or 2 * sum(map(bool, units)) < len(units):
        return list(names)
    return [
        f'{name} [{cell.strip(_AROUND)}]' if unit and not meaning(name).unit else name
        for name, cell, unit in zip(names, cells, units, strict=True)
    ]
