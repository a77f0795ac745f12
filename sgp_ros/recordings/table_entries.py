"""The columns of a table as entries: which quantity of which joint each one is said to hold."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from sgp_ros.recordings.column_names import (
    COMMAND,
    CURRENT,
    EFFORT,
    OTHER,
    POSITION,
    STATE,
    VELOCITY,
    Meaning,
    meaning,
)
from sgp_ros.recordings.table_units import as_numbers

Columns = dict[str, np.ndarray]
_SYMBOL = re.compile(r'([uyz])[_.]?(\d*)')
_OF_SLIDES = {'x': POSITION, 'dx': VELOCITY, 'vx': VELOCITY, 'xdot': VELOCITY}
"""Symbols of a joint that slides, where a name says no quantity."""
_ROLES = {
    **dict.fromkeys(('rad', 'deg', 'mm'), POSITION),
    **dict.fromkeys(('rad/s', 'deg/s', 'rpm', 'm/s', 'mm/s'), VELOCITY),
    'A': CURRENT, 'mA': CURRENT,
    **dict.fromkeys(('N m', 'mN m', 'kN m', 'N mm', 'N cm', 'kgf cm', 'mN', 'kN'), EFFORT),
}  # fmt: skip
"""Units that only one quantity of a joint has."""


@dataclass(frozen=True, slots=True)
class JointHint:
    """Prior knowledge of a joint before the table is read.

    Attributes:
        name: of the joint.
        slides: whether it is prismatic.
        lower, upper: range [rad or m], infinite for none.
        is_driven: whether it has a motor.
    """

    name: str
    slides: bool = False
    lower: float = -np.inf
    upper: float = np.inf
    is_driven: bool = True


@dataclass(frozen=True, slots=True)
class Entry:
    """One joint's column."""

    column: str
    index: int | None
    said: Meaning
    label: str
    numbers: np.ndarray

    def unit_of_position(self, usual: str, *, is_known: bool) -> str:
        """Return the unit of a position that the name states, or else the usual one.

        If it is known whether the joint slides, as the usual one says, it is one of that kind: the
        end of `theta_m` may stand for a motor.
        """
        kinds = {'rad': 1, 'deg': 1, 'rev': 1, 'm': 0, 'mm': 0}
        said = self.said.unit
        is_it = said in kinds and not (is_known and kinds[said] != kinds.get(usual, kinds[said]))
        return said if is_it else usual

    def place(self, unit: str, **more: float) -> dict[str, Any]:
        """Return the entry of a map."""
        index = {} if self.index is None else {'index': self.index}
        return {'column': self.column, **index, 'unit': unit, **more}


@dataclass(slots=True)
class Guess:
    """A map and what was not sure about it.

    Attributes:
        content: the map, as in a file.
        unsure: one sentence each.
    """

    content: dict[str, Any] = field(default_factory=dict)
    unsure: list[str] = field(default_factory=list)


def entries_of(
    columns: Columns, rows: int, features: Mapping[str, Sequence[str]], joints: Sequence[str]
) -> list[Entry]:
    """Return the columns of numbers, those of matrices one by one."""
    found = []
    for name, array in columns.items():
        if array.ndim > 2 or len(array) != rows:
            continue
        parts = features.get(name, ())
        wide = array if array.ndim == 2 else array[:, None]
        units = re.split(r'[\s,;]+', name.rpartition('[')[2].rstrip(' ]'))
        for i in range(wide.shape[1]):
            numbers = as_numbers(wide[:, i])
            if numbers is None:
                continue
            said, label = meaning(name, joints), str(i) if array.ndim == 2 else ''
            if len(parts) == wide.shape[1]:
                inner = meaning(parts[i], joints)
                role = inner.role if inner.role not in {'', OTHER} else said.role
                said = Meaning(role, said.is_target, inner.rest, inner.unit or said.unit)
                label = inner.joint or parts[i]
            if len(units) == wide.shape[1] > 1:
                said = replace(said, unit=meaning(f'value [{units[i]}]').unit)
            index = i if array.ndim == 2 else None
            found.append(Entry(name, index, said, label, numbers))
    return _labelled(_of_states(_named_by_units(found)))


def _named_by_units(entries: list[Entry]) -> list[Entry]:
    """Let a unit say the quantity where no name does: `elbow_deg` is a position."""
    named = {(e.said.role, e.said.is_target) for e in entries}
    found = []
    for e in entries:
        role = _ROLES.get(e.said.unit, '')
        is_open = e.said.role in {'', COMMAND} and role and (role, e.said.is_target) not in named
        found.append(replace(e, said=replace(e.said, role=role)) if is_open else e)
    return found


