"""The recordings of a campaign as columns: when, in which session, of which robot, how warm."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

PAUSE_S = 4.0 * 3600.0
"""A pause that begins a new session; gears and motors are cold again after a few hours [s]."""
LEAST_SHARE = 0.9
"""Of the diagnosed recordings that must assert an effect: where only large values are asserted,
a slope of those that are would be wrong."""
_NAMES = ('joint', 'effect', 'parameter')

Key = tuple[str, str, str, str]
"""Task, joint, effect, parameter."""


@dataclass(slots=True)
class Series:
    """Estimates of one quantity: numbers of the recordings, values and standard deviations."""

    rows: list[int] = field(default_factory=list)
    value: list[float] = field(default_factory=list)
    std: list[float] = field(default_factory=list)
    unit: str = ''


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """The recordings of a campaign as columns.

    Attributes:
        names: (m,) of recordings.
        time: (m,) when each began [s]; NaN where that is not known.
        age: (m,) middle of it after the beginning of its session [s].
        sessions, robots: (m,) numbers.
        robot_names: by number.
        covariates: (m,) by name; NaN where none is given.
    """

    names: Sequence[str]
    time: np.ndarray
    age: np.ndarray
    sessions: np.ndarray
    robots: np.ndarray
    robot_names: Sequence[str]
    covariates: Mapping[str, np.ndarray]


def frame_of(results: Sequence[Mapping[str, Any]]) -> Frame:
    """Return the recordings of a campaign as columns, sessions told apart by pauses.

    Args:
        results: as `campaign.table.result_rows` has them, with `covariates`.
    """
    start = np.array([math.nan if r.get('start_ns') is None else 1e-9 * r['start_ns']
                      for r in results])  # fmt: skip
    length = np.array([r.get('duration_s') or 0.0 for r in results])
    names, robots = np.unique([str(r['robot']) for r in results], return_inverse=True)
    sessions = np.arange(len(results))
    age = 0.5 * length
    for robot in range(len(names)):
        rows = np.flatnonzero((robots == robot) & np.isfinite(start))
        rows = rows[np.argsort(start[rows], kind='stable')]
        for before, row in zip(rows[:-1].tolist(), rows[1:].tolist(), strict=True):
            said, last = (results[i].get('session') for i in (row, before))
            pause = start[row] - start[before] - length[before]
            if said == last and (said is not None or pause < PAUSE_S):
                sessions[row] = sessions[before]
                age[row] += start[row] - start[sessions[row]]
    columns = {c: None for r in results for c in r.get('covariates', {})}
    covariates = {
        c: np.array([r.get('covariates', {}).get(c, math.nan) for r in results]) for c in columns
    }
    return Frame(
        [r['recording'] for r in results], start, age, sessions, robots, names.tolist(), covariates
    )


def series_of(results: Sequence[Mapping[str, Any]]) -> dict[Key, Series]:
    """Return the estimates by quantity: coefficients of joints, and effects that all assert."""
    series: dict[Key, Series] = defaultdict(Series)
    diagnosed = 0
    for i, result in enumerate(results):
        for task, done in result['tasks'].items():
            diagnosed += task == 'diagnose' and 'rows' in done
            for row in done.get('rows', ()):
                if row.get('std') and _is_of_joint(row):
                    joint, effect, name = (row.get(k) or '' for k in _NAMES)
                    found = series[task, joint, effect, name]
                    found.rows.append(i)
                    found.value.append(row['value'])
                    found.std.append(row['std'])
                    found.unit = row['unit']
    return {key: s for key, s in series.items()
            if key[0] != 'diagnose' or len(s.rows) >= LEAST_SHARE * diagnosed}  # fmt: skip


def _is_of_joint(row: Mapping[str, Any]) -> bool:
    """Return whether a row is a friction, a gain or the like, not an inertia of a link."""
    if row['kind'] == 'coefficient':
        place, dot, _ = str(row['parameter']).partition('.')
        return bool(row['joint']) and (not dot or place == row['joint'])
    return row['kind'] in {'finding', 'shared'}
