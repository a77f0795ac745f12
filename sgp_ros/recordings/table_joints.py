"""The joints of a table's columns: by names in the table or of the columns, or in their order."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

from sgp_ros.errors import RecordingError
from sgp_ros.recordings.column_names import OTHER, POSITION, VELOCITY
from sgp_ros.recordings.table_entries import Columns, Entry, Guess, JointHint

_NAMES = ('names', 'joint_names', 'joints', 'name')
_DIGITS = '0123456789'


def of_one_joint(
    entries: Sequence[Entry], positions: Mapping[str, Entry], hints: Sequence[JointHint],
    guess: Guess,
) -> list[Entry]:  # fmt: skip
    """Give what stands alone of its quantity to the only joint, whatever it is called.

    A table of one pendulum may say `Angle` and `Motor torque cmd`. Of a robot with one motor, what
    a motor does belongs to its joint.
    """
    driven = [h.name for h in hints if h.is_driven]
    is_only = len(positions) == 1 >= len(hints)
    one = [x for x in positions if is_only or (len(driven) == 1 and _same(x, *driven))]
    if len(one) != 1:
        return list(entries)
    (label,), found = one, []
    others = {'', OTHER} if is_only else {'', OTHER, POSITION, VELOCITY}
    groups = [(e.said.role, e.said.is_target) for e in entries]
    for e, group in zip(entries, groups, strict=True):
        is_alone = e.said.role not in others and groups.count(group) == 1 and e.label != label
        if is_alone and e.said.joint and label:
            what = 'position' if is_only else 'joint with a motor'
            guess.unsure.append(f'{e.column} is taken as that of {label}, the only {what}.')
        found.append(replace(e, label=label) if is_alone else e)
    return found


def joint_names(
    positions: Mapping[str, Entry], columns: Columns, hints: Sequence[JointHint], guess: Guess
) -> dict[str, str]:
    """Return the label of each joint's column and its name.

    Columns of other joints are left out where all joints of the robot have theirs.
    """
    labels = list(positions)
    names = _listed(columns, hints)
    said_names: dict[str, str] = {}
    if len(set(names)) == len(labels) and all(not x.strip(_DIGITS) for x in labels):
        if not hints or {h.name for h in hints} & {*names}:
            return dict(zip(labels, names, strict=True))
        said_names = dict(zip(labels, names, strict=True))  # another driver's, as `fer_joint1`
    if not hints:
        plain = [x for x in labels if not x.strip(_DIGITS)]
        first = min((int(x) for x in plain if x), default=0)
        return {x: f'joint_{int(x or first) - first + 1}' if x in plain else x for x in labels}
    names_of_robot = [h.name for h in hints]
    whole = {x: _within(positions[x].column, names_of_robot) for x in labels}
    same = {x: [h.name for h in hints if _same(x, h.name)] for x in labels}
    for matched in (whole, same):
        unique = {x: m[0] for x, m in matched.items() if len(m) == 1}
        is_each = len(set(unique.values())) == len(unique)
        if is_each and len(unique) in {len(labels), len(hints)}:
            return unique
        if is_each and len(unique) + 1 == len(labels) == len(hints) > 1:
            (label,), (name,) = {*labels} - {*unique}, {*names_of_robot} - {*unique.values()}
            guess.unsure.append(
                f'{positions[label].column} is taken as the position of {name}, the only joint '
                'without one.'
            )
            return {**unique, label: name}
    numbered = [x for x in labels if x.isdigit()]
    if len(labels) > len(hints) == len(numbered):
        labels = numbered  # others, such as that of a gripper, are not the robot's
    if len(labels) == len(hints):
        plain = sorted(labels, key=int) if all(x.isdigit() for x in labels) else labels
        order = _by_numbers(plain, said_names, hints)
        said = ', '.join(
            f'{said_names.get(x, x) or "the only column"} is {h.name}'
            for x, h in zip(order, hints, strict=True)
        )
        if len(labels) > 1:
            by = 'in the order of the robot file' if order is plain else 'by their numbers'
            guess.unsure.append(f'Columns are assigned to joints {by}: {said}.')
        return {x: h.name for x, h in zip(order, hints, strict=True)}
    raise RecordingError(
        f'positions of {len(labels)} joints ({", ".join(e.column for e in positions.values())})',
        f'those of the robot: {", ".join(h.name for h in hints)}',
        'write a map, or a robot YAML with these joints (docs/import.md)',
    )  # fmt: skip


def _by_numbers(
    order: Sequence[str], names: Mapping[str, str], hints: Sequence[JointHint]
) -> Sequence[str]:
    """Return labels in the order of the robot's joints, if all end in the numbers of these."""
    ends = {re.split(r'\D', names.get(x, x))[-1]: x for x in order}
    asked = [re.split(r'\D', h.name)[-1] for h in hints]
    return [ends[x] for x in asked] if {*asked} == {*ends} and len(ends) == len(order) else order


def of_robot(
    entries: Sequence[Entry], positions: Mapping[str, Entry], joints: Mapping[str, str],
    guess: Guess,
) -> tuple[list[Entry], dict[str, Entry]]:  # fmt: skip
    """Return entries and positions without those of joints that are not the robot's; say which.

    What has the name of a joint in its own belongs to this joint.
    """
    others = [x for x in positions if x not in joints]
    if others:
        columns = ', '.join(dict.fromkeys(positions[x].column for x in others))
        guess.unsure.append(f'The robot has no joint of {columns}: ignored.')
    labels = {name: x for x, name in joints.items()}
    found = []
    for e in entries:
        is_open = e.index is None and e.label not in positions
        named = _within(e.column, tuple(labels)) if is_open else []
        if e.label not in others:
            found.append(replace(e, label=labels[named[0]]) if named else e)
    return found, {x: e for x, e in positions.items() if x in joints}


def _listed(columns: Columns, hints: Sequence[JointHint]) -> list[str]:
    """Return the joints in the order of the columns, where the table lists them."""
    texts = {n: [*map(str, x.ravel())] for n, x in columns.items() if x.dtype.kind == 'U'}
    for listed in texts.values():
        known = [next((h.name for h in hints if _same(t, h.name)), '') for t in listed]
        if all(known) and len(set(known)) == len(listed):
            return known
    return next((texts[n] for n in _NAMES if n in texts), [])


def _same(label: str, name: str) -> bool:
    """Return whether a label names a joint."""
    a, b = (''.join(c for c in x.lower() if c.isalnum()) for x in (label, name))
    bare = b.replace('joint', '')
    return bool(a) and (a in {b, bare} or a.replace('joint', '') == bare)


def _within(column: str, joints: Sequence[str]) -> list[str]:
    """Return the longest of the joints' names that stand in a column's name as words."""
    word = r'(?<![^\W_]){}(?![^\W_])'
    found = [x for x in joints if re.search(word.format(re.escape(x)), column, re.IGNORECASE)]
    return [max(found, key=len)] if found else []