def _of_states(entries: list[Entry]) -> list[Entry]:
    """Let states be positions where no name says `position`; else they are of something else."""
    named = {(e.said.role, e.said.is_target) for e in entries}
    roles = {x: OTHER if (POSITION, x) in named else POSITION for x in (False, True)}
    return [
        replace(e, said=replace(e.said, role=roles[e.said.is_target]))
        if e.said.role == STATE else e
        for e in entries
    ]  # fmt: skip


def _labelled(entries: list[Entry]) -> list[Entry]:
    """Name the joints of single columns by the words that differ within a quantity."""
    groups: dict[tuple[str, bool], list[Entry]] = {}
    for e in entries:
        groups.setdefault((e.said.role, e.said.is_target), []).append(e)
    found = []
    for group in groups.values():
        plain = [e for e in group if not e.label]
        rests = [list(e.said.rest) for e in plain]
        common = 0
        while rests and len(plain) > 1 and all(len(r) > common + 1 for r in rests) and len({
            r[common] for r in rests
        }) == 1:  # fmt: skip
            common += 1
        for e in group:
            label = e.label or e.said.joint or '_'.join(e.said.rest[common:])
            if not e.label and len(plain) > 1 and common:
                own = replace(e.said, rest=e.said.rest[common:])
                label = own.joint or '_'.join(own.rest) or label
            found.append(Entry(e.column, e.index, e.said, label, e.numbers))
    return found


def of_slides(entries: Sequence[Entry], hints: Sequence[JointHint], guess: Guess) -> list[Entry]:
    """Let `x` be positions and `dx` velocities of a robot with a joint that slides."""
    slides = [h.name for h in hints if h.slides]
    if not slides:
        return list(entries)
    only = slides[0] if len(slides) == 1 else ''
    found = []
    for e in entries:
        symbols = [w for w in e.said.rest if w.lower() in _OF_SLIDES]
        if e.said.role not in {'', COMMAND} or len(symbols) != 1:
            found.append(e)
            continue
        rest = tuple(w for w in e.said.rest if w not in symbols)
        said = replace(e.said, role=_OF_SLIDES[symbols[0].lower()], rest=rest)
        found.append(replace(e, said=said, label=said.joint or only))
        what = f'{"target " * said.is_target}{said.role}'
        guess.unsure.append(f'{e.column} is taken as the {what} of a joint that slides.')
    return found


def of_signals(entries: Sequence[Entry], guess: Guess) -> list[Entry]:
    """Let `y` be positions and `u` efforts, as of any system, where no name tells positions."""
    symbols = [_SYMBOL.fullmatch(e.column.rpartition('.')[2].lower()) for e in entries]
    letters = [m[1] if m else '' for m in symbols]
    measured = {e.said.role for e in entries if not e.said.is_target}
    if POSITION in measured or 'y' not in letters or 'z' in letters:
        return list(entries)
    roles = {'y': POSITION} | ({} if {EFFORT, CURRENT} & measured else {'u': EFFORT})
    found = []
    for e, symbol in zip(entries, symbols, strict=True):
        if symbol is None or symbol[1] not in roles:
            found.append(e)
            continue
        said = replace(e.said, role=roles[symbol[1]], is_target=False)
        found.append(replace(e, said=said, label=symbol[2] if e.index is None else e.label))
        unit = '' if said.role == POSITION or said.unit else ' in N m or N'
        guess.unsure.append(f'{e.column} is taken as the {said.role} of a joint{unit}, as no name '
                            'of a column says what it is.')  # fmt: skip
    guess.unsure = list(dict.fromkeys(guess.unsure))
    return found


def chosen(
    entries: Sequence[Entry], role: str, guess: Guess, *, is_target: bool = False
) -> dict[str, Entry]:
    """Return the columns of a quantity by the label of the joint; of two, the first."""
    found: dict[str, Entry] = {}
    for e in entries:
        if (e.said.role, e.said.is_target) != (role, is_target):
            continue
        if e.label in found:
            kept = found[e.label].column
            if kept != e.column:
                guess.unsure.append(f'The {role} is read from {kept}, not from {e.column}.')
            continue
        found[e.label] = e
    guess.unsure = list(dict.fromkeys(guess.unsure))
    return found
