"""The time of a table that has no map: the column that holds it, or the rate that it states."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from sgp_ros.errors import RecordingError
from sgp_ros.recordings.column_names import TIME, Meaning, meaning
from sgp_ros.recordings.table_entries import Columns, Guess
from sgp_ros.recordings.table_units import PER_SECOND, as_numbers, time_unit

_RATES = {'fs', 'rate', 'hz', 'freq', 'frequency', 'sampling_rate', 'fps'}
_POSES_HZ = 1.0
"""Rate that stands for none."""
_APPROACHES = {'approach', 'side', 'direction'}
_STEPS = {'dt', 'ts', 'step', 'timestep', 'sample_time'}


def guessed_times(
    columns: Columns, rows: int, rate_hz: float | None, joints: Sequence[str], guess: Guess
) -> np.ndarray:
    """Enter the time base into a guess and return the times [s], (n,).

    Args:
        columns: of the table by name.
        rows: n.
        rate_hz: where the table has no time; None for one that it states.
        joints: names of the robot's joints, which are no times.
        guess: of the map, which is completed.

    Raises:
        RecordingError: neither a time nor a rate is recognised.
    """
    named = [
        name for name, x in columns.items()
        if x.shape[:1] == (rows,) and x.size == rows and _may_be_time(meaning(name, joints))
    ]  # fmt: skip
    named.sort(key=lambda n: (not meaning(n).role, 'des' in n.lower(), len(n)))
    named.sort(key=lambda n: 'header' not in n.lower())  # when it was measured, not when it came
    for name in named if rate_hz is None else ():
        stamps = as_numbers(columns[name])
        if stamps is None:  # texts, such as those of ISO 8601
            guess.content['time'] = {'column': name, 'unit': 's'}
            return np.arange(rows, dtype=np.float64)
        unit, is_sure = time_unit(stamps, meaning(name).unit)
        if not unit or not np.ptp(stamps):
            continue
        if not is_sure:
            guess.unsure.append(f'The time column {name} is assumed to be in {unit}.')
        if len(named) > 1:
            others = ', '.join(n for n in named if n != name)
            guess.unsure.append(f'The time is read from {name}, not from {others}.')
        seconds = stamps / PER_SECOND[unit]
        before = math.ceil(max(-np.nanmin(seconds), 0.0))  # such as those before a trigger
        start = {'start': float(before)} if before else {}
        guess.content['time'] = {'column': name, 'unit': unit, **start, **_episodes(columns, rows)}
        return seconds
    rate_hz = rate_hz or _stated_rate(columns) or (_POSES_HZ if _approach(columns) else None)
    if rate_hz is None:
        raise RecordingError(
            f'no column of time among {sorted(columns)}', 'a name such as t, time, timestamp_ns',
            'give the sampling rate with --rate HZ (any for poses, one a row)',
        )  # fmt: skip
    guess.content['time'] = {'rate': rate_hz}
    return np.arange(rows) / rate_hz


def _may_be_time(said: Meaning) -> bool:
    """Return whether a name says so, or says nothing but a unit of time."""
    return said.role == TIME or (not said.role and said.unit in PER_SECOND)


def approach(columns: Columns, time: Mapping[str, object]) -> str:
    """Return the column that says from which side poses were approached; empty for none.

    Args:
        columns: of the table by name.
        time: of its map; rows that have a time, or a rate, are no poses.
    """
    return _approach(columns) if time == {'rate': _POSES_HZ} else ''


def _approach(columns: Columns) -> str:
    for name, array in columns.items():
        numbers = as_numbers(array)
        if name.lower() in _APPROACHES and numbers is not None and numbers.ndim == 1:
            return name if set(np.unique(numbers)) <= {-1.0, 1.0} else ''
    return ''


def _episodes(columns: Columns, rows: int) -> dict[str, str]:
    """Return the column that numbers episodes whose clocks begin anew; nothing without."""
    for name, array in columns.items():
        word = name.lower().rsplit('.', 1)[-1]
        if word in {'episode_index', 'episode', 'episode_id'} and array.shape == (rows,):
            return {'episode': name} if len(np.unique(array)) > 1 else {}
    return {}


def _stated_rate(columns: Columns) -> float | None:
    """Return the rate that a table of one number states [Hz]; None without."""
    for name, array in columns.items():
        word, value = name.lower(), as_numbers(array.ravel()[:1])
        if array.size == 1 and value is not None and value[0] > 0.0:
            if word in _RATES:
                return float(value[0])
            if word in _STEPS:
                return 1.0 / float(value[0])
    return None
