"""A map of a table that has none, guessed from the names of its columns and from its numbers.

Names tell quantities and joints (`column_names`). Numbers decide what names leave open: the unit
of time by the rate that follows, degrees by the range, the unit of a velocity by the slope of the
position, and whether an `action` is a position by how near it stays to the position. Each
decision that another log could prove wrong is returned in words.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from sgp_ros.errors import RecordingError
from sgp_ros.recordings.column_names import (
    COMMAND,
    CURRENT,
    DUTY,
    EFFORT,
    POSITION,
    VELOCITY,
)
from sgp_ros.recordings.table_blocks import of_blocks
from sgp_ros.recordings.table_entries import (
    Columns,
    Entry,
    Guess,
    JointHint,
    chosen,
    entries_of,
    of_signals,
    of_slides,
)
from sgp_ros.recordings.table_gains import add_gains
from sgp_ros.recordings.table_joints import joint_names, of_one_joint, of_robot
from sgp_ros.recordings.table_time import approach, guessed_times
from sgp_ros.recordings.table_units import (
    SCALED_AS,
    UNITS,
    as_numbers,
    follows,
    position_unit,
    slide_unit,
    velocity_unit,
)

_EFFORTS = {unit for unit, factor in UNITS['effort'].items() if factor}


def guess_map(
    columns: Columns, hints: Sequence[JointHint] = (),
    features: Mapping[str, Sequence[str]] | None = None, rate_hz: float | None = None,
) -> Guess:  # fmt: skip
    """Return a map of a table.

    Args:
        columns: of the table by name.
        hints: joints of the robot in its order; none where it is not known.
        features: names of the parts of a column, where a file says them.
        rate_hz: where the table has no time; None for one that it states.

    Raises:
        RecordingError: no time or no positions can be recognised.
    """
    guess, rows, known = Guess(), _rows(columns), [h.name for h in hints]
    seconds = guessed_times(columns, rows, rate_hz, known, guess)
    entries = entries_of(columns, rows, features or {}, known)
    entries = of_signals(of_slides(entries, hints, guess), guess)
    entries = of_blocks(entries, hints, seconds, guess)
    positions = chosen(entries, POSITION, guess)
    if not positions:
        texts = sorted(name for name, column in columns.items() if as_numbers(column) is None)
        raise RecordingError(
            f'no column of positions among {_with_widths(columns, texts)}'
            + f' (not numeric throughout: {texts})' * bool(texts),
            'a name such as q, position, joint1_pos',
            'rename a column, or write a map (docs/import.md)',
        )  # fmt: skip
    entries = of_one_joint(entries, positions, hints, guess)
    joints = joint_names(positions, columns, hints, guess)
    entries, positions = of_robot(entries, positions, joints, guess)
    guess.unsure += _missing(known, joints.values())
    hinted = {h.name: h for h in hints}
    units = _position_units(positions, joints, hinted, guess)
    found: dict[str, dict[str, Any]] = {
        name: {'position': positions[label].place(units[label])} for label, name in joints.items()
    }
    _add_velocities(found, entries, joints, positions, units, seconds, guess)
    side = approach(columns, guess.content['time'])
    if side:
        guess.unsure.append(
            f'The rows are taken as poses that were approached from the side that {side} tells: '
            'diagnose them with --static.'
        )
        for channels in found.values():
            channels['velocity'] = {'column': side, 'unit': 'rad/s'}
    _add_efforts(found, entries, joints, hinted, guess)
    guess.content['joints'] = found
    add_gains(columns, entries, joints, rows, guess)
    _add_commands(entries, joints, positions, units, seconds, guess)
    if not (
        {'commands', 'targets'} & set(guess.content) or any('effort' in x for x in found.values())
    ):
        guess.unsure.append(
            f'No torque, current or command was recognised among {", ".join(sorted(columns))}: '
            'enter it in the map, or list joints without a motor as `passive` in a robot YAML.'
        )
    return guess


def _missing(known: Sequence[str], found: Collection[str]) -> list[str]:
    """Return a sentence on joints of the robot without a column."""
    missing = ', '.join(name for name in known if name not in found)
    said = f'No column of positions was recognised for {missing}: enter it in the map.'
    return [said] * bool(missing)


def _with_widths(columns: Columns, texts: Sequence[str]) -> list[str]:
    """Return the names of columns of numbers, and of a matrix the number of its columns."""
    return [
        f'{name} ({x.shape[1]} columns)' if x.ndim == 2 else name
        for name, x in sorted(columns.items()) if name not in texts
    ]  # fmt: skip


def _rows(columns: Columns) -> int:
    """Return the length that most numbers of the table have."""
    sizes: dict[int, int] = {}
    for array in columns.values():
        sizes[len(array)] = sizes.get(len(array), 0) + array.size
    if not sizes or max(sizes.values()) < 2:
        raise RecordingError('a table without rows', 'columns of at least two numbers')
    return max(sizes, key=lambda n: sizes[n])


def _position_units(
    positions: Mapping[str, Entry], joints: Mapping[str, str], hinted: Mapping[str, JointHint],
    guess: Guess,
) -> dict[str, str]:  # fmt: skip
    hints = {x: hinted.get(joints[x], JointHint(joints[x])) for x in positions}
    said = {x: positions[x].said.unit for x in positions}
    ranges = [
        (positions[x].numbers, hint.lower, hint.upper) for x, hint in hints.items()
        if not hint.slides and said[x] not in {'rad', 'deg', 'rev', 'counts'}
        and not (said[x] in {'m', 'mm'} and joints[x] not in hinted)
    ]  # fmt: skip
    angle, is_sure = position_unit(ranges, are_joints_known=bool(hinted))
    if ranges and not is_sure:
        guess.unsure.append(
            f'Positions go beyond one turn or their range and are assumed to be in {angle}.'
        )
    units = {}
    for x, hint in hints.items():
        slide = slide_unit(positions[x].numbers, hint.lower, hint.upper) if hint.slides else ''
        is_known = joints[x] in hinted
        units[x] = positions[x].unit_of_position(slide or angle, is_known=is_known)
        if units[x] == 'mm' != said[x]:
            guess.unsure.append(f'{joints[x]} is assumed to be in mm, to stay within its range.')
    return units


def _add_velocities(
    found: dict[str, dict[str, Any]], entries: Sequence[Entry], joints: Mapping[str, str],
    positions: Mapping[str, Entry], units: Mapping[str, str], seconds: np.ndarray, guess: Guess,
) -> None:  # fmt: skip
    velocities = chosen(entries, VELOCITY, guess)
    for label, e in velocities.items():
        if label not in joints:
            guess.unsure.append(f'The velocity {e.column} belongs to no position column: ignored.')
            continue
        unit, said = velocity_unit(
            e.numbers, positions[label].numbers, seconds, units[label], e.said.unit
        )
        if said:
            guess.unsure.append(f'The velocity of {joints[label]} {said}.')
        found[joints[label]]['velocity'] = e.place(unit)


def _add_efforts(
    found: dict[str, dict[str, Any]], entries: Sequence[Entry], joints: Mapping[str, str],
    hinted: Mapping[str, JointHint], guess: Guess,
) -> None:  # fmt: skip
    known = ((role, chosen(entries, role, guess)) for role in (EFFORT, CURRENT, DUTY))
    role, efforts = next((x for x in known if x[1]), (EFFORT, {}))
    open_unit = ''
    for label, e in efforts.items():
        if label not in joints:
            guess.unsure.append(f'The effort {e.column} belongs to no position column: ignored.')
            continue
        usual = {CURRENT: 'A', DUTY: '%'}.get(role, e.said.unit)
        unit, more = e.said.unit if e.said.unit in SCALED_AS else usual, {}
        if UNITS['effort'].get(unit, 1.0) is None:
            open_unit, more = unit, {'scale': 1.0}
        elif unit not in _EFFORTS:
            unit = 'N' if joints[label] in hinted and hinted[joints[label]].slides else 'N m'
        found[joints[label]]['effort'] = e.place(unit, **more)
    if open_unit:
        guess.unsure.append(
            f'The efforts are in {open_unit}: enter the torque of 1 '
            f'{SCALED_AS.get(open_unit, (open_unit,))[0]} in N m as `scale` in the map.'
        )


def _asked(
    entries: Sequence[Entry], joints: Mapping[str, str], guess: Guess
) -> dict[str, dict[str, Entry]]:
    """Return the targets and commands of joints with a position, by kind; tell the others."""
    asked = {
        kind: chosen(entries, kind, guess, is_target=True)
        for kind in (POSITION, VELOCITY, EFFORT, COMMAND)
    }
    guess.unsure += [
        f'The command {e.column} belongs to no position column: ignored.'
        for found in asked.values() for x, e in found.items() if x not in joints
    ]  # fmt: skip
    return {kind: {x: e for x, e in found.items() if x in joints} for kind, found in asked.items()}


def _meant(
    commands: Mapping[str, Entry],
    positions: Mapping[str, Entry],
    seconds: np.ndarray,
    guess: Guess,
) -> tuple[str, str]:
    """Return what commands ask for whose names do not say it, empty if that is open, in words."""
    pairs = [(e.numbers, positions[x].numbers) for x, e in commands.items()]
    if float(np.median([follows(u, q) for u, q in pairs])) > 0.5:
        return POSITION, 'stays close to the positions: taken as position targets'
    with np.errstate(divide='ignore', invalid='ignore'):
        near = [follows(u, np.gradient(q, seconds)) for u, q in pairs]
    if float(np.median(near)) > 0.5:
        return VELOCITY, 'stays close to the velocities: taken as velocity targets'
    if any('effort' in x for x in guess.content['joints'].values()):
        return '', 'commands something that the positions do not follow: ignored'
    return EFFORT, (
        'is followed by neither positions nor velocities, and no effort is measured: taken as '
        'commanded efforts in N m, or N'
    )


def _add_commands(
    entries: Sequence[Entry], joints: Mapping[str, str], positions: Mapping[str, Entry],
    units: Mapping[str, str], seconds: np.ndarray, guess: Guess,
) -> None:  # fmt: skip
    """Enter targets of position or velocity, or commanded efforts, whichever the log has."""
    named = _asked(entries, joints, guess)
    known = {x for found in (named[POSITION], named[VELOCITY], named[EFFORT]) for x in found}
    open_ones = {x: e for x, e in named.pop(COMMAND).items() if x not in known}
    if open_ones:
        kind, said = _meant(open_ones, positions, seconds, guess)
        named |= {kind: named[kind] | open_ones} if kind else {}
        guess.unsure.append(f'{", ".join(e.column for e in open_ones.values())} {said}.')
    copies = [x for x, e in named[POSITION].items()
              if np.array_equal(e.numbers, positions[x].numbers, equal_nan=True)]  # fmt: skip
    if named[POSITION] and len(copies) == len(named[POSITION]):
        column = next(iter(named[POSITION].values())).column
        guess.unsure.append(f'The target {column} equals the measured position: ignored.')
        named[POSITION] = {}
    targets = {
        joints[x]: {
            kind: e[x].place(
                e[x].unit_of_position(units[x], is_known=True) + '/s' * (kind == VELOCITY)
            )
            for kind, e in ((POSITION, named[POSITION]), (VELOCITY, named[VELOCITY])) if x in e
        }
        for x in joints if x in named[POSITION] or x in named[VELOCITY]
    }  # fmt: skip
    columns = ', '.join(dict.fromkeys(e.column for e in named[EFFORT].values()))
    measured = any('effort' in x for x in guess.content['joints'].values())
    if targets and columns and not measured and 'gains' not in guess.content:
        guess.unsure.append(f'{columns} is used; the targets are not, as no gains are given.')
        targets = {}
    if targets:
        guess.content['targets'] = targets
        if columns:
            guess.unsure.append(
                f'{columns} is ignored: it is not known if the drives follow it or the targets.'
            )
    elif columns:
        guess.content['commands'] = {
            joints[x]: e.place(e.said.unit if e.said.unit in _EFFORTS else 'N m')
            for x, e in named[EFFORT].items()
        }
