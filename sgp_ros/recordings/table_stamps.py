"""Stamps of the rows of a table."""

from __future__ import annotations

import re
from collections.abc import Iterable
from datetime import datetime
from decimal import Decimal, InvalidOperation, Overflow
from pathlib import Path

import numpy as np

from sgp_ros.errors import RecordingError
from sgp_ros.recordings.table_files import Columns
from sgp_ros.recordings.table_map import Quantity, TimeBase

_ISO = re.compile(r'(\d{4}-\d\d-\d\d)[T ](\d\d:\d\d:\d\d)(?:[.,](\d+))?(Z|[+-]\d\d:\d\d)?')
_PAUSE_NS = 10 * 10**9
"""Between episodes: they are never taken for one motion [ns]."""
_LATEST_NS = 2**31 * 10**9
"""First stamp that a ROS message cannot hold [ns]."""


def row_stamps(path: Path, columns: Columns, time: TimeBase, n: int) -> tuple[int, ...]:
    """Return the stamps [ns]; integers and decimal texts are converted without rounding.

    Args:
        path: of the table.
        columns: of it by name.
        time: where stamps come from.
        n: number of rows.

    Raises:
        RecordingError: a time that is none, or that no message can hold.
    """
    if time.quantity is None:
        period_ns = 10**9 / Decimal(str(time.rate_hz))
        _require_held(path, (time.start_ns, time.start_ns + (n - 1) * period_ns))
        return tuple(time.start_ns + round(row * period_ns) for row in range(n))
    unit_ns = Decimal(str(time.quantity.factor))
    stamps = []
    for row, value in enumerate(column_of(columns, time.quantity).tolist(), start=1):
        stamp_ns = _stamp(value, unit_ns, time.start_ns)
        if stamp_ns is None or not 0 <= stamp_ns < _LATEST_NS:
            raise RecordingError(
                f'{path}, column {time.quantity.column}, row {row}: time {value!r}',
                'a time between 0 s and 2^31 s since the epoch',
                'correct the table, or set time.unit, or time.start to the seconds that are added '
                'to each time, in the map',
            )
        stamps.append(stamp_ns)
    found = _one_after_another(stamps, columns[time.episode]) if time.episode else tuple(stamps)
    _require_held(path, found)
    return found


def _require_held(path: Path, stamps_ns: Iterable[int | Decimal]) -> None:
    """Refuse stamps that no message can hold."""
    wrong = next((s for s in stamps_ns if not 0 <= s < _LATEST_NS), None)
    if wrong is not None:
        raise RecordingError(
            f'{path}: a row at {Decimal(wrong) / 10**9:.6g} s', 'times between 0 s and 2^31 s',
            'correct time.rate, time.start or time.episode in the map',
        )  # fmt: skip


def _one_after_another(stamps: list[int], episode: np.ndarray) -> tuple[int, ...]:
    """Return stamps of episodes with a pause between each and the next."""
    found: list[int] = []
    later = 0
    for row, stamp_ns in enumerate(stamps):
        if row and episode[row] != episode[row - 1]:
            later = found[-1] + _PAUSE_NS - stamp_ns
        found.append(stamp_ns + later)
    return tuple(found)


def _stamp(value: float | str, unit_ns: Decimal, start_ns: int) -> int | None:
    if isinstance(value, str) and _ISO.fullmatch(value.strip()):
        return _iso_stamp(value.strip())
    try:
        stamp = Decimal(str(value)) * unit_ns + start_ns
        # before rounding: 1e999999999 is a number of a billion digits
        return round(stamp) if abs(stamp) < _LATEST_NS else None
    except (InvalidOperation, Overflow):
        return None


def _iso_stamp(text: str) -> int | None:
    """Return the stamp of an ISO 8601 time, UTC where it names no zone; None of an impossible one.

    Decimals of a second are kept to the nanosecond.
    """
    match = _ISO.fullmatch(text)
    assert match is not None
    day, clock, decimals, zone = match.groups()
    try:
        whole = datetime.fromisoformat(f'{day}T{clock}{(zone or "+00:00").replace("Z", "+00:00")}')
    except (ValueError, OverflowError):
        return None
    return int(whole.timestamp()) * 10**9 + int((decimals or '').ljust(9, '0')[:9])


def column_of(columns: Columns, quantity: Quantity) -> np.ndarray:
    """Return the column of a quantity, (n,)."""
    array = columns[quantity.column]
    return array[:, quantity.index or 0] if array.ndim == 2 else array
