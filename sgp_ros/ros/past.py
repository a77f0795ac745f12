"""Memory of a robot's past in a node: plain tuples, and their way to another process.

The garbage collector lets go of plain tuples of numbers and arrays; so many objects it would
search for fifty milliseconds while messages wait. To another process they travel as one array a
field: to pickle objects for each sample would keep messages waiting for longer than to stack them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, TypeGuard

import numpy as np

from sgp_ros.engine.samples import CommandSample, JointSample

Names = tuple[str, ...]
State = tuple[int, Names, np.ndarray, np.ndarray | None, np.ndarray | None, int]
Command = tuple[int, np.ndarray, Names | None, str, np.ndarray | None, int]
"""Fields of samples, then the time that had passed in the stream [ns]."""

Layout = tuple[tuple[int, ...] | str | None, ...]
"""Common layout of the samples of a group, a field each: `_NUMBER`, `_ARRAY`, or the value."""
Packed = tuple[np.ndarray, list[tuple[Layout, list[np.ndarray]]]]
"""The group of each sample in the order in which they came, (n,), and the groups."""
_NUMBER, _ARRAY = '<number>', '<array>'


def samples(past: Iterable[State | Command]) -> tuple[JointSample | CommandSample, ...]:
    """Return what is remembered as events."""
    return tuple(
        JointSample(*fields[:-1]) if is_state(fields) else CommandSample(*fields[:-1])
        for fields in past
    )


def is_state(fields: State | Command) -> TypeGuard[State]:
    """Return whether fields are those of a state."""
    return isinstance(fields[1], tuple)


def packed(past: Sequence[State | Command]) -> Packed:
    """Return samples as one array for each field of those that are alike.

    Args:
        past: n of them; alike are those of the same joints that hold the same kinds of numbers.
    """
    order = np.empty(len(past), dtype=np.int32)
    groups: dict[Any, tuple[int, list[State | Command]]] = {}
    for i, fields in enumerate(past):
        key = tuple(len(x) if isinstance(x, np.ndarray) else _kind(x) for x in fields)
        number, members = groups.setdefault(key, (len(groups), []))
        order[i] = number
        members.append(fields)
    return order, [_stacked(members) for _, members in groups.values()]


def _stacked(members: list[State | Command]) -> tuple[Layout, list[np.ndarray]]:
    layout = tuple(_ARRAY if isinstance(x, np.ndarray) else _kind(x) for x in members[0])
    columns = [
        np.array([fields[i] for fields in members])
        for i, kind in enumerate(layout)
        if kind in (_NUMBER, _ARRAY)
    ]
    return layout, columns


def _kind(x: Any) -> Any:
    return _NUMBER if isinstance(x, int) else x


def unpacked(content: Packed) -> list[State | Command]:
    """Return the samples behind `packed`."""
    order, groups = content
    rows = [_rows(*group) for group in groups]
    return [next(rows[number]) for number in order]


def _rows(layout: Layout, columns: list[np.ndarray]) -> Iterator[Any]:
    sources: Iterator[Any] = iter(columns)
    count = len(columns[0])
    fields = []
    for kind in layout:
        if kind == _NUMBER:
            fields.append(next(sources).tolist())
        elif kind == _ARRAY:
            fields.append(list(next(sources)))
        else:
            fields.append([kind] * count)
    return iter(zip(*fields, strict=True))
